"""What the loop hands back: frozen results that print, plot, and turn into JSON, data frames and HTML.

Every ``ratio`` and held-out value is residual RMS over noise floor: 1.0 is at the floor.
"""

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
from imufit.results.model_comparison import ModelComparison
from imufit.results.noise_part import NoisePart
from imufit.results.parameter import Parameter
from imufit.results.params import Params
from imufit.results.recording import Recording, RecordingClock, RecordingGap
from imufit.results.result import Result
from imufit.results.table import Table
from imufit.results.tilt import Mark, TiltComparison, TiltFigures

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
