"""The contents of a log, and the effects that it can show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from imufit.figures import quantity
from imufit.log.columns import SENSOR_NAMES
from imufit.log.contents import Contents
from imufit.printable import NAME, printable
from imufit.results.effect_sight import EffectSight, alike, open_table, seen_table, unseen_table, weak_table
from imufit.results.json_value import json_fields, json_value
from imufit.results.part import Part
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

SERIES_NAMES: Final = {
    "rows": "rows",
    **SENSOR_NAMES,
    "temp": "temperature",
    "ref_q": "reference attitude",
    "ref_p": "reference position",
    "ref_angle": "commanded angle",
}
"""Names of the series of a log."""
SHOWN_GAPS: Final = 10
"""Gaps that are printed; the JSON has up to a thousand of each series."""
LABELS: Final = 8
"""Labels of a column of text that are printed: a line has room for them, and a body has six sides."""
AXES: Final = "xyz"
EVEN: Final = 1e-5
"""Part of a step that stamps may be off and count as even: text often cuts times after a few digits."""
NO_NOISE: Final = 1e-6
"""Noise, rad and m, below which a reference was computed, not measured: an interferometer reads micrometres."""


@dataclass(frozen=True, repr=False)
class LogGap(Part):
    """A stretch without samples.

    Attributes
    ----------
    t_start, t_end : float
        Time of the last sample before it and of the first one after it, s.
    """

    t_start: float
    t_end: float

    @property
    def length(self) -> float:
        """Its length, s."""
        return self.t_end - self.t_start

    def to_dict(self) -> dict[str, Any]:
        """JSON of one gap."""
        return {**json_fields(self), "length_s": self.length}


@dataclass(frozen=True, repr=False)
class SeriesInfo(Part):
    """The samples of one sensor, of one part of the reference, or all rows.

    Attributes
    ----------
    name : str
        ``rows``, ``acc``, ``gyr``, ``mag``, ``temp``, ``ref_q``, ``ref_p`` or ``ref_angle``.
    samples : int
        Rows that hold one; of a reference that was filled in between its samples the measured ones.
    t_start, t_end : float
        Time of the first and the last one, s.
    rate : float or None
        By the median step, Hz; None for one sample.
    missing : float
        Share of the samples of an even series between the first and the last one that are not there.
    incomplete : int
        Samples of which an axis is missing.
    jitter : float or None
        Root mean square of the steps about the median one, gaps left out, s.
    gap_count : int
        Steps of more than 3.5 median steps.
    longest_gap : float
        s; 0 without any.
    gaps : tuple of LogGap
        The first 1000 of them.
    """

    name: str
    samples: int
    t_start: float
    t_end: float
    rate: float | None
    missing: float
    incomplete: int
    jitter: float | None
    gap_count: int
    longest_gap: float
    gaps: tuple[LogGap, ...]

    def to_dict(self) -> dict[str, Any]:
        """JSON of one series."""
        return {
            "samples": self.samples,
            "t_start": self.t_start,
            "t_end": self.t_end,
            "rate_hz": json_value(self.rate),
            "missing_share": self.missing,
            "incomplete": self.incomplete,
            "jitter_s": json_value(self.jitter),
            "gap_count": self.gap_count,
            "longest_gap_s": self.longest_gap,
            "gaps": [gap.to_dict() for gap in self.gaps],
        }


@dataclass(frozen=True, repr=False)
class ClippedInfo(Part):
    """Readings of one axis at the end of its range.

    Attributes
    ----------
    channel : str
        For instance ``gyr_x``.
    range : float
        Where the range ends, m/s^2 or rad/s.
    readings : int
        How many stand there.
    """

    channel: str
    range: float
    readings: int

    def to_dict(self) -> dict[str, Any]:
        """JSON of one axis."""
        return json_fields(self)


@dataclass(frozen=True, repr=False)
class MotionInfo(Part):
    """How much a log turns and moves.

    Attributes
    ----------
    rate_low, rate_high, rate_rms : tuple of float or None
        Smallest, largest and root mean square angular rate of each axis, rad/s; None without a gyroscope.
    force_rms : float or None
        Root mean square of the length of the specific force less gravity, m/s^2; None without an accelerometer.
    """

    rate_low: tuple[float | None, ...]
    rate_high: tuple[float | None, ...]
    rate_rms: tuple[float | None, ...]
    force_rms: float | None

    @property
    def sentence(self) -> str:
        """It in words; empty without gyroscope and accelerometer."""
        parts = []
        axes = [
            f"{axis} {_in_degrees(low)} to {_in_degrees(high)}"
            for axis, low, high in zip(AXES, self.rate_low, self.rate_high, strict=True)
            if low is not None and high is not None
        ]
        if axes:
            parts.append(f"Rates in deg/s: {', '.join(axes)}.")
        if self.force_rms is not None:
            parts.append(
                f"The magnitude of the specific force differs from gravity by {self.force_rms:.3g} m/s² (RMS)."
            )
        return " ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """JSON of the motion."""
        return json_fields(self)


def _in_degrees(rate: float) -> str:
    value = np.degrees(rate)
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.1f}" if abs(value) >= 1.0 else f"{value:.2g}"


@dataclass(frozen=True, repr=False)
class RestInfo(Part):
    """Where a log rests.

    Attributes
    ----------
    count : int
        Rests of 0.6 s or more that are fit for a mean.
    longest, total : float
        s.
    directions : int
        Directions of gravity in the body frame among them that are more than 8 degrees apart.
    spans : tuple of (float, float)
        When each begins and ends, s.
    reason : str
        Why nothing is known of rests; empty where it is.
    """

    count: int = 0
    longest: float = 0.0
    total: float = 0.0
    directions: int = 0
    spans: tuple[tuple[float, float], ...] = ()
    reason: str = ""

    @property
    def sentence(self) -> str:
        """It in words."""
        if self.reason:
            return f"Rests: {self.reason}."
        if not self.count:
            return "The log never rests."
        poses = "pose" if self.directions == 1 else "different poses"
        if self.count == 1:
            return f"The log rests once, for {self.longest:.3g} s."
        return (
            f"The log rests {self.count} times in {self.directions} {poses}, {self.total:.3g} s in all, "
            f"at the longest {self.longest:.3g} s."
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON of the rests."""
        return {
            "count": self.count,
            "longest_s": self.longest,
            "total_s": self.total,
            "directions": self.directions,
            "spans": [list(span) for span in self.spans],
            "reason": self.reason or None,
        }


