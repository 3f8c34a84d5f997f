"""Results of the loop: frozen results that print, plot, and turn into JSON, data frames and HTML.

Every ``ratio`` and held-out value is residual RMS over noise floor: 1.0 is at the floor.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from imufit.results.addition import Addition
    from imufit.results.attitude import AttitudeBins, AttitudeComparison, AttitudeDependence
    from imufit.results.comparison import ChannelResidual, Comparison, Panel, Spectrum, Where
    from imufit.results.data_fault import DataFault
    from imufit.results.diagnosis import Candidate, Diagnosis, Rival, Unexplained
    from imufit.results.disagreement import Disagreement, Without
    from imufit.results.effect_card import EffectCard
    from imufit.results.effect_sight import EffectSight, ParameterSight
    from imufit.results.judged import Judged
    from imufit.results.ladder import Ladder, Revision, Step
    from imufit.results.log_info import (
        ClippedInfo,
        LogGap,
        LogInfo,
        MotionInfo,
        ReferenceInfo,
        RestInfo,
        SeriesInfo,
    )
    from imufit.results.log_parameters import LogParameters
    from imufit.results.log_rows import LogRows
    from imufit.results.model_comparison import ModelComparison
    from imufit.results.noise_part import NoisePart
    from imufit.results.parameter import Parameter
    from imufit.results.params import Params
    from imufit.results.recording import Recording, RecordingClock, RecordingGap
    from imufit.results.residual_trace import ResidualTrace
    from imufit.results.result import Result
    from imufit.results.table import Table
    from imufit.results.tilt import Mark, TiltComparison, TiltFigures
else:
    from importlib import import_module

    _HOMES = {
        "addition": ("Addition",),
        "attitude": (
            "AttitudeBins",
            "AttitudeComparison",
            "AttitudeDependence",
        ),
        "comparison": (
            "ChannelResidual",
            "Comparison",
            "Panel",
            "Spectrum",
            "Where",
        ),
        "data_fault": ("DataFault",),
        "diagnosis": (
            "Candidate",
            "Diagnosis",
            "Rival",
            "Unexplained",
        ),
        "disagreement": (
            "Disagreement",
            "Without",
        ),
        "effect_card": ("EffectCard",),
        "effect_sight": (
            "EffectSight",
            "ParameterSight",
        ),
        "judged": ("Judged",),
        "ladder": (
            "Ladder",
            "Revision",
            "Step",
        ),
        "log_info": (
            "ClippedInfo",
            "LogGap",
            "LogInfo",
            "MotionInfo",
            "ReferenceInfo",
            "RestInfo",
            "SeriesInfo",
        ),
        "log_parameters": ("LogParameters",),
        "log_rows": ("LogRows",),
        "model_comparison": ("ModelComparison",),
        "noise_part": ("NoisePart",),
        "parameter": ("Parameter",),
        "params": ("Params",),
        "recording": (
            "Recording",
            "RecordingClock",
            "RecordingGap",
        ),
        "residual_trace": ("ResidualTrace",),
        "result": ("Result",),
        "table": ("Table",),
        "tilt": (
            "Mark",
            "TiltComparison",
            "TiltFigures",
        ),
    }
    _HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

    def __getattr__(name: str) -> object:
        """Load a public name on first use (PEP 562): an effect's card does not need what a log's result needs."""
        if name not in _HOME_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
        globals()[name] = value
        return value


__all__ = [
    "Addition",
    "AttitudeBins",
    "AttitudeComparison",
    "AttitudeDependence",
    "Candidate",
    "ChannelResidual",
    "ClippedInfo",
    "Comparison",
    "DataFault",
    "Diagnosis",
    "Disagreement",
    "EffectCard",
    "EffectSight",
    "Judged",
    "Ladder",
    "LogGap",
    "LogInfo",
    "LogParameters",
    "LogRows",
    "Mark",
    "ModelComparison",
    "MotionInfo",
    "NoisePart",
    "Panel",
    "Parameter",
    "ParameterSight",
    "Params",
    "Recording",
    "RecordingClock",
    "RecordingGap",
    "ReferenceInfo",
    "ResidualTrace",
    "RestInfo",
    "Result",
    "Revision",
    "Rival",
    "SeriesInfo",
    "Spectrum",
    "Step",
    "Table",
    "TiltComparison",
    "TiltFigures",
    "Unexplained",
    "Where",
    "Without",
]
