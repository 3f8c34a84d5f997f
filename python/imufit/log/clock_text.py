"""Time stamps that are written as dates or times of day."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.check import number_from_text

MONTH_FIRST: Final = "mm/dd/yyyy"
DAY_FIRST: Final = "dd/mm/yyyy"
ORDERS: Final = (MONTH_FIRST, DAY_FIRST)
"""Orders of the numbers of a date with slashes, as in a mapping: a single cell does not determine the order."""
_STAMP: Final = re.compile(
    r"(?:(?P<date>[^\s:,]*?[^\s:,T])(?:T|[\s_]+|,\s*))?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d)(?:[.,:](?P<fraction>\d+))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|[+-]\d\d:?\d\d)?"
)
_FORMS: Final = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d-%b-%Y", "%d.%m.%Y", "%Y%m%d")
"""Dates that can be read in one way only."""
_EITHER: Final = re.compile(r"(\d{1,2})[/-](\d{1,2})[/-](\d{4})")
_MONTHS: Final = 12
_HOURS: Final = 12


def seconds_from_text(text: str, order: str = "") -> float:
    """Seconds since 1970 of a date with a time, or since midnight of a time of day; NaN where it is neither.

    Parameters
    ----------
    text : str
        Such as ``2024-05-01T12:00:00.250Z``, ``25-Nov-2026 06:20:11.123``, ``5/1/2024 8:00:00.5 PM`` or
        ``12:30:01.250``. A time without a zone counts as UTC.
    order : str
        One of `ORDERS`, for dates such as ``5/1/2024``; without one they are not dates.
    """
    found = _STAMP.fullmatch(text.strip())
    if found is None:
        return float("nan")
    hours, minutes, seconds = int(found["hour"]), int(found["minute"]), int(found["second"])
    if found["half"]:
        if not 1 <= hours <= _HOURS:
            return float("nan")
        hours = hours % _HOURS + (_HOURS if found["half"][0] in "pP" else 0)
    if minutes >= 60 or seconds > 60:
        return float("nan")
    day = 0.0 if found["date"] is None else _day(found["date"], order)
    clock = 3600.0 * hours + 60.0 * minutes + seconds + float(f"0.{found['fraction'] or 0}")
    return day + clock - _zone(found["zone"])


@lru_cache(maxsize=256)
def _day(text: str, order: str) -> float:
    """Seconds since 1970 at the begin of a date; NaN where it is none."""
    if found := _EITHER.fullmatch(text):
        if order not in ORDERS:
            return float("nan")
        month, day = (found[1], found[2]) if order == MONTH_FIRST else (found[2], found[1])
        text = f"{found[3]}-{month}-{day}"
    for form in _FORMS:
        try:
            return datetime.strptime(text, form).replace(tzinfo=UTC).timestamp()
        except ValueError:
            continue
    return float("nan")


def is_date(text: str) -> bool:
    """Whether a text is a date without a time, in whatever order."""
    return any(np.isfinite(_day(text.strip(), order)) for order in ORDERS)


def order_of(texts: Iterable[str]) -> str | None:
    """Order of the numbers in dates with slashes.

    Parameters
    ----------
    texts : iterable of str
        Dates, or dates with times.

    Returns
    -------
    str or None
        Empty where no date needs one; None where some do, and all of them are dates in either order.
    """
    days = {found.groups() for text in texts if (found := _EITHER.match(text.strip()))}
    if not days:
        return ""
    if any(int(second) > _MONTHS for _, second, _ in days):
        return MONTH_FIRST
    return DAY_FIRST if any(int(first) > _MONTHS for first, _, _ in days) else None


def _zone(text: str | None) -> float:
    """Seconds by which a zone is ahead of UTC."""
    if not text or text in ("Z", "UTC"):
        return 0.0
    digits = text[1:].replace(":", "")
    return (-1.0 if text[0] == "-" else 1.0) * (3600.0 * int(digits[:2]) + 60.0 * int(digits[2:]))


def seconds_from_cells(cells: NDArray[Any], order: str = "") -> NDArray[np.float64]:
    """Numbers, dates and times of day as (n,) float64; NaN for any other text.

    Parameters
    ----------
    cells : (n,) array of objects
        Text, or None where there is none.
    order : str
        One of `ORDERS`, for dates with slashes.
    """
    return np.array([_number_or_time(cell, order) for cell in cells], dtype=np.float64)


def joined(days: NDArray[Any], clocks: NDArray[Any]) -> NDArray[np.object_]:
    """Dates and times of day of two columns as one, (n,).

    Parameters
    ----------
    days, clocks : (n,) arrays
        Cells of the two columns.
    """
    cells = np.empty(len(days), dtype=object)
    cells[:] = [
        None if day is None or clock is None else f"{str(day).strip()} {str(clock).strip()}"
        for day, clock in zip(days, clocks, strict=True)
    ]
    return cells


def _number_or_time(cell: Any, order: str) -> float:
    try:
        return number_from_text(cell)
    except ValueError:
        return seconds_from_text(str(cell), order)
