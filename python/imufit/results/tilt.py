"""Methods of tilt measurement beside each other: paper B's Tables 3 to 5 as numbers, with the ranks that follow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Final

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class TiltFigures(Part):
    """Figures of merit of one method; None where the log does not determine it.

    Attributes
    ----------
    rmse_deg : float
        Root mean square error, deg.
    offset_deg : float
        Mean error, deg; for an inclination the length of the mean.
    sd_deg : float or None
        Standard deviation about the mean of each rest, deg.
    sd_moving_deg : float or None
        Standard deviation about the mean in motion, deg.
    drift_deg_per_min : float
        Slope of the error at rest, deg/min; where the log never rests the median of its minutes' slopes, without sign.
    noise_density_deg : float or None
        Noise density of the angle at rest, deg/sqrt(Hz), over the comparison's `noise_band_hz`.
    settling_s : float or None
        Time from the end of a move until the error stays in the band, s, median over the moves.
    settling_moves : int
        Moves that counted.
    settling_unfinished : int
        Of these, moves after which the rest was too short: their time is a lower bound.
    vibration_deg : float or None
        Root mean square swing of the angle while the log vibrates, deg.
    vibration_gain : float or None
        The same over the swing of the angle that the specific force alone shows.
    """

    rmse_deg: float
    offset_deg: float
    sd_deg: float | None
    sd_moving_deg: float | None
    drift_deg_per_min: float
    noise_density_deg: float | None
    settling_s: float | None
    settling_moves: int
    settling_unfinished: int
    vibration_deg: float | None
    vibration_gain: float | None

    def to_dict(self) -> dict[str, Any]:
        """JSON of one method."""
        return {item.name: json_value(getattr(self, item.name)) for item in fields(self)}


@dataclass(frozen=True, repr=False)
class Mark(Part):
    """Place of one method in one quantity.

    Attributes
    ----------
    rank : int
        1 is the largest; methods that tie share a rank, and the next one counts them all.
    word : str
        As in paper B's Table 5: ``high`` is the largest, ``second highest`` the second of three or more, ``low`` what
        lies below; for a time ``long``, ``second longest`` and ``short``; ``same`` where all tie.
    """

    rank: int
    word: str


@dataclass(frozen=True, repr=False)
class _Ranked(Part):
    """The ranked quantity, its number, and the difference below which two methods tie at any ratio."""

    title: str
    value: Callable[[TiltFigures], float | None]
    resolution: float
    time: bool = False


TIE: Final = 0.2
"""Two methods tie if they differ by less than this part of the larger."""

RANKED: Final[Mapping[str, _Ranked]] = {
    "noise": _Ranked("noise", lambda f: f.noise_density_deg, 0.0),
    "offset": _Ranked("offset", lambda f: abs(f.offset_deg), 0.02),
    "vibration": _Ranked("vibration", lambda f: f.vibration_gain, 0.02),
    "settling": _Ranked("settling time", lambda f: f.settling_s, 0.25, time=True),
}
"""Paper B's Table 5: noise density, absolute offset (deg), vibration gain, settling time (s)."""


_ROWS: Final = {
    "rmse_deg": ("RMSE", "deg"),
    "offset_deg": ("offset", "deg"),
    "sd_deg": ("SD at rest", "deg"),
    "sd_moving_deg": ("SD moving", "deg"),
    "drift_deg_per_min": ("drift", "deg/min"),
    "noise_density_deg": ("noise density", "deg/√Hz"),
    "settling_s": ("settling time", "s"),
    "vibration_deg": ("vibration, RMS", "deg"),
    "vibration_gain": ("vibration gain", "1"),
}


