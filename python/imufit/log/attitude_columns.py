"""Columns of a log that have the names of an attitude, without being its reference."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

from imufit.log.columns import GROUPS
from imufit.log.log import LogSource
from imufit.remedy import Remedy, mapped, reading

_NAMED: Final = re.compile(r"(?P<base>.*?)[._ ]?q?[._ ]?(?P<part>[wxyz])", re.IGNORECASE)


def quaternions_named(names: Iterable[str]) -> Iterator[tuple[str, ...]]:
    """Find quaternions by the names of their parts, scalar first.

    Parameters
    ----------
    names : iterable of str
        Columns without a fixed meaning.
    """
    named: dict[str, dict[str, str]] = {}
    for name in names:
        if found := _NAMED.fullmatch(name):
            named.setdefault(found["base"], {})[found["part"].lower()] = name
    for parts in named.values():
        if set(parts) == set("wxyz"):
            yield tuple(parts[part] for part in "wxyz")


def attitude_offered(log: LogSource) -> str | Remedy:
    """Name the mapping that makes a quaternion of a log its reference; empty where the log does not have one.

    A quaternion beside a sensor's readings is often a filter's, which was computed from these readings. So it becomes
    the reference on request alone.

    Parameters
    ----------
    log : LogSource
        Without a reference attitude; one row of it is read.
    """
    row = next(iter(log.chunks(1))).core
    found = next(quaternions_named(row.covariates), None)
    if found is None:
        return ""
    how = reading(log.path, mapped(log.origin.mapping(dict(zip(GROUPS["ref_q"], found, strict=True)))))
    return f" If {', '.join(found)} were measured, not computed from these readings, use " + how
