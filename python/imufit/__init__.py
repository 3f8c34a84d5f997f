"""imufit: find out which physical effect your inertial sensor model is missing, add it, and watch the error fall.

Start with ``log = imufit.read("walk.parquet")`` and ``imufit.ladder(log)``.

Names are loaded when they are first used, so that ``import imufit`` costs next to nothing.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from imufit import allan as allan
    from imufit import calibrate as calibrate
    from imufit import compare as compare
    from imufit import device as device
    from imufit import diagnose as diagnose
    from imufit import emulate as emulate
    from imufit import errors as errors
    from imufit import export as export
    from imufit import faults as faults
    from imufit import figures as figures
    from imufit import fit as fit
    from imufit import grade as grade
    from imufit import inspection as inspection
    from imufit import joining as joining
    from imufit import log as log
    from imufit import model as model
    from imufit import monitor as monitor
    from imufit import record as record
    from imufit import replay, simulate
    from imufit import report as report
    from imufit import results as results
    from imufit import tune as tune
    from imufit._imufit import __version__
    from imufit.errors import InputError
    from imufit.inspection.info import info as info
    from imufit.inspection.plot import plot as plot
    from imufit.joining.join import join as join
    from imufit.log import Log, LogStream, open_log, read
    from imufit.loop import Fit, SensorModel, ladder
    from imufit.model.catalogue import catalogue, explain, load_effects
    from imufit.model.effect import Window, effect
    from imufit.results import Addition, Comparison, Diagnosis, EffectCard, Ladder, Parameter
else:
    from importlib import import_module

    _MODULES = (
        "allan",
        "calibrate",
        "compare",
        "device",
        "diagnose",
        "emulate",
        "errors",
        "export",
        "faults",
        "figures",
        "fit",
        "grade",
        "inspection",
        "joining",
        "log",
        "model",
        "monitor",
        "record",
        "replay",
        "report",
        "results",
        "simulate",
        "tune",
    )
    _HOMES = {
        "_imufit": ("__version__",),
        "errors": ("InputError",),
        "inspection": ("info", "plot"),
        "joining": ("join",),
        "log": ("Log", "LogStream", "open_log", "read"),
        "loop": ("Fit", "SensorModel", "ladder"),
        "model": ("Window", "catalogue", "effect", "explain", "load_effects"),
        "results": ("Addition", "Comparison", "Diagnosis", "EffectCard", "Ladder", "Parameter"),
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
    "Log",
    "LogStream",
    "Parameter",
    "SensorModel",
    "Window",
    "__version__",
    "catalogue",
    "effect",
    "explain",
    "info",
    "join",
    "ladder",
    "load_effects",
    "open_log",
    "plot",
    "read",
    "replay",
    "simulate",
]