@dataclass(frozen=True, eq=False, repr=False)
class TiltComparison(Result):
    """Several methods on one log.

    Attributes
    ----------
    kind : str
        ``rig`` (angle about the rig's axis), ``heading`` (rig about the vertical) or ``inclination`` (no rig).
    axis : str or None
        Body axis of the rig.
    methods : dict of TiltFigures or None
        By name; None where the method does not show this angle.
    rests, moves, vibrations : int
        How many the log has.
    rest_s : float
        Time at rest, s.
    band_deg : float
        Band of the settling time, deg.
    noise_band_hz : tuple of float or None
        Band of the noise density, Hz.
    notes : tuple of str
        What is to be known about the figures.
    """

    kind: str
    axis: str | None
    methods: dict[str, TiltFigures | None]
    rests: int
    moves: int
    vibrations: int
    rest_s: float
    band_deg: float
    noise_band_hz: tuple[float, float] | None
    notes: tuple[str, ...] = field(default=())

    def ranks(self, tie: float = TIE) -> dict[str, dict[str, Mark]]:
        """Rank the methods by `RANKED`; quantities that fewer than two methods have are left out.

        Parameters
        ----------
        tie : float
            Methods that differ by less than this part of the larger share a rank, and where they differ by less than
            the quantity's resolution: 0.02 deg of offset, 0.02 of vibration gain, 0.25 s of settling time.
        """
        found = {}
        for name, ranked in RANKED.items():
            values = {
                method: value
                for method, figures in self.methods.items()
                if figures is not None and (value := ranked.value(figures)) is not None
            }
            if len(values) > 1:
                found[name] = _marks(values, tie, ranked)
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return what `replay` adds to its JSON beside the methods' own figures: what was compared, and the ranks."""
        return {
            "tilt": {
                "kind": self.kind,
                "axis": self.axis,
                "rests": self.rests,
                "moves": self.moves,
                "vibrations": self.vibrations,
                "rest_s": self.rest_s,
                "band_deg": self.band_deg,
                "noise_band_hz": json_value(self.noise_band_hz),
                "notes": list(self.notes),
            },
            "ranks": {
                name: {method: {"rank": mark.rank, "word": mark.word} for method, mark in marks.items()}
                for name, marks in self.ranks().items()
            },
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per method, with `TiltFigures` as columns and ``rank_NAME`` for each ranked quantity."""
        import pandas as pd  # noqa: PLC0415

        names = [item.name for item in fields(TiltFigures)]
        frame = pd.DataFrame(
            [
                [None if figures is None else getattr(figures, name) for name in names]
                for figures in self.methods.values()
            ],
            columns=names,
            index=pd.Index(list(self.methods), name="filter"),
        )
        for name, marks in self.ranks().items():
            frame[f"rank_{name}"] = [marks[method].rank if method in marks else None for method in self.methods]
        return frame

    def table(self) -> Table:
        """Figures of merit, one column per method; rows that the log cannot fill are left out."""
        rows = tuple(
            (title, unit, *("-" if each is None else _shown(each, name) for each in self.methods.values()))
            for name, (title, unit) in _ROWS.items()
            if any(each is not None and getattr(each, name) is not None for each in self.methods.values())
        )
        return Table(self._title(), ("", "unit", *(f">{method}" for method in self.methods)), rows)

    def rank_table(self) -> Table:
        """Ranks and words as in paper B's Table 5; empty where there is nothing to rank."""
        ranks = self.ranks()
        rows = tuple(
            (RANKED[name].title, *(f"{marks[m].rank} {marks[m].word}" if m in marks else "-" for m in self.methods))
            for name, marks in ranks.items()
        )
        return Table("Ranks, 1 the largest (ties within 20 %)", ("", *self.methods), rows)

    def tables(self) -> tuple[Table, Table]:
        """Figures and ranks."""
        return self.table(), self.rank_table()

    def _title(self) -> str:
        what = {
            "rig": f"Error of the angle about body {self.axis}",
            "heading": f"Error of the heading (body {self.axis} is vertical)",
            "inclination": "Error of the inclination",
        }[self.kind]
        counts = ", ".join(
            f"{count} {name}{'' if count == 1 else 's'}"
            for count, name in ((self.rests, "rest"), (self.moves, "move"), (self.vibrations, "vibration"))
        )
        return f"{what}: {counts}"

    def sentences(self) -> list[str]:
        """Return the result as text, the answer first."""
        return list(self.notes)


def _shown(figures: TiltFigures, name: str) -> str:
    value = getattr(figures, name)
    if name != "settling_s" or value is None:
        return quantity.number(value)
    text = f"{value:.2f}" if value < 10.0 else f"{value:.1f}"
    return f"> {text}" if 2 * figures.settling_unfinished > figures.settling_moves else text


def _marks(values: Mapping[str, float], tie: float, ranked: _Ranked) -> dict[str, Mark]:
    order = sorted(values, key=lambda method: -values[method])
    groups: list[list[str]] = []
    for method in order:
        top = values[groups[-1][0]] if groups else 0.0
        if groups and top - values[method] <= max(tie * top, ranked.resolution):
            groups[-1].append(method)
        else:
            groups.append([method])
    marks, above = {}, 0
    for place, group in enumerate(groups):
        for method in group:
            marks[method] = Mark(above + 1, _word(place, len(groups), ranked.time))
        above += len(group)
    return {method: marks[method] for method in values}


def _word(place: int, places: int, time: bool) -> str:
    """Word for the place among so many, 0 the largest."""
    if places == 1:
        return "same"
    if place == 0:
        return "long" if time else "high"
    if place == 1 and places > 2:
        return "second longest" if time else "second highest"
    return "short" if time else "low"
