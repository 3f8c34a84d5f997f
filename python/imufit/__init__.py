"""imufit: find out which physical effect your inertial sensor model is missing, add it, and watch the error fall.

Start with ``imufit.ladder("walk.parquet")``. Every question is a function that takes a log, a file's name, a table of
pandas or polars, or arrays.

Names are loaded when they are first used, so that ``import imufit`` costs next to nothing.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from imufit import devices as devices
    from imufit import errors as errors
    from imufit import figures as figures
    from imufit import filters as filters
    from imufit import lab as lab
    from imufit import log as log
    from imufit import model as model
    from imufit import report as report
    from imufit import results as results
    from imufit._imufit import __version__
    from imufit.errors import InputError
    from imufit.exporting import export
    from imufit.lab.simulate import simulate
    from imufit.log import Log, LogStream, open_log, read
    from imufit.loop import Fit, SensorModel
    from imufit.model.catalogue import catalogue, explain, load_effects
    from imufit.model.effect import effect
    from imufit.model.effect import forget as forget_effect
    from imufit.model.limits import Limits
    from imufit.model.window import Window
    from imufit.results import Addition, Comparison, Diagnosis, EffectCard, Ladder, ModelComparison, Parameter, Params
    from imufit.verbs import allan, calibrate, compare, diagnose, fit, info, join, ladder, plot, replay, tune
else:
    from importlib import import_module

    _MODULES = ("devices", "errors", "figures", "filters", "lab", "log", "model", "report", "results")
    _HOMES = {
        "_imufit": ("__version__",),
        "errors": ("InputError",),
        "exporting": ("export",),
        "lab.simulate": ("simulate",),
        "log": ("Log", "LogStream", "open_log", "read"),
        "loop": ("Fit", "SensorModel"),
        "model": ("Limits", "Window", "catalogue", "effect", "explain", "forget_effect", "load_effects"),
        "results": (
            "Addition",
            "Comparison",
            "Diagnosis",
            "EffectCard",
            "Ladder",
            "ModelComparison",
            "Parameter",
            "Params",
        ),
        "verbs": (
            "allan",
            "calibrate",
            "compare",
            "diagnose",
            "fit",
            "info",
            "join",
            "ladder",
            "plot",
            "replay",
            "tune",
        ),
    }

    def __getattr__(name: str) -> object:
        """Load a public name on first use (PEP 562)."""
        if name in _MODULES:
            return import_module(f"{__name__}.{name}")
        for home, names in _HOMES.items():
            if name in names:
                value = getattr(import_module(f"{__name__}.{home}"), name)
                globals()[name] = value
                return value
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        """Return the public names, loaded or not."""
        return sorted({*__all__, *_MODULES})


__all__ = [
    "Addition",
    "Comparison",
    "Diagnosis",
    "EffectCard",
    "Fit",
    "InputError",
    "Ladder",
    "Limits",
    "Log",
    "LogStream",
    "ModelComparison",
    "Parameter",
    "Params",
    "SensorModel",
    "Window",
    "__version__",
    "allan",
    "calibrate",
    "catalogue",
    "compare",
    "diagnose",
    "effect",
    "explain",
    "export",
    "fit",
    "forget_effect",
    "info",
    "join",
    "ladder",
    "load_effects",
    "open_log",
    "plot",
    "read",
    "replay",
    "simulate",
    "tune",
]
