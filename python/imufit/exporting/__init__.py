"""The constant part of a sensor model in the words of others: C, Arduino, imufusion, ahrs, JSON."""

from imufit.exporting.forms import FORMS, export

__all__ = ["FORMS", "export"]
