"""Time stamps that are written as dates or times of day."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.check import number_from_text

_FRACTION: Final = re.compile(
    r"^(?P<whole>.*?\d{1,2}:\d\d:\d\d)(?P<fraction>[.,]\d+)?\s*(?P<zone>Z|UTC|[+-]\d\d:?\d\d)?$"
)
_FORMS: Final = (
    "%Y-%m-%dT%H:%M:%S",
    "%Y-%m-%d %H:%M:%S",
    "%Y/%m/%d %H:%M:%S",
    "%d-%b-%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S",
    "%Y-%m-%d_%H:%M:%S",
    "%Y%m%d %H:%M:%S",
)
"""Dates that can be read in one way only: day and month in numbers with slashes cannot."""
_DAY: Final = re.compile(r"(\d{1,2}):(\d\d):(\d\d)")


def seconds_from_text(text: str) -> float:
    """Seconds since 1970 of a date with a time, or since midnight of a time of day; NaN where it is neither.

    Parameters
    ----------
    text : str
        Such as ``2024-05-01T12:00:00.250Z``, ``25-Nov-2026 06:20:11.123`` or ``12:30:01.250``. A time without a zone
        counts as UTC.
    """
    found = _FRACTION.match(text.strip())
    if found is None:
        return float("nan")
    fraction = float("0" + (found["fraction"] or ".0").replace(",", "."))
    if day := _DAY.fullmatch(found["whole"]):
        hours, minutes, seconds = (int(part) for part in day.groups())
        return 3600.0 * hours + 60.0 * minutes + seconds + fraction if minutes < 60 and seconds < 61 else float("nan")
    for form in _FORMS:
        try:
            whole = datetime.strptime(found["whole"], form).replace(tzinfo=UTC)
        except ValueError:
            continue
        return whole.timestamp() + fraction - _zone(found["zone"])
    return float("nan")


def _zone(text: str | None) -> float:
    """Seconds by which a zone is ahead of UTC."""
    if not text or text in ("Z", "UTC"):
        return 0.0
    digits = text[1:].replace(":", "")
    return (-1.0 if text[0] == "-" else 1.0) * (3600.0 * int(digits[:2]) + 60.0 * int(digits[2:]))


def seconds_from_cells(cells: NDArray[Any]) -> NDArray[np.float64]:
    """Numbers, dates and times of day as (n,) float64; NaN for any other text.

    Parameters
    ----------
    cells : (n,) array of objects
        Text, or None where there is none.
    """
    return np.array([_number_or_time(cell) for cell in cells], dtype=np.float64)


def _number_or_time(cell: Any) -> float:
    try:
        return number_from_text(cell)
    except ValueError:
        return seconds_from_text(str(cell))
