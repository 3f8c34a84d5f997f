"""How strong an effect is in a log, and parameters for a wanted strength.

The size of an effect is the root mean square of (reading with it - reading without it), over the rows and channels of
the sensor that it affects most, divided by that sensor's noise: its white noise and the shaking that no reference
shows. Effects of the reference leave the readings as they are and change what the reference predicts; for these it is
the change of (reading - prediction).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import brentq

from imufit.lab.simulate.entry import Injection, Parameters, Run
from imufit.lab.simulate.environment import Environment
from imufit.lab.simulate.injections import injection
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.sensor import Rows, Setup, discrepancy, readings
from imufit.lab.simulate.truth import Trajectory

SIZES: Mapping[str, float] = {"large": 3.0, "medium": 0.5, "small": 0.1}
"""Named sizes: ratio of effect to white noise."""


class Scale:
    """Measures effects in one noise-free log.

    Parameters
    ----------
    trajectory, environment, run : what is simulated.
    rows : the rows of the log; `sampled` has, for each sensor in the log, which rows (n,) hold a sample of it.
    white : standard deviation of each sensor's white noise, with what shakes it.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        environment: Environment,
        run: Run,
        rows: Rows,
        *,
        sampled: Mapping[str, np.ndarray[tuple[int], np.dtype[np.bool_]]],
        white: Mapping[str, float],
    ) -> None:
        self.trajectory, self.environment, self.run, self.rows = trajectory, environment, run, rows
        self.sampled, self.white = sampled, white

    def ratio(self, effect: str, parameters: Parameters) -> float:
        """Return the size of an effect with these parameters, alone on top of ideal sensors."""
        return max(self.ratios(effect, parameters).values(), default=0.0)

    def ratios(self, effect: str, parameters: Parameters) -> dict[str, float]:
        """Return the ratio to the white noise of each sensor that the effect touches; infinite without noise."""
        sizes = {
            name: float(np.sqrt(np.mean(x[self.sampled[name]] ** 2)))
            for name, x in self.change(effect, parameters).items()
        }
        return {
            name: size / self.white[name] if self.white[name] > 0.0 else (np.inf if size > 0.0 else 0.0)
            for name, size in sizes.items()
        }

    def change(self, effect: str, parameters: Parameters) -> dict[str, Array]:
        """Return what the effect changes in (reading - ideal), (n, 3) for each sensor in the log that it touches."""
        entry = injection(effect)
        setup = Setup.ideal(self.trajectory, self.environment)
        entry.apply(setup, parameters, self.run)
        return discrepancy(setup, self.rows, tuple(name for name in entry.sensors if name in self.sampled))

    def draw(self, effect: str, size: float, rng: np.random.Generator, only: Sequence[str] = ()) -> dict[str, float]:
        """Return random parameters with which the effect has the wanted size; all but those in `only` are zero."""
        entry = injection(effect)
        direction = entry.direction(rng, self.run)
        if only:
            direction = {name: value if name in only else 0.0 for name, value in direction.items()}
        peak = self._peak(entry)

        def ratio(factor: float) -> float:
            return self.ratio(effect, entry.scaled(direction, factor, peak))

        try:
            factor = _solve(ratio, size)
        except ArithmeticError:
            raise ValueError(f"{effect} cannot reach {size} of the noise in this log: it is hardly excited") from None
        return entry.scaled(direction, factor, peak)

    def _peak(self, entry: Injection) -> float:
        if entry.stage != "range":
            return 1.0
        ideal = readings(Setup.ideal(self.trajectory, self.environment), self.rows, entry.sensors)
        return max(float(np.max(np.abs(x))) for x in ideal.values())


def _solve(ratio: Callable[[float], float], size: float, limit: float = 1e6) -> float:
    """Return the factor at which `ratio`, zero at zero and growing, equals `size`; ArithmeticError if it does not."""
    factor, now = 1.0, ratio(1.0)
    for _ in range(6):
        if not now > 0.0:
            break
        factor *= size / now
        now = ratio(factor)
        if math.isclose(now, size, rel_tol=2e-4):
            return factor
    low, high, now = 1.0 / limit, 1.0, ratio(1.0)
    while now < size:
        low, high = high, 2.0 * high
        if high > limit:
            raise ArithmeticError
        now = ratio(high)
    if ratio(low) >= size:
        raise ArithmeticError
    root = brentq(lambda x: ratio(math.exp(x)) / size - 1.0, math.log(low), math.log(high), xtol=1e-6, rtol=1e-8)
    return math.exp(float(root))
