"""Filters over many logs at once."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from imufit.errors import InputError
from imufit.log import Log
from imufit.progress import Progress, silent
from imufit.replaying.replay import DEFAULT_FILTERS, Replay, Settings, replay


def replay_many(
    logs: Sequence[Log],
    filters: Sequence[str] | None = DEFAULT_FILTERS,
    settings: Settings | None = None,
    initial: ArrayLike | Rotation | str | None = None,
    threads: int | None = None,
    progress: Progress = silent,
) -> list[Replay]:
    """Replay several logs in parallel; each result is the one that `imufit.replaying.replay` gives, bit by bit.

    The filters run outside the interpreter's lock, so that threads are enough and no log is copied.

    Parameters
    ----------
    logs : sequence of Log
        The logs.
    filters, settings, initial
        As in `imufit.replaying.replay`, the same for every log.
    threads : int, optional
        How many logs at once; without it as many as there are processors for this process.
    progress : callable, optional
        Called with (logs done, logs in all, what was done), in the order in which they end.

    Returns
    -------
    list of Replay
        One for each log, in the order of the logs.

    Raises
    ------
    InputError
        A log that cannot be replayed; the message states which. Logs that have not begun are left out.
    """
    if threads is not None and threads < 1:
        raise InputError(f"threads is {threads}", remedy="Pass 1 or more, or leave it out.")
    workers = threads or _processors()
    with ThreadPoolExecutor(max_workers=workers, thread_name_prefix="replay") as pool:
        running = {pool.submit(replay, log, filters, settings, initial): k for k, log in enumerate(logs)}
        try:
            for done, future in enumerate(as_completed(running), start=1):
                future.result()
                progress(done, len(logs), f"log {running[future]} replayed")
        except ValueError as error:
            k = running[future]
            raise InputError(f"log {k}: {error}", file=logs[k].path) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return [future.result() for future in running]


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
