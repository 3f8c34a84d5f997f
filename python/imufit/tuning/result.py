"""The result of a tuning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.figures import quantity
from imufit.results import Table
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Gain(Part):
    """One tuned gain, and how much it matters: values with it alone changed by a factor.

    Parameters
    ----------
    name : str
        Setting of the filter.
    unit : str
        Its unit, `1` for a number.
    default : float
        Value at which the search began: the filter's default.
    tuned : float
        Value found.
    edge : {"lower", "upper"} or None
        End of the search at which it lies: the log does not bound it there.
    flat : (2,) tuple or None
        Factors on the tuned value between which the value stays within 5 % of the least.
    wins : (2,) tuple or None
        Factors between which the filter is better than the rival; None where it is not even with the tuned gains, or
        where a rival is missing. 0 and infinity: no limit within a factor of 10 000.
    factors : (k,) array
        Factors that were tried.
    values : (k,) array
        Values, deg.
    """

    name: str
    unit: str
    default: float
    tuned: float
    edge: str | None
    flat: tuple[float, float] | None
    wins: tuple[float, float] | None
    factors: Array
    values: Array

    def to_dict(self) -> dict[str, Any]:
        """JSON of one gain; no limit is null."""
        return {
            "default": self.default,
            "tuned": self.tuned,
            "unit": self.unit,
            "edge": self.edge,
            "flat": json_value(self.flat),
            "wins": json_value(self.wins),
        }


@dataclass(frozen=True, eq=False, repr=False)
class GainMap(Part):
    """The value over two gains, the others at their tuned values.

    Parameters
    ----------
    names : pair of str
        The gains.
    x, y : (k,) array
        Their values.
    values : (k, k) array
        deg; row i belongs to ``y[i]``, column j to ``x[j]``.
    """

    names: tuple[str, str]
    x: Array
    y: Array
    values: Array

    def to_dict(self) -> dict[str, Any]:
        """JSON of the map."""
        return {
            "names": list(self.names),
            "x": json_value(self.x),
            "y": json_value(self.y),
            "values_deg": json_value(self.values),
        }

    def table(self, every: int = 4) -> Table:
        """Table of each `every`-th row and column.

        Parameters
        ----------
        every : int
            Step through rows and columns.
        """
        header = (f"{self.names[1]} \\ {self.names[0]}", *(f">{quantity.number(x, 2)}" for x in self.x[::every]))
        rows = tuple(
            (quantity.number(y, 2), *(quantity.number(value) for value in row[::every]))
            for y, row in zip(self.y[::every], self.values[::every], strict=True)
        )
        return Table("Value over two gains, deg", header, rows)


@dataclass(frozen=True, repr=False)
class Innovation(Part):
    """Reading less prediction at each row: the angle between measured and foreseen vertical.

    Parameters
    ----------
    rms_deg : float
        Root mean square, deg.
    correlation : float
        Of neighbouring innovations: 0 is white; positive, the filter lags; negative, it follows the noise.
    """

    rms_deg: float
    correlation: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of it."""
        return {"rms_deg": self.rms_deg, "correlation": self.correlation}


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Plotted, Result):
    """Gains of one filter tuned on one log.

    Parameters
    ----------
    filter_name : str
        The filter.
    criterion : {"error", "prediction"}
        What was minimised.
    metric : {"total", "heading", "inclination"}
        Of which angle.
    rows : int
        Rows that counted.
    horizon : float or None
        Time that a prediction ran, s.
    gains : tuple of Gain
        What was tuned.
    fixed : dict of float
        Settings of the filter that were held at other values than their defaults.
    value : dict of float
        The criterion, deg: "default", "tuned", and "held_out": tuned on one half of the log, judged on the other.
    error : dict of float or None
        Likewise the root mean square error against the reference, deg.
    rival : (str, float) or None
        The filter without gains to beat, and its error, deg.
    innovation : dict of Innovation or None
        With "default" and "tuned" gains.
    map : GainMap or None
        The value over two gains.
    notes : tuple of str
        What was noticed.
    """

    filter_name: str
    criterion: str
    metric: str
    rows: int
    horizon: float | None
    gains: tuple[Gain, ...]
    fixed: dict[str, float]
    value: dict[str, float]
    error: dict[str, float] | None
    rival: tuple[str, float] | None
    innovation: dict[str, Innovation] | None
    map: GainMap | None
    notes: tuple[str, ...] = ()

    @property
    def settings(self) -> dict[str, dict[str, float]]:
        """The tuned settings, for `imufit.replaying.replay` and `imufit.replaying.write_settings`."""
        return {self.filter_name: {**self.fixed, **{gain.name: gain.tuned for gain in self.gains}}}

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        what = "error" if self.criterion == "error" else f"error of {self.horizon:g} s predictions"
        default, held = self.value["default"], self.value["held_out"]
        return (
            f"{self.filter_name}: {self.metric} {what} {quantity.number(default)} deg with the defaults, "
            f"{quantity.number(held)} deg held out with tuned gains."
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes, and a note on the gains' tolerance."""
        remarks = list(self.notes)
        for gain in self.gains:
            if gain.edge is not None:
                remarks.append(
                    f"{gain.name} lies at the {gain.edge} end of the search: this log does not bound it there."
                )
            elif gain.flat is not None and (gain.flat[0] == 0.0 or np.isinf(gain.flat[1])):
                side = "smaller" if gain.flat[0] == 0.0 else "larger"
                remarks.append(f"{gain.name} is flat: any {side} value is within 5 % of the best.")
        if self.value["held_out"] > 1.02 * self.value["default"]:
            remarks.append("Held out, the tuned gains are not better than the defaults: keep the defaults.")
        if self.rival is not None:
            remarks.append(self._against_rival(*self.rival))
        if self.innovation is not None:
            tuned = self.innovation["tuned"]
            remarks.append(
                f"Innovations with tuned gains: {quantity.number(tuned.rms_deg)} deg, correlation of neighbours "
                f"{tuned.correlation:.2f} (0 is white)."
            )
        return tuple(remarks)

    def _against_rival(self, name: str, error: float) -> str:
        if all(gain.wins is None for gain in self.gains):
            return f"{name} alone does better: {quantity.number(error)} deg."
        limits = []
        for gain in self.gains:
            if gain.wins is None or (gain.wins[0] == 0.0 and np.isinf(gain.wins[1])):
                continue
            low, high = gain.wins
            sides = [
                f"{quantity.number(1.0 / low, 2)} times too small" if low > 0.0 else "",
                f"{quantity.number(high, 2)} times too large" if np.isfinite(high) else "",
            ]
            limits.append(f"{gain.name} " + " or ".join(side for side in sides if side))
        if not limits:
            return (
                f"The filter beats {name} ({quantity.number(error)} deg) whichever gain is wrong by up to 10 000 times."
            )
        return f"The filter loses to {name} ({quantity.number(error)} deg) only with {'; '.join(limits)}."

    def tables(self) -> list[Table]:
        """Gains, values, and the map as tables."""
        rows = tuple(
            (
                gain.name,
                gain.unit,
                quantity.number(gain.default),
                quantity.number(gain.tuned),
                _factors(gain.flat),
                _factors(gain.wins),
            )
            for gain in self.gains
        )
        header = ("gain", "unit", ">default", ">tuned", ">within 5 %, times", ">wins, times")
        worth = [("prediction" if self.criterion == "prediction" else "error", self.value)]
        if self.criterion == "prediction" and self.error is not None:
            worth.append(("error", self.error))
        values = tuple(
            (name, *(quantity.number(each[key]) for key in ("default", "tuned", "held_out"))) for name, each in worth
        )
        tables = [
            Table("Gains", header, rows),
            Table(f"{self.metric.capitalize()}, deg", ("", ">default", ">tuned", ">held out"), values),
        ]
        return tables if self.map is None else [*tables, self.map.table()]

    def to_dict(self) -> dict[str, Any]:
        """Return what goes into JSON."""
        return {
            "filter": self.filter_name,
            "criterion": self.criterion,
            "metric": self.metric,
            "n": self.rows,
            "horizon_s": self.horizon,
            "gains": {gain.name: gain.to_dict() for gain in self.gains},
            "fixed": self.fixed,
            "value_deg": json_value(self.value),
            "error_deg": json_value(self.error),
            "rival": None if self.rival is None else {"filter": self.rival[0], "error_deg": self.rival[1]},
            "innovation": None
            if self.innovation is None
            else {name: each.to_dict() for name, each in self.innovation.items()},
            "map": None if self.map is None else self.map.to_dict(),
            "notes": list(self.remarks),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """Table of what changing one gain does: gain, value of the gain, factor, value in deg."""
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        frames = [
            pd.DataFrame(
                {
                    "gain": gain.name,
                    "setting": gain.tuned * gain.factors,
                    "factor": gain.factors,
                    "value_deg": gain.values,
                }
            )
            for gain in self.gains
        ]
        return pd.concat(frames, ignore_index=True)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Map over two gains, and the value over each gain alone with the rival's error."""
        from imufit.figures.gains import gain_figure  # noqa: PLC0415

        return gain_figure(self.map, self.gains, self.rival, f"{self.metric} {self.criterion}, deg", ax)

    def sentences(self) -> list[str]:
        """Return the result as text, the answer first."""
        return [self.sentence, *self.remarks]


def _factors(limits: tuple[float, float] | None) -> str:
    """Two factors as text; a dash where there are none."""
    if limits is None:
        return "-"
    low, high = limits
    return f"{quantity.number(low, 2)} to {quantity.number(high, 2) if np.isfinite(high) else 'any'}"
