"""imufit: find out which physical effect your inertial sensor model is missing."""

from imufit._imufit import __version__

__all__ = ["__version__"]
