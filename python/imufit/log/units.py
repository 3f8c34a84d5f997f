"""Units of foreign logs: what they measure and how they become SI (and uT)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.columns import GROUPS
from imufit.log.metadata import STANDARD_GRAVITY
from imufit.log.unit_grammar import Reading, readings_of

_G: Final = STANDARD_GRAVITY
_DEG: Final = math.pi / 180.0


@dataclass(frozen=True)
class Conversion:
    """The line from a foreign number to SI: ``factor * x + offset``.

    Parameters
    ----------
    factor : float
        SI units per foreign unit, with the sign.
    offset : float
        SI value at a foreign zero.
    """

    factor: float = 1.0
    offset: float = 0.0

    def apply(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert an (n,) array; the identity returns it untouched."""
        if self.factor != 1.0:
            values = values * self.factor
        return values + self.offset if self.offset else values


# name: (quantity, SI per unit, SI at zero)
_UNITS: Final[dict[str, tuple[str, float, float]]] = {
    "s": ("time", 1.0, 0.0),
    "ms": ("time", 1e-3, 0.0),
    "us": ("time", 1e-6, 0.0),
    "ns": ("time", 1e-9, 0.0),
    "min": ("time", 60.0, 0.0),
    "h": ("time", 3600.0, 0.0),
    "d": ("time", 86400.0, 0.0),
    "m/s^2": ("specific force", 1.0, 0.0),
    "cm/s^2": ("specific force", 1e-2, 0.0),
    "g": ("specific force", _G, 0.0),
    "mg": ("specific force", 1e-3 * _G, 0.0),
    "ug": ("specific force", 1e-6 * _G, 0.0),
    "rad/s": ("angular rate", 1.0, 0.0),
    "mrad/s": ("angular rate", 1e-3, 0.0),
    "deg/s": ("angular rate", _DEG, 0.0),
    "mdeg/s": ("angular rate", 1e-3 * _DEG, 0.0),
    "rpm": ("angular rate", math.pi / 30.0, 0.0),
    "uT": ("magnetic flux density", 1.0, 0.0),
    "nT": ("magnetic flux density", 1e-3, 0.0),
    "mT": ("magnetic flux density", 1e3, 0.0),
    "T": ("magnetic flux density", 1e6, 0.0),
    "G": ("magnetic flux density", 100.0, 0.0),
    "mG": ("magnetic flux density", 0.1, 0.0),
    "degC": ("temperature", 1.0, 0.0),
    "K": ("temperature", 1.0, -273.15),
    "degF": ("temperature", 5.0 / 9.0, -160.0 / 9.0),
    "rad": ("angle", 1.0, 0.0),
    "deg": ("angle", _DEG, 0.0),
    "m": ("length", 1.0, 0.0),
    "cm": ("length", 1e-2, 0.0),
    "mm": ("length", 1e-3, 0.0),
}
_TEMPERATURES: Final = {
    **dict.fromkeys(("c", "celsius", "degc", "deg c", "degcelsius", "degrees celsius", "deg celsius"), "degC"),
    **dict.fromkeys(("k", "kelvin"), "K"),
    **dict.fromkeys(("f", "fahrenheit", "degf", "deg f", "degfahrenheit"), "degF"),
}
"""Temperatures have an offset and stand in no product: their spellings in small letters."""
QUANTITIES: Final = {
    "t": "time",
    **dict.fromkeys(GROUPS["acc"], "specific force"),
    **dict.fromkeys(GROUPS["gyr"], "angular rate"),
    **dict.fromkeys(GROUPS["mag"], "magnetic flux density"),
    "temp": "temperature",
    **dict.fromkeys(GROUPS["ref_q"], "unit quaternion"),
    **dict.fromkeys(GROUPS["ref_p"], "length"),
    "ref_angle": "angle",
}
"""The quantity of each column of a log."""
_UNSIGNED: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER: Final = rf"[-+]?{_UNSIGNED}"
# the sign of an exponent, as in *1e-3, begins no offset
_WITH_OFFSET: Final = re.compile(rf"(.*?[^\s^*/(+\-]\s*)(?<![\d.][eE])([+-]\s*{_UNSIGNED})")


def lookup(text: str, quantity: str | None = None) -> tuple[str, float, float] | None:
    """Quantity, SI per unit and SI at zero of a unit; None when the text names no unit.

    Parameters
    ----------
    text : str
        Any spelling that `imufit.log.unit_grammar` reads.
    quantity : str, optional
        What it has to measure. Capital and small letters then count alike where nothing else fits: of an
        accelerometer ``G`` is the standard gravity.
    """
    name = " ".join(text.split())
    known = _UNITS.get(name) or _UNITS.get(_TEMPERATURES.get(name.replace("°", "deg").replace("℃", "degC").lower(), ""))
    if known is not None and quantity in (None, known[0]):
        return known
    exact, folded = readings_of(name), readings_of(name, folded=True)
    if quantity is not None:
        fitting = [each for each in (*exact, *folded) if each.quantity == quantity]
    else:
        # without a quantity a text in other letters must have one meaning
        fitting = list(exact) or (list(folded) if len(folded) == 1 else [])
    return (fitting[0].quantity, _si_per(fitting[0]), 0.0) if fitting else None


