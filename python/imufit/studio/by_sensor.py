"""Effects in groups, by the sensor or the part of the measurement that they change."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from imufit.log.columns import SENSOR_NAMES
from imufit.results.phrasing import capital

PARTS: Final = {**SENSOR_NAMES, "ref": "reference", "rig": "test rig"}
"""Names of the groups by the beginning of an effect's id."""


def part_of(effect: str) -> str:
    """Return the name of an effect's group.

    Parameters
    ----------
    effect : str
        Its id.
    """
    begin = effect.partition(".")[0]
    return capital(PARTS.get(begin, begin))


def by_sensor(effects: Iterable[str]) -> dict[str, list[str]]:
    """Return effects by the name of their group, both in alphabetical order of the ids.

    Parameters
    ----------
    effects : iterable of str
        Their ids.
    """
    found: dict[str, list[str]] = {}
    for effect in sorted(effects):
        found.setdefault(part_of(effect), []).append(effect)
    return found
