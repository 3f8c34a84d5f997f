"""A stack of effects fitted to a log."""

from imufit.fit.fit import Fit

__all__ = ["Fit"]
