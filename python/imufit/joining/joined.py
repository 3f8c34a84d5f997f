"""What joining two recordings found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.joining.mount import SMALL, words
from imufit.log import Log
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class RateTrace(Part):
    """Size of the mean angular rates of both recordings, without their means.

    Attributes
    ----------
    sensor_t, sensor : (n,) arrays
        On the sensor's clock, s and rad/s.
    reference_t, reference : (m,) arrays
        On the reference's clock.
    aligned_t : (m,) array
        Times of the reference on the sensor's clock, s.
    correlation : float
        Of the rates, axis by axis, over the common stretch after joining.
    overlap : float
        Length of the common stretch, s, gaps taken off.
    """

    sensor_t: Array
    sensor: Array
    reference_t: Array
    reference: Array
    aligned_t: Array
    correlation: float
    overlap: float

    @property
    def left(self) -> float:
        """Share of the rates (square) that those of the other do not explain."""
        return 1.0 - max(self.correlation, 0.0) ** 2

    @property
    def gain(self) -> float:
        """Log of the likelihood ratio of "the rates are the same" over "they are unrelated", up to a factor."""
        return -self.overlap * float(np.log(max(self.left, 1e-12)))


@dataclass(frozen=True, eq=False, repr=False)
class Joined(Plotted, Result):
    """Two recordings as one log.

    Attributes
    ----------
    log : Log
        On the sensor's clock; attitude of the sensor, in the reference's frame.
    lag, lag_error : float
        Time by which the reference's stamps are late at its first sample, s (its clock less the sensor's), and the
        standard error.
    skew, skew_error : float
        Rate of the reference's clock over the sensor's, less one, and the standard error.
    mount : (3, 3) array
        Turn from the reference body's axes to the sensor's that was applied.
    left : float
        Angle between the turn that was found and the nearest one that maps axes on axes, rad.
    correlation : float
        Of the rates over the common stretch, after joining.
    overlap : float
        Length of the common stretch, s.
    attitude_error : float
        RMS over axes of the attitude error within a block, rad.
    rival : float
        Share of the rates (square) that is left at this lag over that at the next likeliest one; 0 without one.
    traces : RateTrace
        Rates, for the figure.
    """

    log: Log
    lag: float
    lag_error: float
    skew: float
    skew_error: float
    mount: Array
    left: float
    correlation: float
    overlap: float
    attitude_error: float
    rival: float
    traces: RateTrace

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        late = f"{abs(self.lag):.4f} s {'late' if self.lag >= 0.0 else 'early'}"
        return f"The reference is {late} (correlation {self.correlation:.3f} over {self.overlap:.1f} s)."

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know besides."""
        angle = np.rad2deg(self.left)
        if self.left < SMALL:
            return (
                (f"The sensor is turned by {angle:.1f} deg besides: `ref.alignment` finds it.",) if angle > 0.05 else ()
            )
        return ("The sensor's axes are not parallel to those of the reference body: the whole turn was applied.",)

    def sentences(self) -> list[str]:
        """Return the answer and the remarks."""
        return [self.sentence, *self.remarks]

    def tables(self) -> tuple[Table, ...]:
        """Lag, skew, mount and overlap."""
        rows = (
            ("lag", f"{self.lag:.4f} ± {self.lag_error:.4f} s"),
            ("skew", f"{1e6 * self.skew:.1f} ± {1e6 * self.skew_error:.1f} ppm"),
            ("axes of the sensor on the reference body", words(self.mount)),
            ("common stretch", f"{self.overlap:.1f} s"),
            ("correlation of the rates", f"{self.correlation:.4f}"),
            ("left of the attitude within seconds", f"{np.rad2deg(self.attitude_error):.2f} deg"),
        )
        return (Table("", ("", ">"), rows),)

    def to_dict(self) -> dict[str, Any]:
        """Everything but the log, in SI units."""
        return {
            "lag": self.lag,
            "lag_error": self.lag_error,
            "skew": self.skew,
            "skew_error": self.skew_error,
            "mount": self.mount.tolist(),
            "left": self.left,
            "correlation": self.correlation,
            "overlap": self.overlap,
            "attitude_error": self.attitude_error,
            "rival": self.rival,
            "rows": self.log.n,
        }

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw the rates of both over each other, before and after."""
        from imufit.figures.joined_rates import joined_rates  # noqa: PLC0415

        return joined_rates(self.traces, self.sentence, ax)
