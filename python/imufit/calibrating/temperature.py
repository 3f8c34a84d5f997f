"""Whether poses at different temperatures determine the dependence of bias and scale."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from imufit._imufit import _Solution
    from imufit.rests.poses import Pose

Array = NDArray[np.float64]

ENOUGH = 3.0
"""Range of temperatures (K) below which nothing is asked."""
CONFOUNDED = 0.8
"""Share of the temperature's variance that the pose alone explains, beyond which the two cannot be separated."""


@dataclass(frozen=True)
class Temperature:
    """Temperatures of the poses.

    Attributes
    ----------
    values : (n,) array
        Less their mean, K; zero where the log has none.
    mean : float or None
        degC; None without temperatures.
    span : float
        Largest less smallest, K.
    confounded : float
        Share of their variance that the direction of gravity explains.
    """

    values: Array
    mean: float | None
    span: float
    confounded: float

    @classmethod
    def of(cls, poses: Sequence[Pose]) -> Temperature:
        """Take the temperatures of poses.

        Parameters
        ----------
        poses : sequence of Pose
            The usable ones.
        """
        known = np.array([pose.temperature for pose in poses])
        if not len(known) or np.any(np.isnan(known)):
            return cls(np.zeros(len(poses)), None, 0.0, 0.0)
        values = known - known.mean()
        span = float(np.ptp(known))
        design = np.array([[1.0, *pose.direction] for pose in poses])
        left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
        # Chance alone explains (p - 1) / (n - 1) of it: judge the variance per degree of freedom.
        freedom = max(len(poses) - 4, 0)
        total = float(values @ values) / max(len(poses) - 1, 1)
        rest = float(left @ left) / freedom if freedom else 0.0
        return cls(values, float(known.mean()), span, 1.0 - rest / total if total > 0.0 else 0.0)

    def choose(self, solve: Callable[[bool, bool], _Solution], to_spare: int) -> tuple[tuple[bool, bool], list[str]]:
        """Choose between no temperature, bias, and bias and scale.

        Parameters
        ----------
        solve : callable
            Fits with (bias against temperature, scale against temperature).
        to_spare : int
            Equations beyond the unknowns without temperature.

        Returns
        -------
        chosen : (bool, bool)
            What stands out from its error.
        remarks : list of str
            Why not, where the temperature varied.
        """
        if self.span < ENOUGH:
            return (False, False), []
        shown = f"Temperature varied by {self.span:.1f} K between the poses"
        if self.confounded > CONFOUNDED:
            share = f"{100 * self.confounded:.0f} %"
            return (False, False), [
                f"{shown}, but {share} of that depends on the pose: temperature and pose are confounded, and scale or "
                "misalignment may hide a temperature effect. Take all sides cold, then all sides warm."
            ]
        if to_spare < 4:
            return (False, False), [f"{shown}: too few poses to fit it. Take all sides cold, then all sides warm."]
        for trial in [(True, True), (True, False)] if to_spare >= 8 else [(True, False)]:
            solution = solve(*trial)
            if trial[1]:
                slopes = solution["model_scale_temperature"], solution["model_scale_temperature_error"]
            else:
                slopes = solution["model_bias_temperature"], solution["model_bias_temperature_error"]
            value, error = np.array(slopes)
            if np.any(np.abs(value) > 4.0 * error) and solution["condition"] < 1e3:
                what = "bias and scale depend" if trial[1] else "the bias depends"
                return trial, [f"{shown}: {what} on it, fitted along."]
        return (False, False), [f"{shown}: no dependence stands out from the noise."]
