"""One log, or several of one sensor, in one question."""

from __future__ import annotations

from collections.abc import Sequence

from imufit.errors import InputError
from imufit.log.log import LogSource

Logs = LogSource | Sequence[LogSource]


def logs_of(logs: Logs) -> tuple[LogSource, ...]:
    """Return one log or several as a tuple.

    Parameters
    ----------
    logs : Log, LogStream or a sequence of them
        Logs of one sensor.

    Raises
    ------
    InputError
        There is none, or one stands there twice: its rows must not count twice.
    """
    if not isinstance(logs, Sequence):
        return (logs,)
    if not logs:
        raise InputError("no log is given", remedy="Pass at least one.")
    for k, log in enumerate(logs):
        if any(log is other for other in logs[:k]):
            raise InputError("the log is given twice", file=log.path, remedy="Pass each log once.")
    return tuple(logs)


def name_of(log: LogSource, number: int) -> str:
    """Return what a log is called: its file's name, else its number counted from 1.

    Parameters
    ----------
    log : LogSource
        The log.
    number : int
        Its place among the logs, counted from 0.
    """
    return f"log {number + 1}" if log.path is None else log.path.name
