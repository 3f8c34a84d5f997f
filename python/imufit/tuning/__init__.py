"""Gains of an attitude filter from a log: by its error against a reference, or by its predictions."""

from imufit.tuning.result import Gain, GainMap, Tuning
from imufit.tuning.tune import tune

__all__ = ["Gain", "GainMap", "Tuning", "tune"]
