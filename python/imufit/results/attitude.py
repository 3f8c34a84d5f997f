"""How far a filter's attitude is off, with the readings as they are and with a model's effects taken out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.table import Table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from imufit.figures.place import Drawing, Place

PARTS = ("total", "heading", "inclination")


@dataclass(frozen=True, repr=False)
class AttitudeDependence(Part):
    """How one part of the error depends on one quantity.

    Attributes
    ----------
    part : str
        ``heading`` or ``inclination``.
    quantity : str
        ``angular_rate``, ``acceleration``, ``field_disturbance``, ``drift`` or ``constant``.
    share : float
        Part of the mean square error that would be gone if all rows were like those with the least of that quantity
        (a quarter of the log); for ``drift`` and ``constant`` that of a straight line in time and of the mean.
    error : float
        Standard error of the share over blocks of the log.
    """

    part: str
    quantity: str
    share: float
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeBins(Part):
    """RMS error against one quantity.

    Attributes
    ----------
    part : str
        ``heading`` or ``inclination``.
    quantity : str
        What the bins are of.
    unit : str
        Unit of the centres: ``deg/s``, ``m/s²``, ``%`` or ``s``.
    centre : (k,) array
        Mean of the quantity in each bin, ascending.
    before, after : (k,) arrays
        RMS error of each bin, deg; `after` is `before` without a model.
    """

    part: str
    quantity: str
    unit: str
    centre: NDArray[Any]
    before: NDArray[Any]
    after: NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeComparison(Plotted, Part):
    """The benefit of a model to an attitude filter, and the remaining limit of the filter.

    Attributes
    ----------
    filter : str
        The filter's name.
    before : dict
        RMSE of ``total``, ``heading`` and ``inclination``, deg, with the readings as they are.
    after : dict or None
        The same with the model's effects taken out; None for a model without effects.
    dependences : tuple of AttitudeDependence
        Quantities that the remaining error depends on, the largest share first; only those that exceed chance.
    bins : tuple of AttitudeBins
        Error against each quantity.
    limit : str
        ``calibration``, ``environment``, ``filter`` or ``undecided``: what the larger part of the error comes from.
    sentence : str
        The same in words.
    """

    filter: str
    before: dict[str, float]
    after: dict[str, float] | None
    dependences: tuple[AttitudeDependence, ...]
    bins: tuple[AttitudeBins, ...]
    limit: str
    sentence: str

    def to_dict(self) -> dict[str, Any]:
        """JSON: ``before_deg``, ``after_deg``, the same by part, filter, limit, and what the error depends on."""
        value: dict[str, Any] = {"filter": self.filter}
        for part in PARTS:
            prefix = "" if part == "total" else f"{part}_"
            value[f"{prefix}before_deg"] = json_value(self.before[part])
            value[f"{prefix}after_deg"] = None if self.after is None else json_value(self.after[part])
        value["limit"] = self.limit
        value["sentence"] = self.sentence
        value["where"] = [
            {"part": d.part, "quantity": d.quantity, "share": json_value(d.share), "error": json_value(d.error)}
            for d in self.dependences
        ]
        return value

    def table(self) -> Table:
        """Errors by part, before and after, and what the remaining one depends on."""
        rows = []
        for part in PARTS:
            causes = [f"{quantity.share(d.share)} {d.quantity}" for d in self.dependences if d.part == part]
            after = "-" if self.after is None else f"{quantity.number(self.after[part])} deg"
            rows.append((part, f"{quantity.number(self.before[part])} deg", after, ", ".join(causes) or "-"))
        return Table(
            f"Attitude error of {self.filter}, RMSE", ("", ">as it is", ">model applied", "depends on"), tuple(rows)
        )

    def _drawn(self, ax: Place | None) -> Drawing:
        """Error against rate, acceleration, field disturbance and time."""
        from imufit.figures.attitude import attitude_panels  # noqa: PLC0415

        return attitude_panels(self.bins, self.sentence, ax)
