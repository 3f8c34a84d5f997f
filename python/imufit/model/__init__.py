"""Effects, and a stack of them on top of ideal readings."""

from imufit.model.catalogue import catalogue, explain, find_effect, load_effects
from imufit.model.effect import effect
from imufit.model.effect import forget as forget_effect
from imufit.model.effect_stack import EffectStack
from imufit.model.limits import Limits
from imufit.model.window import Window

__all__ = [
    "EffectStack",
    "Limits",
    "Window",
    "catalogue",
    "effect",
    "explain",
    "find_effect",
    "forget_effect",
    "load_effects",
]