@dataclass(frozen=True, repr=False)
class ReferenceInfo(Part):
    """The references of a log.

    Attributes
    ----------
    kind : str
        ``attitude`` (`ref_q`), ``angle`` (`ref_angle`), ``poses`` (labels) or ``none``.
    frame : str
        Reference frame.
    share : float
        Share of the rows that have it, filled in ones included.
    exact : float or None
        Share of these that were measured, by `ref_exact`; None without that column.
    rate : float or None
        Of its samples, Hz.
    gap_count : int
        Gaps between its samples.
    longest_gap : float
        s.
    position : bool
        Whether the position is there, too.
    attitude_noise : float or None
        Noise of one sample of the attitude, rad, as far as its fast changes show.
    position_noise : float or None
        The same of the position, m.
    labels : tuple of str
        Labels of poses that occur.
    """

    kind: str
    frame: str
    share: float = 0.0
    exact: float | None = None
    rate: float | None = None
    gap_count: int = 0
    longest_gap: float = 0.0
    position: bool = False
    attitude_noise: float | None = None
    position_noise: float | None = None
    labels: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """It in words."""
        labels = f"Labels of poses: {' '.join(self.labels)}." if self.labels else ""
        if self.kind == "none":
            return "Reference: none."
        if self.kind == "poses":
            return f"Reference: none but labels of poses ({' '.join(self.labels)})."
        source = "the commanded angle ref_angle" if self.kind == "angle" else "attitude"
        parts = [f"Reference: {source} in {quantity.share(self.share)} of the rows, frame {self.frame}"]
        if self.rate is not None:
            parts.append(f"{self.rate:.4g} Hz")
        if self.exact is not None:
            parts.append(f"{quantity.share(self.exact)} of these rows measured, the others interpolated")
        gaps = "gap" if self.gap_count == 1 else "gaps"
        parts.append(f"{self.gap_count} {gaps}, the longest {self.longest_gap:.3g} s" if self.gap_count else "no gap")
        parts.append("with position" if self.position else "without position")
        noise = [
            f"{quantity.quantity(value, unit)} of the {name}"
            for name, value, unit in (
                ("attitude", self.attitude_noise, "rad"),
                ("position", self.position_noise, "m"),
            )
            if value is not None and value >= NO_NOISE
        ]
        if noise:
            parts.append(f"noise of one sample about {' and '.join(noise)}")
        return f"{'; '.join(parts)}. {labels}".strip()

    def to_dict(self) -> dict[str, Any]:
        """JSON of the reference."""
        return {
            "kind": self.kind,
            "frame": self.frame,
            "share": self.share,
            "exact_share": json_value(self.exact),
            "rate_hz": json_value(self.rate),
            "gap_count": self.gap_count,
            "longest_gap_s": self.longest_gap,
            "position": self.position,
            "attitude_noise_rad": json_value(self.attitude_noise),
            "position_noise_m": json_value(self.position_noise),
            "labels": list(self.labels),
        }


