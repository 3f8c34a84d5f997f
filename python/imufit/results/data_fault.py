"""Faults of the data themselves: not the sensor is wrong, but what was written down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from imufit.figures import quantity
from imufit.remedy import Remedy
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.table import Table


@dataclass(frozen=True, repr=False)
class DataFault(Part):
    """A fault of the data, which is not an effect of the sensor.

    Attributes
    ----------
    fault : str
        Which kind, for instance ``units`` or ``stuck``.
    sensor : str or None
        ``acc``, ``gyr``, ``mag`` or ``ref``; None where every sensor is concerned.
    channel : str or None
        For instance ``gyr_x``, where it is a single one.
    t_start, t_end : float
        Where in time, s.
    rows : int
        Rows concerned.
    evidence : str
        What shows it, in a sentence with figures.
    advice : str or Remedy
        The remedy in a sentence; a `Remedy` has the words of Python and those of the command line.
    left_out : bool
        True if the samples concerned were left out of the evidence; the answer on the log rests on the others.
    false_readings : bool
        True if the sensor read falsely in these rows, and the answer on the others is not the whole truth about it.
    spoils : bool
        True if effects cannot be judged before it is corrected.
    spoils_sensors : tuple of str
        Sensors whose effects cannot be judged before it is corrected.
    gain : float
        Drop of the sum of squares, in units of the noise, that it explains beside every effect; NaN where not asked.
    file : str or None
        Of several logs: what the log is called that it is in.
    """

    fault: str
    sensor: str | None
    channel: str | None
    t_start: float
    t_end: float
    rows: int
    evidence: str
    advice: str | Remedy
    left_out: bool = False
    false_readings: bool = False
    spoils: bool = False
    spoils_sensors: tuple[str, ...] = ()
    gain: float = math.nan
    file: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON of one fault, its remedy in the shell's words; the key ``file`` only where there are several logs."""
        names = [name for name in self.__dataclass_fields__ if name != "file" or self.file is not None]
        values = {name: getattr(self, name) for name in names} | {"advice": self.shell_remedy}
        return {"remedy" if name == "advice" else name: json_value(value) for name, value in values.items()}

    @property
    def remedy(self) -> str:
        """The remedy in Python; in the words of the command line where that is running."""
        return str(self.advice)

    @property
    def shell_remedy(self) -> str:
        """The remedy in the words of the command line."""
        return Remedy.of(self.advice).shell

    @property
    def sentence(self) -> str:
        """Evidence, what was done about it, and the remedy."""
        done = " Those samples are left out here." if self.left_out else ""
        return f"{'' if self.file is None else f'{self.file}: '}{self.evidence}{done} {self.remedy}"

    def __str__(self) -> str:
        return f"Data fault ({self.fault}): {self.sentence}"


def fault_table(faults: Sequence[DataFault]) -> Table:
    """Faults with where they lie."""
    several = any(item.file is not None for item in faults)
    rows = tuple(
        (
            *([item.file or "-"] if several else []),
            item.fault,
            item.channel or item.sensor or "all",
            quantity.span(item.t_start, item.t_end),
            f"{item.rows}",
            "left out" if item.left_out else "spoils the log" if item.spoils else "kept",
        )
        for item in faults
    )
    log = ("log",) if several else ()
    return Table("Faults of the data", (*log, "fault", "where", ">time", ">rows", "samples"), rows)
