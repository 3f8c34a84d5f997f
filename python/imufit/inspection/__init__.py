"""The contents of a log and the effects that it can show, in words and as a figure."""

from imufit.inspection.info import info
from imufit.inspection.plot import drawing

__all__ = ["drawing", "info"]
