"""Factors by which readings are off when they were written down in another unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

G: Final = 9.80665
DEG: Final = 180.0 / math.pi
TOLERANCE: Final = math.log(1.25)
"""How far the logarithm of a ratio may lie from that of a known factor: scale errors of sensors are smaller, and nearly
all factors lie two and more apart."""
UNDECIDED: Final = 0.05
"""Logarithm by which one factor must be nearer than another: what scale errors of consumer sensors come to."""
USUAL: Final = 1.25
"""Up to this factor either way a reading is that of a sensor with an error of scale."""
EARTH: Final = (20.0, 70.0)
"""Magnitude of the earth's field, uT (World Magnetic Model: 22 to 67)."""
POSSIBLE: Final = (8.0, 200.0)
"""Magnitude of a field that is measured, uT: steel around weakens the earth's field to a third, or trebles it."""


@dataclass(frozen=True)
class WrongUnit:
    """A factor that readings are off by, what it means, and the unit to declare."""

    factor: float
    words: str
    unit: str


def _counts(per: float, unit: str, steps: tuple[float, ...]) -> list[WrongUnit]:
    return [WrongUnit(per * step, f"raw counts of {step:g} LSB/{unit}", f"{step:g} LSB/{unit}") for step in steps]


def _factor(factor: float, words: str) -> WrongUnit:
    return WrongUnit(factor, words, f"*{1.0 / factor:.9g}")


_RANGES: Final = [
    _factor(1.0 / times, f"counts converted for a range {times:g} times too small") for times in (2, 4, 8, 16)
] + [_factor(float(times), f"counts converted for a range {times:g} times too large") for times in (2, 4, 8, 16)]
_TENS: Final = [_factor(10.0**k, f"a factor of 1e{k} too much") for k in (1, 2, 3, 6)] + [
    _factor(10.0**-k, f"a factor of 1e{k} too little") for k in (1, 2, 3, 6)
]

KNOWN: Final[dict[str, list[WrongUnit]]] = {
    "acc": [
        WrongUnit(1.0 / G, "g", "g"),
        WrongUnit(1000.0 / G, "milli-g", "mg"),
        WrongUnit(100.0, "cm/s^2 (Gal)", "cm/s^2"),
        _factor(G, "converted from g to m/s^2 twice"),
        *_counts(1.0 / G, "g", (16384.0, 8192.0, 4096.0, 2048.0)),
        *_RANGES,
        *(ten for ten in _TENS if ten.factor != 100.0),
    ],
    "gyr": [
        WrongUnit(DEG, "deg/s", "deg/s"),
        WrongUnit(1000.0 * DEG, "milli-deg/s", "mdeg/s"),
        _factor(1.0 / DEG, "converted from deg/s to rad/s twice"),
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
        # AK8963, AK09916 and their kin; HMC5883L; QMC5883L at 8 G and 2 G; RM3100 at 200 cycles.
        *(WrongUnit(1.0 / step, f"raw counts of {step:g} uT/LSB", f"{step:g} uT/LSB") for step in (0.15, 0.6, 0.3)),
        *_counts(1.0, "uT", (10.9, 30.0, 120.0, 75.0)),
    ],
}


def wrong_units(sensor: str, ratio: float, share: float = 0.0) -> tuple[WrongUnit, ...]:
    """Find the unit in which readings are `ratio` times what they should be, the nearest first.

    Parameters
    ----------
    sensor : str
        ``acc``, ``gyr`` or ``mag``.
    ratio : float
        Reading over ideal reading, by least squares.
    share : float
        Share of the readings' sum of squares that is left. As far as it is the ideal reading that is off, the true
        ratio is larger, by up to 1 / (1 - share).

    Returns
    -------
    tuple of WrongUnit
        More than one where errors of scale leave it open; none where no known unit is near.
    """
    if not ratio > 0.0:
        return ()
    low, high = math.log(ratio), math.log(ratio) - math.log1p(-min(share, 0.5))
    logs = {item: math.log(item.factor) for item in KNOWN[sensor]}
    off = {item: max(low - at, at - high, 0.0) for item, at in logs.items()}
    return _nearest({item: away for item, away in off.items() if away < TOLERANCE})


def units_of_field(size: float) -> tuple[WrongUnit, ...]:
    """Find the units in which a magnetic field of some size is that of the earth, the likeliest first.

    Parameters
    ----------
    size : float
        Magnitude of the field as it was read.

    Returns
    -------
    tuple of WrongUnit
        Named units before counts; none where uT are possible.
    """
    if POSSIBLE[0] <= size <= POSSIBLE[1] or not size > 0.0:
        return ()
    fitting = [item for item in KNOWN["mag"] if EARTH[0] <= size / item.factor <= EARTH[1]]
    return tuple(fitting[:3])


def _nearest(off: dict[WrongUnit, float]) -> tuple[WrongUnit, ...]:
    if not off:
        return ()
    best = min(off.values())
    return tuple(item for item in sorted(off, key=lambda each: off[each]) if off[item] <= best + UNDECIDED)
