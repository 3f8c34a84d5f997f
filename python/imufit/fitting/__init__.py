"""A stack of effects fitted to a log."""

from imufit.fitting.fitted_stack import FittedStack

__all__ = ["FittedStack"]
