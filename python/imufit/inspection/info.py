"""The contents of a log: samples, columns, motion, rests, reference, and which effects it can show."""

from __future__ import annotations

import numpy as np

from imufit.inspection.motion import MotionSeen, RangesSeen, clipped
from imufit.inspection.rests import rests_of
from imufit.inspection.series import series_seen, usual_steps
from imufit.inspection.shown import Shown, shown
from imufit.log import LogSource, contents, judged_rows
from imufit.log.contents import Contents
from imufit.log.size import BLOCK_ROWS
from imufit.progress import Progress, silent
from imufit.results.log_info import LogInfo, ReferenceInfo, SeriesInfo


def info(log: LogSource, *, effects: bool = True, progress: Progress | None = None) -> LogInfo:
    """List the contents of a log, and the effects that it can show.

    The log is read chunk by chunk, a few times. Of one that is too long to be judged row by row, effects and rests are
    found in evenly spread stretches.

    Parameters
    ----------
    log : Log or LogStream
        Any log, with or without a reference.
    effects : bool
        Whether to ask of every effect of the catalogue if the log can show it; that takes most of the time.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Returns
    -------
    LogInfo
        It prints as sentences and tables.
    """
    progress = progress or silent
    held = contents(log)
    usual = usual_steps(log)
    series, motion, ranges = series_seen(usual), MotionSeen(log.metadata.gravity), RangesSeen()
    referenced = filled = exact = 0
    for chunk in log.chunks(BLOCK_ROWS):
        rows = chunk.core
        for each in series.values():
            each.add(rows)
        motion.add(rows)
        ranges.add(rows)
        there = rows.has_reference
        referenced += int(there.sum())
        if "ref_exact" in rows.covariates:
            filled += int(there.sum())
            exact += int(np.count_nonzero(there & (rows.covariates["ref_exact"] == 1.0)))
        progress(chunk.start + rows.n, log.n, "reading")
    found = [item for item in (each.found() for each in series.values()) if item is not None]
    moves = motion.found()
    rests = rests_of(log)
    told = shown(log, held, moves, progress) if effects else Shown((), None)
    return LogInfo(
        name="log" if log.path is None else log.path.name,
        contents=held,
        series=tuple(found),
        clipped=clipped(log, ranges.ends(log)),
        motion=moves,
        rests=rests,
        reference=_reference(log, held, {item.name: item for item in found}, (referenced, filled, exact), told),
        judged_by=told.judged_by,
        refusal=told.refusal,
        remedy=told.remedy,
        effects=told.effects,
        notes=_notes(log, told),
    )


def _reference(
    log: LogSource, held: Contents, series: dict[str, SeriesInfo], counts: tuple[int, int, int], told: Shown
) -> ReferenceInfo:
    """Describe the log's references; `counts` are rows with a reference, and among them stated and measured rows."""
    referenced, filled, exact = counts
    labels = next((column.labels for column in held.columns if column.name == "pose"), ())
    frame = log.metadata.frame
    if not referenced:
        return ReferenceInfo("poses" if labels else "none", frame, labels=labels)
    commanded = told.surveyed is not None and told.surveyed.passes.commanded is not None
    samples = series.get("ref_angle" if commanded else "ref_q")
    noise: tuple[float | None, float | None] = (None, None)
    if told.surveyed is not None and told.judged_by == "reference":
        attitude, place = told.surveyed.facts.reference_noise
        noise = (attitude if attitude > 0.0 else None, place if place > 0.0 and "ref_p" in series else None)
    return ReferenceInfo(
        kind="angle" if commanded else "attitude",
        frame=frame,
        share=referenced / log.n,
        exact=exact / filled if filled else None,
        rate=None if samples is None else samples.rate,
        gap_count=0 if samples is None else samples.gap_count,
        longest_gap=0.0 if samples is None else samples.longest_gap,
        position="ref_p" in series,
        attitude_noise=noise[0],
        position_noise=noise[1],
        labels=labels,
    )


def _notes(log: LogSource, told: Shown) -> tuple[str, ...]:
    """Return the rows for rests and effects, and the notes of the first pass of a fit."""
    empty = [] if told.surveyed is None else told.surveyed.passes.empty
    return tuple(note for note in (*judged_rows(log).notes, *empty) if note not in log.notes)
