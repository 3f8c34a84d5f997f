"""Whether a sensor was judged, and if not, why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from imufit.results.part import Part


@dataclass(frozen=True, repr=False)
class Judged(Part):
    """One sensor of the logs.

    Attributes
    ----------
    sensor : str
        ``acc``, ``gyr`` or ``mag``.
    judged : bool
        True where its readings were compared with a reference.
    reason : str or None
        Why they were not.
    advice : str
        Rests that the recording lacks for a judgement; empty where it lacks none.
    """

    sensor: str
    judged: bool
    reason: str | None
    advice: str = ""

    def to_dict(self) -> dict[str, Any]:
        """JSON of one sensor; the advice where there is some."""
        advice = {"advice": self.advice} if self.advice else {}
        return {"judged": self.judged, "reason": self.reason, **advice}


def left_out(sensors: Sequence[Judged]) -> str:
    """Name the sensors that were not judged with the reasons; empty where all were.

    Parameters
    ----------
    sensors : sequence of Judged
        Every sensor of the logs.
    """
    reasons: dict[str, list[str]] = {}
    for item in sensors:
        if not item.judged:
            reasons.setdefault(item.reason or "", []).append(item.sensor)
    return "; ".join(f"{', '.join(names)}: not judged, because {reason}" for reason, names in reasons.items())
