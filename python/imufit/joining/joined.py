"""The result of joining two recordings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.figures import quantity
from imufit.joining.mount import OPEN, SMALL, axis_words, words
from imufit.log import Log
from imufit.remedy import option
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]

KNOWN = 3.0
"""Standard errors from which on a turn is stated: chance makes one so large once in 370 joins (normal distribution)."""


class Compared(Enum):
    """The compared quantity of two recordings, in words."""

    RATES = "the rates"
    FORCES = "the lengths of the specific force"


@dataclass(frozen=True, eq=False, repr=False)
class RateTrace(Part):
    """Size of what was compared of both recordings: mean angular rates without their means, or specific force.

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
    compared : Compared
        What the two were compared by.
    """

    sensor_t: Array
    sensor: Array
    reference_t: Array
    reference: Array
    aligned_t: Array
    correlation: float
    overlap: float
    compared: Compared = Compared.RATES

    @property
    def label(self) -> str:
        """Name and unit for an axis of a figure."""
        return "rate, deg/s" if self.compared is Compared.RATES else "specific force, m/s²"

    @property
    def factor(self) -> float:
        """The factor of the values for this unit."""
        return float(np.rad2deg(1.0)) if self.compared is Compared.RATES else 1.0

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
    mount : (3, 3) array or None
        Turn from the reference body's axes to the sensor's that was applied; None where the reference has positions
        alone. The body of an encoder turns about its x axis.
    mount_error : float
        Standard error of the turn about the axis about which it is least sure, rad; infinite where nothing shows it.
    by_gravity : bool
        True if all motion is about one axis, so that the turn about this axis follows from gravity.
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
    upside_down : bool
        True if the specific force points down in the frame of the reference: the frame is another, or the sign.
    axis : (3,) array or None
        Unit vector, in the sensor, of the axis of an encoder; None for other references.
    """

    log: Log
    lag: float
    lag_error: float
    skew: float
    skew_error: float
    mount: Array | None
    mount_error: float
    by_gravity: bool
    left: float
    correlation: float
    overlap: float
    attitude_error: float
    rival: float
    traces: RateTrace
    upside_down: bool = False
    axis: Array | None = None

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        late = f"{abs(self.lag):.4f} s {'late' if self.lag >= 0.0 else 'early'}"
        return f"The reference is {late} (correlation {self.correlation:.3f} over {self.overlap:.1f} s)."

    @property
    def remarks(self) -> tuple[str, ...]:
        """Further notes for the reader."""
        on_frame = (self._on_the_frame(),) if self.upside_down else ()
        if self.traces.compared is not Compared.RATES:
            return (*on_frame, *self._on_the_mount())
        return (
            *on_frame,
            *self._on_the_mount(),
            "The lag includes a delay of the gyroscope: two clocks do not show it apart.",
        )

    def _on_the_frame(self) -> str:
        """Return a note on a frame that has the vertical the other way."""
        up = self.frame == "NED"
        other = option("frame", "ENU" if up else "NED")
        return (
            f"By gravity the z axis of the reference points {'up' if up else 'down'}, and that of frame {self.frame} "
            f"{'down' if up else 'up'}: state {other}, or mend the sign of the accelerometer."
        )

    def _on_the_mount(self) -> tuple[str, ...]:
        """Return notes on how the sensor is turned."""
        angle = np.rad2deg(self.left)
        if self.mount is None:
            return ("The reference has positions alone: the log has no attitude.",)
        if self.axis is not None:
            level = (
                f"At angle 0 the sensor is tilted as gravity shows, in frame {self.frame}; its heading is arbitrary."
            )
            unknown = "Gravity does not show how the axis lies: the attitude is taken to be none at angle 0."
            return (level if self.by_gravity else unknown,)
        if self.mount_error > OPEN:
            return (
                "All motion is about one axis, and nothing shows how the sensor is turned about this axis. "
                "Its axes are taken to be as nearly parallel to those of the reference body as the motion allows.",
            )
        settled = (
            (f"All motion is about one axis. The turn about this axis follows from gravity, with frame {self.frame}.",)
            if self.by_gravity
            else ()
        )
        if self.left >= SMALL:
            whole = "The sensor's axes are not parallel to those of the reference body: the whole turn was applied."
            return (*settled, whole)
        if self.left > KNOWN * self.mount_error:
            return (*settled, f"The sensor is turned by {angle:.1f} deg besides: `ref.alignment` finds it.")
        return settled

    @property
    def frame(self) -> str:
        """Frame of the reference."""
        return self.log.metadata.frame

    def sentences(self) -> list[str]:
        """Return the answer and the remarks."""
        return [self.sentence, *self.remarks]

    def tables(self) -> tuple[Table, ...]:
        """Lag, skew, mount and overlap."""
        rows = (
            ("lag", quantity.with_error(self.lag, self.lag_error, "s")),
            ("skew", f"{1e6 * self.skew:.1f} ± {1e6 * self.skew_error:.1f} ppm"),
            *self._how_mounted(),
            ("common stretch", f"{self.overlap:.1f} s"),
            (f"correlation of {self.traces.compared.value}", f"{self.correlation:.4f}"),
        )
        if self.mount is not None:
            rows = (*rows, ("left of the attitude within seconds", f"{np.rad2deg(self.attitude_error):.2f} deg"))
        return (Table("", ("", ">"), rows),)

    def _how_mounted(self) -> tuple[tuple[str, str], ...]:
        if self.axis is not None:
            return (("axis of the encoder in the sensor", axis_words(self.axis)),)
        if self.mount is None:
            return ()
        return (("axes of the sensor on the reference body", words(self.mount)),)

    def to_dict(self) -> dict[str, Any]:
        """Everything but the log, in SI units."""
        return {
            "lag": self.lag,
            "lag_error": self.lag_error,
            "skew": self.skew,
            "skew_error": self.skew_error,
            "mount": None if self.mount is None else self.mount.tolist(),
            "mount_error": self.mount_error if np.isfinite(self.mount_error) else None,
            "mount_by_gravity": self.by_gravity,
            "left": self.left,
            "correlation": self.correlation,
            "overlap": self.overlap,
            "attitude_error": self.attitude_error if self.mount is not None else None,
            "rival": self.rival,
            "compared": self.traces.compared.name.lower(),
            "axis": None if self.axis is None else self.axis.tolist(),
            "rows": self.log.n,
        }

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw the rates of both over each other, before and after."""
        from imufit.figures.joined_rates import joined_rates  # noqa: PLC0415

        return joined_rates(self.traces, self.sentence, ax)
