"""The sensor model: a stack of named effects on top of ideal readings."""

from imufit.model.catalogue import catalogue, explain, find_effect, load_effects
from imufit.model.effect import Window, effect
from imufit.model.sensor_model import SensorModel

__all__ = ["SensorModel", "Window", "catalogue", "effect", "explain", "find_effect", "load_effects"]
