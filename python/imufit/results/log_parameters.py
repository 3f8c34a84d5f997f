"""Parameters that each of several logs has for itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from imufit.results.parameter import Parameter, by_effect
from imufit.results.part import Part
from imufit.results.table import Table


@dataclass(frozen=True, repr=False)
class LogParameters(Part):
    """The own parameters of one of several logs.

    Attributes
    ----------
    file : str
        What the log is called.
    parameters : tuple of Parameter
        Of the effects that each log has for itself (biases, mount).
    ratio : float or None
        Residual of this log over its noise floor, where it was worked out.
    """

    file: str
    parameters: tuple[Parameter, ...]
    ratio: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON of one log: file, ratio, parameters by effect."""
        return {"file": self.file, "ratio": self.ratio, "parameters": by_effect(self.parameters)}


def log_table(logs: Sequence[LogParameters]) -> Table:
    """List what each log has for itself, one column a log.

    Parameters
    ----------
    logs : sequence of LogParameters
        The logs.
    """
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for log in logs:
        for item in log.parameters:
            cells = rows.setdefault((item.effect, item.name), {})
            cells[log.file] = item.shown
    header = ("effect", "parameter", *(log.file for log in logs))
    lines = tuple((*key, *(row.get(log.file, "-") for log in logs)) for key, row in rows.items())
    return Table("Each log's own parameters", header, lines)


def logs_json(logs: Iterable[LogParameters]) -> dict[str, Any]:
    """Key ``logs`` of a result; nothing for a single log.

    Parameters
    ----------
    logs : iterable of LogParameters
        The logs.
    """
    listed = [log.to_dict() for log in logs]
    return {"logs": listed} if listed else {}
