"""Factors by which readings are off when they were written down in another unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

G: Final = 9.80665
DEG: Final = 180.0 / math.pi
TOLERANCE: Final = 0.08
"""How far from a known factor a ratio may lie: scale errors of sensors are smaller."""

USUAL: Final = 1.25
"""Up to this factor either way a reading is that of a sensor with an error of scale."""


@dataclass(frozen=True)
class WrongUnit:
    """A factor that readings are off by, what it means, and the unit to declare (empty: none that a mapping knows)."""

    factor: float
    words: str
    unit: str = ""


def _counts(per: float, unit: str, steps: tuple[float, ...]) -> list[WrongUnit]:
    return [WrongUnit(per * step, f"raw counts of {step:g} LSB/{unit}", f"{step:g} LSB/{unit}") for step in steps]


_RANGES: Final = [
    WrongUnit(1.0 / factor, f"counts converted for a range {factor:g} times too small") for factor in (2, 4, 8, 16)
] + [WrongUnit(float(factor), f"counts converted for a range {factor:g} times too large") for factor in (2, 4, 8, 16)]
_TENS: Final = [WrongUnit(10.0**k, f"a factor of 1e{k} too much") for k in (1, 2, 3, 6)] + [
    WrongUnit(10.0**-k, f"a factor of 1e{k} too little") for k in (1, 2, 3, 6)
]

KNOWN: Final[dict[str, list[WrongUnit]]] = {
    "acc": [
        WrongUnit(1.0 / G, "g", "g"),
        WrongUnit(1000.0 / G, "milli-g", "mg"),
        WrongUnit(G, "converted from g to m/s^2 twice"),
        *_counts(1.0 / G, "g", (16384.0, 8192.0, 4096.0, 2048.0)),
        *_RANGES,
        *_TENS,
    ],
    "gyr": [
        WrongUnit(DEG, "deg/s", "deg/s"),
        WrongUnit(1000.0 * DEG, "milli-deg/s", "mdeg/s"),
        WrongUnit(1.0 / DEG, "converted from deg/s to rad/s twice"),
        WrongUnit(30.0 / math.pi, "rpm", "rpm"),
        WrongUnit(1000.0, "mrad/s, or t in ms", "mrad/s"),
        *_counts(DEG, "(deg/s)", (131.0, 65.5, 32.8, 16.4)),
        *_RANGES,
        *_TENS,
    ],
    "mag": [
        WrongUnit(0.01, "gauss", "G"),
        WrongUnit(10.0, "milligauss", "mG"),
        WrongUnit(1000.0, "nT", "nT"),
        WrongUnit(1e-3, "mT", "mT"),
        WrongUnit(1e-6, "T", "T"),
    ],
}


def wrong_unit(sensor: str, ratio: float) -> WrongUnit | None:
    """Find the unit in which readings are `ratio` times what they should be; None if no known one gives that.

    Parameters
    ----------
    sensor : str
        ``acc``, ``gyr`` or ``mag``.
    ratio : float
        Reading over ideal reading.
    """
    if not ratio > 0.0:
        return None
    known = [item for item in KNOWN[sensor] if abs(ratio / item.factor - 1.0) < TOLERANCE]
    # Named units come before bare factors: 9.8 is more likely gravity than ten.
    return known[0] if known else None
