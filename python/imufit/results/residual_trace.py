"""One channel over time: measured, predicted and residual, thinned so that extremes stay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.results.json_value import json_fields
from imufit.results.part import Part
from imufit.results.plotted import Plotted

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ResidualTrace(Plotted, Part):
    """Samples of one channel: of each stretch of time those with the smallest and the largest values.

    Attributes
    ----------
    channel, unit : str
        Name and SI unit.
    t, measured, residual : ndarray
        (m,) time, s; reading, and reading minus prediction, `unit`. A row of NaN interrupts the line over a gap.
    before : ndarray or None
        (m,) residual with the first model, where there are two.
    parts : mapping of ndarray
        (m,) share of each effect of the model in the predicted reading, to first order in its parameters, `unit`.
    noise_floor : float
        Noise of one sample, `unit`.
    model, first_model : str
        Names of the two models.
    """

    channel: str
    unit: str
    t: Array
    measured: Array
    residual: Array
    before: Array | None
    parts: Mapping[str, Array] = field(default_factory=dict)
    noise_floor: float = float("nan")
    model: str = ""
    first_model: str = ""

    @property
    def predicted(self) -> Array:
        """(m,) predicted readings, `unit`."""
        return self.measured - self.residual

    def thinned(self, stretches: int) -> ResidualTrace:
        """Return the trace with fewer samples: the extremes of longer stretches of time.

        Parameters
        ----------
        stretches : int
            How many there are.
        """
        series = [self.measured, self.residual, *([] if self.before is None else [self.before])]
        kept = extreme_rows(stretches_of(self.t, float(self.t[0]), float(self.t[-1]), stretches), series)
        kept = np.union1d(kept, np.flatnonzero(np.isnan(self.measured) & np.isnan(self.residual)))
        return replace(
            self,
            t=self.t[kept],
            measured=self.measured[kept],
            residual=self.residual[kept],
            before=None if self.before is None else self.before[kept],
            parts={effect: part[kept] for effect, part in self.parts.items()},
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON with the arrays as lists."""
        return json_fields(self)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per sample: t, measured, predicted, residual, the residual before, and each effect's part."""
        import pandas as pd  # noqa: PLC0415

        columns = {"t": self.t, "measured": self.measured, "predicted": self.predicted, "residual": self.residual}
        if self.before is not None:
            columns["before"] = self.before
        return pd.DataFrame({**columns, **self.parts})

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw the readings and, beneath, the residual."""
        from imufit.figures.trace import residual_trace  # noqa: PLC0415

        return residual_trace(self, ax)


def stretches_of(t: Array, begin: float, end: float, count: int) -> NDArray[np.intp]:
    """Return the number of the stretch of time that each sample is in.

    Parameters
    ----------
    t : (n,) array
        Times, s.
    begin, end : float
        Time that is cut into stretches, s.
    count : int
        How many there are.
    """
    width = max(end - begin, np.finfo(float).tiny) / count
    return np.clip(((t - begin) / width).astype(np.intp), 0, count - 1)


def extreme_rows(stretch: NDArray[np.intp], series: Sequence[Array]) -> NDArray[np.intp]:
    """Return the rows that hold the smallest and the largest value of any series in any stretch, in order.

    Parameters
    ----------
    stretch : (n,) array
        Number of each row's stretch, ascending.
    series : sequence of (n,) arrays
        Values; NaN is missing.
    """
    firsts = np.flatnonzero(np.diff(stretch, prepend=-1))
    counts = np.diff(np.append(firsts, stretch.size))
    kept = np.zeros(stretch.size, np.bool_)
    for values in series:
        for signed in (values, -values):
            known = np.where(np.isfinite(signed), signed, np.inf)
            least = np.repeat(np.minimum.reduceat(known, firsts), counts)
            hits = np.flatnonzero((known == least) & np.isfinite(known))
            kept[hits[np.unique(stretch[hits], return_index=True)[1]]] = True
    return np.flatnonzero(kept)
