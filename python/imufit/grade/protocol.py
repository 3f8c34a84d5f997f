"""Many blind logs, several at a time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from imufit.grade.blind_grade import BlindGrade
from imufit.grade.sets import SETS
from imufit.grade.trial import Trial, trial
from imufit.progress import Progress, silent


def plan(sets: Sequence[str], logs: int, seed: int) -> list[tuple[str, int]]:
    """Return set and seed of each blind log: of every set the seeds from `seed` on.

    Parameters
    ----------
    sets : sequence of str
        Names of `SETS`.
    logs : int
        How many of each.
    seed : int
        The first; so that log number k of a set is the first one of seed + k.
    """
    return [(name, seed + k) for name in sets for k in range(logs)]


def grade(
    sets: Sequence[str] = (),
    *,
    logs: int = 20,
    seed: int = 0,
    processes: int | None = None,
    progress: Progress | None = None,
) -> BlindGrade:
    """Diagnose many simulated logs without knowing what was done to them, and mark the answers.

    Parameters
    ----------
    sets : sequence of str
        Names of `SETS`; none = all of them.
    logs : int
        Number of logs of each set.
    seed : int
        First seed of each set; the same seed gives the same logs.
    processes : int, optional
        Logs worked on at a time; default: one per processor.
    progress : callable, optional
        Called with (logs done, logs in all, what is being done).

    Returns
    -------
    BlindGrade
        The marks, and how well the parameters were recovered.

    Raises
    ------
    ValueError
        A set is unknown.
    """
    if unknown := [name for name in sets if name not in SETS]:
        raise ValueError(f"unknown set {unknown[0]!r}: use one of {', '.join(SETS)}")
    tell = progress or silent
    jobs = plan(list(sets) or list(SETS), logs, seed)
    if processes == 1:
        trials = []
        for done, job in enumerate(jobs):
            tell(done, len(jobs), "diagnosing blind logs")
            trials.append(trial(*job))
        tell(len(jobs), len(jobs), "diagnosing blind logs")
        return BlindGrade(tuple(trials))
    return BlindGrade(tuple(_side_by_side(jobs, processes, tell)))


def _side_by_side(jobs: Sequence[tuple[str, int]], processes: int | None, tell: Progress) -> list[Trial]:
    # A fresh interpreter for each worker: the compiled core's threads do not survive a fork.
    workers = min(processes or os.cpu_count() or 1, max(len(jobs), 1))
    threads = max(1, (os.cpu_count() or 1) // workers)
    trials: list[Trial] = []
    with ProcessPoolExecutor(workers, get_context("spawn"), _share_processors, (threads,)) as pool:
        futures = [pool.submit(trial, *job) for job in jobs]
        for future in futures:
            trials.append(future.result())
            tell(len(trials), len(jobs), "diagnosing blind logs")
    return trials


def _share_processors(threads: int) -> None:
    """Let the compiled core of this worker use its share of the processors, unless the user says otherwise."""
    os.environ.setdefault("RAYON_NUM_THREADS", str(threads))
