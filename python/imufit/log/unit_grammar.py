"""Units as they are spelled in headers, read by one grammar: prefix, symbol, exponent, products and quotients."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

Powers = tuple[int, int, int, int]
"""Exponents of length, time, angle and magnetic flux density."""

QUANTITIES: Final[dict[str, Powers]] = {
    "time": (0, 1, 0, 0),
    "length": (1, 0, 0, 0),
    "angle": (0, 0, 1, 0),
    "specific force": (1, -2, 0, 0),
    "angular rate": (0, -1, 1, 0),
    "magnetic flux density": (0, 0, 0, 1),
}
"""Quantities of a log, apart from temperatures, which have no prefix and stand in no product."""

_SYMBOLS: Final[dict[str, tuple[Powers, str, tuple[str, ...]]]] = {
    # what it is of, its unit among those of `imufit.log.units`, spellings
    "s": (QUANTITIES["time"], "s", ("s", "sec", "secs", "second", "seconds")),
    "min": (QUANTITIES["time"], "min", ("min", "minute", "minutes")),
    "h": (QUANTITIES["time"], "h", ("h", "hour", "hours")),
    "d": (QUANTITIES["time"], "d", ("d", "day", "days")),
    "m": (QUANTITIES["length"], "m", ("m", "meter", "meters", "metre", "metres")),
    "rad": (QUANTITIES["angle"], "rad", ("rad", "rads", "radian", "radians")),
    "deg": (QUANTITIES["angle"], "deg", ("deg", "degs", "degree", "degrees")),
    "g": (QUANTITIES["specific force"], "g", ("g", "gs", "gee", "gees", "gn", "g0")),
    "Gal": (QUANTITIES["specific force"], "cm/s^2", ("gal", "gals")),
    "T": (QUANTITIES["magnetic flux density"], "T", ("T", "tesla", "teslas")),
    "G": (QUANTITIES["magnetic flux density"], "G", ("G", "Gs", "Ga", "gauss")),
    "rpm": (QUANTITIES["angular rate"], "rpm", ("rpm",)),
    "dps": (QUANTITIES["angular rate"], "deg/s", ("dps",)),
}
_PREFIXES: Final = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "nano": 1e-9, "micro": 1e-6, "milli": 1e-3}
_OF_LENGTH: Final = {"c": 1e-2, "m": 1e-3, "centi": 1e-2, "milli": 1e-3}
_BARE: Final = ("min", "h", "d", "rpm")
"""Symbols that take no prefix."""
_WORD: Final = 3
"""Letters from which on a spelling is a word, the same in capital and small letters; symbols are not."""
_FACTORS: Final = 4
"""Factors of a unit at most: meters per second per second has three."""
_SIGNS: Final = {
    "\u2212": "-",  # minus
    "\u2013": "-",
    "\u00b7": "*",  # middle dots and crosses of a product
    "\u22c5": "*",
    "\u2219": "*",
    "\u2022": "*",
    "\u00d7": "*",
    "\u03bc": "u",  # the prefix micro, which NFKC writes as the Greek letter
    "\u00b0": "deg",
    "\u02da": "deg",  # ring above, used for the degree sign
}
_TOKEN: Final = re.compile(r"(?P<letters>[A-Za-z]+0?)|(?P<sign>\*|/|\(|\)|[.\s]+)")
_EXPONENT: Final = re.compile(r"\^?\(?([+-]?\d)\)?(?!\d)")
_PLAIN: Final = re.compile(r"[ -~]*")
LONGEST: Final = 40
"""Characters of a unit; what is longer is a sentence. The longest spelled out has 29: meters per second per second."""


@dataclass(frozen=True)
class _Product:
    """A product of units: its powers, its factor to SI times that of each symbol, and the symbols by name."""

    powers: Powers = (0, 0, 0, 0)
    scale: float = 1.0
    symbols: tuple[tuple[str, int], ...] = ()

    def times(self, other: _Product, exponent: int) -> _Product:
        """Multiply by a power of another product."""
        a, b, c, d = (p + exponent * q for p, q in zip(self.powers, other.powers, strict=True))
        more = tuple((name, exponent * power) for name, power in other.symbols)
        return _Product((a, b, c, d), self.scale * other.scale**exponent, (*self.symbols, *more))


@dataclass(frozen=True)
class Reading:
    """One way to understand the text of a unit.

    Parameters
    ----------
    quantity : str
        What it measures, one of `QUANTITIES`.
    scale : float
        Product of the prefixes.
    symbols : tuple of (str, int)
        Units of `imufit.log.units` with their exponents, of which the unit is the product.
    """

    quantity: str
    scale: float
    symbols: tuple[tuple[str, int], ...]


@lru_cache(maxsize=4096)
def readings_of(text: str, folded: bool = False) -> tuple[Reading, ...]:
    """Find the ways in which a text is the unit of a quantity that logs have.

    ``m/s^2``, ``m s^-2``, ``m·s⁻²``, ``ms-2``, ``mps2`` and ``m/(s**2)`` are one unit. Letters that run together are
    taken apart in every way that leaves nothing over. Where the text has neither a fraction bar nor a negative
    exponent, as within a column's name, all but the first factor may stand below the bar: ``m_s2``, ``rads``.

    Parameters
    ----------
    text : str
        What stands in brackets, or words of a name.
    folded : bool
        Whether capital and small letters count alike.

    Returns
    -------
    tuple of Reading
        Each quantity once: the plain product before the one with a bar that is not written. Empty where the text is not
        such a unit.
    """
    plain = _plain(text)
    if not plain or len(plain) > LONGEST or _PLAIN.fullmatch(plain) is None:
        return ()
    plain = plain.lower() if folded else plain
    quantities = {powers: name for name, powers in QUANTITIES.items()}
    found: dict[str, Reading] = {}
    for below in (False, True):
        if below and ("/" in plain or "-" in plain):
            continue
        for product in _products(plain, _Product(), 1, below, folded):
            quantity = quantities.get(product.powers)
            if quantity is not None:
                found.setdefault(quantity, Reading(quantity, product.scale, product.symbols))
    return tuple(found.values())


def _plain(text: str) -> str:
    """Write a unit with the letters and signs of ASCII."""
    # the ordinal indicator stands for the degree sign, and NFKC would make a letter of it
    text = unicodedata.normalize("NFKC", text.strip().replace("\u00ba", "\u00b0"))
    plain = "".join(_SIGNS.get(letter, letter) for letter in text)
    plain = re.sub(r"\bper\b|(?<=[a-z])(?:Per|_per_)", "/", plain.replace("**", "^"))
    plain = re.sub(r"\s+squared\b", "^2", plain.replace("_", " "))
    plain = re.sub(r"\b(milli|micro|nano)[- ](?=[A-Za-z])", r"\1", plain, flags=re.IGNORECASE)
    return re.sub(r"\s*([*/^])\s*", r"\1", plain)


def _products(text: str, left: _Product, sign: int, below: bool, folded: bool) -> Iterator[_Product]:
    """Read the rest of a text behind what was read already; `sign` is -1 right behind a fraction bar."""
    if not text:
        if sign == 1 and left.symbols:
            yield left
        return
    found = _TOKEN.match(text)
    if found is None:
        return
    if found["sign"] is not None:
        yield from _behind_sign(found["sign"].strip(), text, found.end(), left, sign=sign, below=below, folded=folded)
        return
    letters = found["letters"]
    for length in range(len(letters), 0, -1):
        head = letters[:length]
        if left.symbols and sign == 1 and head in ("p", "per") and length < len(letters):
            yield from _products(text[length:], left, -1, below, folded)
            continue
        rest = text[length:]
        power = _EXPONENT.match(rest)
        exponent = int(power[1]) if power is not None else 1
        downward = -1 if below and left.symbols else sign
        behind = rest[power.end() :] if power is not None else rest
        if exponent and len(left.symbols) < _FACTORS:
            for symbol in _symbols(head, folded):
                yield from _products(behind, left.times(symbol, downward * exponent), 1, below, folded)


def _behind_sign(
    token: str, text: str, end: int, left: _Product, *, sign: int, below: bool, folded: bool
) -> Iterator[_Product]:
    """Read on behind a sign: a bar, a product, or a group in parentheses."""
    if token == "/" and sign == 1 and left.symbols:
        yield from _products(text[end:], left, -1, below, folded)
    elif token == "(":
        close = text.rfind(")")
        power = _EXPONENT.match(text[close + 1 :]) if close > 0 else None
        behind = text[close + 1 + (power.end() if power is not None else 0) :]
        exponent = int(power[1]) if power is not None else 1
        if close > 0:
            for inner in _products(text[1:close], _Product(), 1, below, folded):
                yield from _products(behind, left.times(inner, sign * exponent), 1, below, folded)
    elif token in ("*", "", ".") and left.symbols and sign == 1 and text[end:]:
        yield from _products(text[end:], left, sign, below, folded)


@lru_cache(maxsize=4096)
def _symbols(text: str, folded: bool) -> tuple[_Product, ...]:
    """Find the symbols, with or without prefix, that letters stand for: those written alike before all others."""
    exact: list[_Product] = []
    alike: list[_Product] = []
    for name, (powers, unit, spellings) in _SYMBOLS.items():
        prefixes = {"": 1.0} | ({} if name in _BARE else _OF_LENGTH if name == "m" else _PREFIXES)
        for spelling in spellings:
            for prefix, scale in prefixes.items():
                product = _Product(powers, scale, ((unit, 1),))
                if prefix + spelling == text:
                    exact.append(product)
                elif (folded or len(spelling) >= _WORD) and (prefix + spelling).lower() == text.lower():
                    alike.append(product)
    return tuple(exact or alike) if not folded else (*exact, *alike)
