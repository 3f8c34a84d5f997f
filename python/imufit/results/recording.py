"""The result of a recording: how much, what is missing, and how its clock ran."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from imufit.figures import quantity
from imufit.results.json_value import json_fields, json_value
from imufit.results.part import Part
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class RecordingGap(Part):
    """A stretch of a recording in which rows are missing.

    Attributes
    ----------
    t_start, t_end : float
        Time of the last row before it and of the first one after it, s; of the end of the recording if the line was
        still away then.
    reason : str
        ``unplugged`` (the line was lost and opened anew), ``reset`` (the device started anew) or ``lost frames``.
    frames : int
        Frames (in text form: damaged lines) known to be missing; samples sent before the port was open are not known.
    """

    t_start: float
    t_end: float
    reason: str
    frames: int

    def to_dict(self) -> dict[str, Any]:
        """JSON of one gap."""
        return json_fields(self)


@dataclass(frozen=True, repr=False)
class RecordingClock(Part):
    """The source of a recording's time.

    Attributes
    ----------
    source : str
        ``device``: by its clock, put on the host's; ``arrival``: it sends no time, rows are timed on arrival.
    offset_s : float or None
        `t` of the log when the device's clock stood at 0: ``t = offset_s + seconds / (1 + drift_ppm / 1e6)``; of the
        first run if the device started anew.
    drift_ppm : float or None
        How much faster the device's clock runs than the host's, parts per million; None where that was not fitted.
    jitter_s : float or None
        Standard deviation of the delay of rows on their way beyond the shortest, s. It is not in `t`.
    latest_s : float or None
        Largest such delay, s.
    runs : int
        Runs of the device's clock: one more for each time that it started anew.
    """

    source: str
    offset_s: float | None = None
    drift_ppm: float | None = None
    jitter_s: float | None = None
    latest_s: float | None = None
    runs: int = 1

    def to_dict(self) -> dict[str, Any]:
        """JSON of the clock."""
        return json_fields(self)


@dataclass(frozen=True, repr=False)
class Recording(Result):
    """A recording, written as a log.

    Attributes
    ----------
    file : str
        The log.
    port : str
        Where it came from.
    form : str
        ``binary`` or ``text``.
    device : str
        Name of the device; empty in text form.
    began : str
        Time of the first row, UTC, ISO 8601.
    n : int
        Rows.
    duration_s : float
        From the first to the last row, s.
    rate_hz : float or None
        Rows per second by the median time step; None for a single row.
    columns : tuple of str
        Columns besides `t`.
    lost, damaged, unknown, unexplained : int
        Frames missing between others; pieces that are not frames or lines that are not rows; frames of an unknown kind;
        samples without an announcement, or rows without a header.
    gaps : tuple of RecordingGap
        Where rows are missing.
    clock : RecordingClock
        The source of the time.
    ended : str
        Why it ended: ``stopped``, ``duration``, ``line lost``, ``disk full``, ``other columns`` or ``crash``.
    cpu_share : float or None
        Time of the processor over time that passed, of this process while it recorded; None after a crash.
    notes : tuple of str
        What the reader should know.
    """

    file: str
    port: str
    form: str
    device: str
    began: str
    n: int
    duration_s: float
    rate_hz: float | None
    columns: tuple[str, ...]
    lost: int
    damaged: int
    unknown: int
    unexplained: int
    gaps: tuple[RecordingGap, ...]
    clock: RecordingClock
    ended: str
    cpu_share: float | None = None
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """JSON of `record` and `recover`."""
        names = [name for name in self.__dataclass_fields__ if name not in ("gaps", "clock")]
        plain = {name: json_value(getattr(self, name)) for name in names}
        return {**plain, "gaps": [gap.to_dict() for gap in self.gaps], "clock": self.clock.to_dict()}

    def to_dataframe(self) -> pd.DataFrame:
        """One row per gap."""
        import pandas as pd  # noqa: PLC0415

        names = ["t_start", "t_end", "reason", "frames"]
        return pd.DataFrame([[getattr(gap, name) for name in names] for gap in self.gaps], columns=names)

    @property
    def sentence(self) -> str:
        """The result in one or two sentences."""
        rate = "" if self.rate_hz is None else f" over {self.duration_s:.4g} s, {self.rate_hz:.4g} Hz"
        missing = [
            f"{count} {what}"
            for count, what in (
                (self.lost, "frames lost"),
                (self.damaged, "lines damaged" if self.form == "text" else "frames damaged"),
                (self.unknown, "frames unknown"),
                (self.unexplained, "rows unexplained"),
            )
            if count
        ]
        gaps = f"{len(self.gaps)} gap{'' if len(self.gaps) == 1 else 's'}" if self.gaps else "no gap"
        return f"{self.n} rows{rate}: {', '.join([*missing, gaps])}."

    @property
    def clock_sentence(self) -> str:
        """The source of the time, in a sentence."""
        if self.clock.source == "arrival":
            return "The device sends no time: rows are timed as they arrived."
        if self.clock.drift_ppm is None:
            return "Time is that of the device's clock."
        late = quantity.quantity(self.clock.jitter_s, "s")
        speed = "fast" if self.clock.drift_ppm >= 0.0 else "slow"
        return f"The device's clock is {abs(self.clock.drift_ppm):.0f} ppm {speed}; arrivals scattered by {late}."

    def gap_table(self, limit: int = 20) -> Table:
        """Gaps, the first ones.

        Parameters
        ----------
        limit : int
            Rows at most.
        """
        rows = tuple(
            (f"{gap.t_start:.3f}", f"{gap.t_end:.3f}", gap.reason, f"{gap.frames}") for gap in self.gaps[:limit]
        )
        more = f" (the first {limit} of {len(self.gaps)})" if len(self.gaps) > limit else ""
        return Table(f"Gaps{more}", (">from, s", ">to, s", "reason", ">frames missing"), rows)

    def sentences(self) -> list[str]:
        """Return the result, the clock, and the notes."""
        return [self.sentence, self.clock_sentence, *(f"Note: {note}." for note in self.notes)]

    def tables(self) -> list[Table]:
        """Gaps of the recording."""
        return [self.gap_table()]
