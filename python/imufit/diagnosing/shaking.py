"""Whether a model states that the sensor is shaken."""

from __future__ import annotations

from imufit.fitting.analysis import Analysis
from imufit.model.catalogue import find_effect


def is_shaken(analysis: Analysis) -> bool:
    """Return whether an effect of the model follows shaking.

    Such a sensor shows the shaking itself, which no reference follows: lines of the spectrum and a residual above the
    stated noise are then expected.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    """
    return any(find_effect(effect).of_shaking for effect in analysis.model.effects)
