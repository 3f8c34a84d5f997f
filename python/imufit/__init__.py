"""imufit: find out which physical effect your inertial sensor model is missing, add it, and watch the error fall.

Start with ``log = imufit.read("walk.parquet")`` and ``imufit.ladder(log)``.
"""

from imufit import simulate
from imufit._imufit import __version__
from imufit.diagnose import ladder
from imufit.errors import InputError
from imufit.fit import Fit
from imufit.log import Log, LogStream, open_log, read
from imufit.model import SensorModel, Window, catalogue, effect, explain, load_effects
from imufit.results import Addition, Comparison, Diagnosis, EffectCard, Ladder, Parameter

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
    "ladder",
    "load_effects",
    "open_log",
    "read",
    "simulate",
]