@dataclass(frozen=True, repr=False)
class LogInfo(Result):
    """The contents of a log, and the effects that it can show.

    Attributes
    ----------
    name : str
        Of the file; ``log`` without one.
    contents : Contents
        Rows, duration, columns with unit and extent, and what reading noticed.
    series : tuple of SeriesInfo
        Rate, gaps and jitter of all rows, of each sensor and of each part of the reference.
    clipped : tuple of ClippedInfo
        Axes with readings at the end of their range.
    motion : MotionInfo
        How much it turns and moves.
    rests : RestInfo
        Where it rests.
    reference : ReferenceInfo
        What its readings can be held against.
    judged_by : str or None
        What effects would be judged by: ``reference`` or ``rests``; None where nothing can be judged, or was asked.
    refusal, remedy : str
        Why nothing can be judged, and what to do about it; empty where something can.
    effects : tuple of EffectSight
        Every effect: whether this log can show it, from which size on, and why not. Empty if it was not asked.
    notes : tuple of str
        What the reader should know about these figures.
    """

    name: str
    contents: Contents
    series: tuple[SeriesInfo, ...]
    clipped: tuple[ClippedInfo, ...]
    motion: MotionInfo
    rests: RestInfo
    reference: ReferenceInfo
    judged_by: str | None
    refusal: str
    remedy: str
    effects: tuple[EffectSight, ...]
    notes: tuple[str, ...]

    def effect(self, effect_id: str) -> EffectSight:
        """Return what the log can show of one effect.

        Parameters
        ----------
        effect_id : str
            Id such as ``gyr.scale``.

        Raises
        ------
        KeyError
            It was not asked about.
        """
        found = next((item for item in self.effects if item.effect == effect_id), None)
        if found is None:
            raise KeyError(effect_id)
        return found

    def one_series(self, name: str) -> SeriesInfo | None:
        """Return one series; None where the log has no sample of it.

        Parameters
        ----------
        name : str
            Such as ``gyr``.
        """
        return next((item for item in self.series if item.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """JSON of `info`."""
        found = self.contents
        return {
            "log": self.name,
            **found.to_dict(),
            "series": {item.name: item.to_dict() for item in self.series},
            "clipped": [item.to_dict() for item in self.clipped],
            "motion": self.motion.to_dict(),
            "rests": self.rests.to_dict(),
            "reference": self.reference.to_dict(),
            "judged_by": self.judged_by,
            "refusal": self.refusal or None,
            "remedy": self.remedy or None,
            "effects": [item.to_dict() for item in self.effects],
            "notes": list(self.notes),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row for each effect."""
        import pandas as pd  # noqa: PLC0415

        columns = ["effect", "shown", "reason", "like"]
        rows = [(item.effect, item.shown, item.reason, " ".join(item.like)) for item in self.effects]
        return pd.DataFrame(rows, columns=columns)

    @property
    def sentence(self) -> str:
        """Rows, duration and sensors in a sentence."""
        n = self.contents.n
        sensors = [SENSOR_NAMES[name] for name in SENSOR_NAMES if self.one_series(name) is not None]
        held = ", ".join(sensors) or "no sensor"
        over = f" over {self.contents.duration:.4g} s" if n > 1 else ""
        return f"{self.name}: {n} row{'' if n == 1 else 's'}{over}; {held}."

    @property
    def verdict(self) -> str:
        """How many effects it can show, in a sentence; empty if it was not asked."""
        if not self.effects:
            return ""
        if self.refusal:
            return f"The log cannot show an effect: {self.refusal}. {self.remedy}".rstrip()
        named = [item for item in self.effects if not item.open]
        shown = sum(item.shown != "no" for item in named)
        by = "Without a reference attitude the log" if self.judged_by == "rests" else "The log"
        return f"{by} can show {shown} of {len(named)} effects at their typical sizes."

    def sentences(self) -> list[str]:
        """Return rows, what it can show, reference, motion, rests, and what is not there."""
        missing = f"Missing: {self.contents.missing_words}." if self.contents.missing else ""
        said = (self.sentence, self.verdict, self.reference.sentence, self.motion.sentence, self.rests.sentence)
        return [text for text in (*said, missing) if text]

    def paragraphs(self) -> list[str]:
        """Return the sentences, which effects the log leaves alike, and the remarks."""
        return [*self.sentences(), *self.alike(), *self.remarks()]

    def series_table(self) -> Table:
        """Rate, gaps and jitter of every series."""
        return Table(
            "Samples in time",
            ("", ">samples", ">rate", ">missing", ">gaps", ">longest", ">jitter"),
            tuple(_series_row(item) for item in self.series),
        )

    def gap_table(self) -> Table:
        """List the longest gaps; one that several series share stands with the first of them."""
        first: dict[tuple[float, float], str] = {}
        for item in self.series:
            for gap in item.gaps:
                first.setdefault((gap.t_start, gap.t_end), item.name)
        listed = [(name, LogGap(*ends)) for ends, name in first.items()]
        longest = sorted(listed, key=lambda entry: -entry[1].length)[:SHOWN_GAPS]
        more = f" (the longest {SHOWN_GAPS} of {len(listed)})" if len(listed) > SHOWN_GAPS else ""
        cells = tuple(
            (SERIES_NAMES[name], f"{gap.t_start:.3f}", f"{gap.t_end:.3f}", f"{gap.length:.3g}") for name, gap in longest
        )
        return Table(f"Gaps{more}", ("", ">from, s", ">to, s", ">length, s"), cells)

    def column_table(self) -> Table:
        """List the columns with unit and extent."""
        rows = tuple(
            (column.name, column.unit, str(column.samples), *map(_cell, (column.low, column.median, column.high)))
            if not column.labels
            else (column.name, _labels(column.labels), str(column.samples), "", "", "")
            for column in self.contents.columns
        )
        return Table("Columns", ("column", "unit", ">samples", ">smallest", ">median", ">largest"), rows)

    def clipped_table(self) -> Table:
        """List axes with readings at the end of their range."""
        units = {"acc": "m/s^2", "gyr": "rad/s"}
        rows = tuple(
            (item.channel, quantity.quantity(item.range, units[item.channel[:3]]), str(item.readings))
            for item in self.clipped
        )
        return Table("Readings at the end of a range", ("channel", ">range", ">readings"), rows)

    def tables(self) -> list[Table]:
        """Return samples, gaps and clipped readings, then what it can and cannot show, then the columns."""
        samples = [self.series_table(), self.gap_table(), self.clipped_table()]
        # Where nothing can be judged, the first sentences say why.
        kinds = () if self.refusal else (seen_table, weak_table, unseen_table, open_table)
        return [*samples, *(kind(self.effects) for kind in kinds), self.column_table()]

    def answer_tables(self) -> list[Table]:
        """Return samples, gaps, clipped readings, what the log cannot show and why, and the columns."""
        kept = [self.series_table(), self.gap_table(), self.clipped_table()]
        return [*kept, *(() if self.refusal else (unseen_table(self.effects),)), self.column_table()]

    def alike(self) -> list[str]:
        """Return which effects the log does not separate, a sentence for each group."""
        return alike(self.effects)

    def remarks(self) -> list[str]:
        """Return what reading noticed, and notes on the figures."""
        said = dict.fromkeys(note.rstrip(".") for note in (*self.contents.notes, *self.notes))
        return [f"Note: {note}." for note in said]


def _series_row(item: SeriesInfo) -> tuple[str, ...]:
    even = item.jitter is not None and item.rate is not None and item.jitter * item.rate < EVEN
    jitter = "-" if item.jitter is None else "0" if even else f"{1e3 * item.jitter:.2g} ms"
    missing = "0" if not item.missing else "< 0.1 %" if item.missing < 1e-3 else quantity.share(item.missing)
    return (
        SERIES_NAMES[item.name],
        str(item.samples),
        "-" if item.rate is None else f"{item.rate:.4g} Hz",
        missing,
        str(item.gap_count),
        f"{item.longest_gap:.3g} s" if item.gap_count else "",
        jitter,
    )


def _labels(labels: tuple[str, ...]) -> str:
    """Name the first labels of a column of text."""
    shown = " ".join(printable(label, NAME) for label in labels[:LABELS])
    return f"{shown} ..." if len(labels) > LABELS else shown


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
