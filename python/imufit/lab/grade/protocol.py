"""Many blind logs, several at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

from imufit.lab.grade.blind_grade import BlindGrade
from imufit.lab.grade.sets import SETS
from imufit.lab.grade.trial import trial
from imufit.progress import Progress, silent

Result = TypeVar("Result")


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
    jobs = plan(list(sets) or list(SETS), logs, seed)
    return BlindGrade(tuple(side_by_side(trial, jobs, processes, progress)))


def side_by_side(
    work: Callable[..., Result], jobs: Sequence[tuple[Any, ...]], processes: int | None, progress: Progress | None
) -> list[Result]:
    """Return what `work` makes of each job, in order; several at a time.

    Parameters
    ----------
    work : callable
        At the top of a module.
    jobs : sequence of tuple
        Its arguments.
    processes : int, optional
        Jobs at a time; default: one per processor. With 1 they are done in this process.
    progress : callable, optional
        Called with (jobs done, jobs in all, what is being done).
    """
    tell = progress or silent
    done: list[Result] = []
    workers = min(processes or os.cpu_count() or 1, max(len(jobs), 1))
    if workers == 1:
        for job in jobs:
            done.append(work(*job))
            tell(len(done), len(jobs), "diagnosing blind logs")
        return done
    # A fresh interpreter for each worker: the compiled core's threads are lost in a fork.
    threads = max(1, (os.cpu_count() or 1) // workers)
    with ProcessPoolExecutor(workers, get_context("spawn"), _share_processors, (threads,)) as pool:
        for future in [pool.submit(work, *job) for job in jobs]:
            done.append(future.result())
            tell(len(done), len(jobs), "diagnosing blind logs")
    return done


def _share_processors(threads: int) -> None:
    """Let the compiled core of this worker use its share of the processors, unless the user sets another."""
    os.environ.setdefault("RAYON_NUM_THREADS", str(threads))
