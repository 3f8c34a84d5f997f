"""Gains of an attitude filter from a log: by its error against a reference, or by its predictions."""

from imufit.tune.result import Gain, GainMap, Tuning
from imufit.tune.tune import tune

__all__ = ["Gain", "GainMap", "Tuning", "tune"]