def written(text: str, quantity: str) -> str | None:
    """Spell a unit as a mapping writes it; None where the text is not a unit of that quantity.

    Parameters
    ----------
    text : str
        Any spelling.
    quantity : str
        What it measures.
    """
    known = lookup(text, quantity)
    if known is None:
        return None
    return next((name for name, unit in _UNITS.items() if unit == known), text)


def _si_per(reading: Reading) -> float:
    """SI units (and uT) per unit."""
    return reading.scale * math.prod(_UNITS[name][1] ** power for name, power in reading.symbols)


def conversion(target: str, unit: str) -> Conversion:
    """Conversion of a column given in `unit` to the SI unit of the column `target`.

    Parameters
    ----------
    target : str
        Column of the log; a name without fixed meaning takes any unit.
    unit : str
        ``g``, ``deg/s``, ..., ``16384 LSB/g``, ``0.061 mg/LSB``, ``*0.0005`` (a bare factor), ``100 Hz`` (row numbers
        or ticks to seconds), or empty for SI. An offset may follow, in the unit named:
        ``340 LSB/degC + 36.53``.

    Raises
    ------
    InputError
        The unit is unknown or measures something else.
    """
    text = unit.strip()
    if not text:
        return Conversion()
    if found := _WITH_OFFSET.fullmatch(text):
        plain, si_per_unit = _without_offset(target, found[1].strip(), unit)
        return Conversion(plain.factor, plain.offset + float("".join(found[2].split())) * si_per_unit)
    return _without_offset(target, text, unit)[0]


def _without_offset(target: str, text: str, unit: str) -> tuple[Conversion, float]:
    """Conversion, and the SI value of one of the unit named: what an offset counts in."""
    if found := re.fullmatch(rf"\*\s*({_NUMBER})", text):
        return Conversion(float(found[1])), 1.0
    if found := re.fullmatch(rf"({_NUMBER})\s*Hz", text, re.IGNORECASE):
        return Conversion(1.0 / _positive(float(found[1]), target, unit)), 1.0
    scale, inner = 1.0, text
    if found := re.fullmatch(rf"({_NUMBER})\s*(?:LSB|counts?|digits?)\s*(?:/|per)\s*(.+)", text, re.IGNORECASE):
        scale, inner = 1.0 / _positive(float(found[1]), target, unit), found[2]
    elif found := re.fullmatch(rf"({_NUMBER})\s*(.+?)\s*(?:/|per)\s*(?:LSB|count|digit)", text, re.IGNORECASE):
        scale, inner = float(found[1]), found[2]
    wanted = QUANTITIES.get(target)
    known = lookup(inner, wanted) or lookup(inner)
    if known is None:
        raise InputError(
            f"the unit [{unit}] is not known",
            column=target,
            remedy=f"Known are {', '.join(_UNITS)}, [16384 LSB/g], [340 LSB/degC + 36.53] and a bare factor such as "
            "[*0.0005].",
        )
    quantity, factor, offset = known
    if wanted is not None and quantity != wanted:
        raise InputError(f"[{unit}] is a unit of {quantity}, but {target} is {wanted}", column=target)
    return Conversion(factor * scale, offset), factor


def _positive(number: float, target: str, unit: str) -> float:
    if number == 0.0:
        raise InputError(f"the unit [{unit}] divides by zero", column=target)
    return number


def unit_in_header(name: str, target: str) -> str:
    """Find the unit that a column name carries in trailing brackets, as in ``Time (s)``; empty when it carries none."""
    found = re.search(r"(?:\[([^\[\]]*)\]|\(([^()]*(?:\([^()]*\)[^()]*)?)\))\s*$", name)
    if not found:
        return ""
    if found[1] is not None and found[1].isdigit():
        return ""  # an index, as in gyro_rad[0]
    square, text = found[1] is not None, found[1] if found[1] is not None else found[2]
    try:
        conversion(target, text)
    except InputError:
        if square or lookup(text) is not None:
            raise
        return ""
    return text


def parse_mapping(*texts: str) -> dict[str, str]:
    """Read column mappings as they are given on the command line.

    Parameters
    ----------
    *texts : str
        Each ``target=source``, or several of them with commas between: ``acc_x=-AccX[g]``. In front of the source
        column a sign may stand, behind it a unit in brackets.

    Returns
    -------
    dict
        Source text for each target column.

    Raises
    ------
    InputError
        A text has no ``=``, or a target is given twice.
    """
    mapping: dict[str, str] = {}
    for part in (part for text in texts for part in _split(text)):
        target, equals, source = part.partition("=")
        target, source = target.strip(), source.strip()
        if not equals or not target or not source:
            raise InputError(
                f"the mapping {part!r} does not read TARGET=SOURCE", remedy="Write for example acc_x=AccX[g]."
            )
        if target in mapping:
            raise InputError(f"column {target} is mapped twice", column=target)
        mapping[target] = source
    return mapping


def _split(text: str) -> Iterator[str]:
    """Split at the commas that are followed by another ``name=``."""
    yield from (part for part in re.split(r",(?=\s*[A-Za-z_]\w*\s*=)", text) if part.strip())
