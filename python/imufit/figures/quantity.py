"""Numbers and units as a person reads them: SI inside, degrees and g only where something is shown."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

_DEGREES = 180.0 / math.pi
_GRAVITY = 9.80665
_PARTS = re.compile(r"(?P<head>\([^()]*\)|rad/s\^2|rad/s|m/s\^2|[^/ ()]+)(?:(?P<over>/| per )(?P<tail>.+))?")
_SHORT = {"s": ((1e-4, 1e6, "µs"), (0.1, 1e3, "ms")), "m": ((0.1, 1e3, "mm"),)}
"""Times and lengths below so many s or m are shown in a smaller unit: no zero stands before the first digit."""
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_SPELLING = (("^2", "²"), ("^3", "³"), ("degC", "°C"), ("uT", "µT"), ("sqrt(Hz)", "√Hz"), ("sqrt(s)", "√s"))


def shown_unit(unit: str, size: float | None = None) -> tuple[float, str]:
    """Find the unit in which a quantity is shown, and the factor that leads there.

    Parameters
    ----------
    unit : str
        SI unit as the library keeps it, e.g. ``rad/s`` or ``1``.
    size : float, optional
        Largest size of the values, in `unit`: a short time is then shown in ms or µs, a short length in mm.

    Returns
    -------
    factor : float
        Shown value = factor * value.
    shown : str
        The unit to print: radians become degrees, pure numbers become per cent.

    Examples
    --------
    >>> shown_unit("m/s^2")
    (1.0, 'm/s²')
    """
    text = unit.strip()
    if text in _SHORT and size is not None and math.isfinite(size) and size != 0.0:
        return next(((factor, short) for below, factor, short in _SHORT[text] if abs(size) < below), (1.0, text))
    if text in ("", "1", "-"):
        return 100.0, "%"
    parts = _PARTS.fullmatch(text)
    if parts is None:
        return 1.0, _pretty(text)
    head, tail = parts["head"].strip("()"), parts["tail"] or ""
    factor, shown = (100.0, "%") if head == "1" else (1.0, head)
    if head.startswith("rad"):
        factor, shown = _DEGREES, "deg" + head[3:]
        if tail in ("(m/s^2)", "m/s^2"):
            return factor * _GRAVITY, f"{shown} per g"
    for rate, power in (("(rad/s)^2", 2), ("(rad/s)^3", 3), ("(rad/s)", 1), ("rad/s", 1)):
        if tail == rate:
            factor, tail = factor / _DEGREES**power, rate.replace("rad", "deg")
    return factor, _pretty(f"{shown}{parts['over']}{tail}" if tail else shown)


def axis(name: str, unit: str) -> tuple[float, str]:
    """Return the factor and the title of the axis of a covariate.

    Parameters
    ----------
    name : str
        Its name.
    unit : str
        SI unit; empty for a column of the log whose unit nothing states.
    """
    factor, shown = shown_unit(unit) if unit else (1.0, "in the log's unit")
    return factor, f"{name}, {shown}"


def _pretty(unit: str) -> str:
    """Write powers and degrees as people do."""
    for plain, pretty in _SPELLING:
        unit = unit.replace(plain, pretty)
    return unit


def number(value: float | None, digits: int = 3) -> str:
    """Value in few significant digits; a dash where there is none.

    Parameters
    ----------
    value : float or None
        Any unit.
    digits : int
        Significant digits.

    Returns
    -------
    str
        For instance ``0.0213``, ``1.5e-06`` or ``-``.
    """
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    if 1e-4 <= abs(value) < 1e5:
        places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return f"{value:.{places}f}"
    return f"{value:.{digits - 1}e}"


def large(value: float) -> str:
    """Return a large number in two digits with a power of ten, e.g. ``9.3×10⁸``."""
    digits, _, power = f"{value:.1e}".partition("e")
    return f"{digits}×10{str(int(power)).translate(_RAISED)}"


def ratio(value: float | None) -> str:
    """Residual over noise floor, e.g. ``1.04``, ``23.1``, ``1240`` or ``9.3×10⁸``."""
    if value is None or not math.isfinite(value):
        return "-"
    if abs(value) >= 1e5:
        return large(value)
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}" if abs(value) < 100.0 else f"{value:.0f}"


def fall(before: float | None, after: float | None) -> str:
    """Return from where to where an error falls, both over the noise floor, such as ``from 2.17 to 1.01 times ...``.

    Parameters
    ----------
    before, after : float or None
        The ratios; None where they are not known.
    """
    first, last = _apart(before, after)
    return f"from {first} to {last} times the noise floor"


def change(before: float, after: float) -> str:
    """Return an error without and with an effect alone: ``2.17 → 1.31``, ``stays at 2.17`` or ``rises to 4.31``.

    Parameters
    ----------
    before, after : float
        The ratios.
    """
    # A rise in the third digit is chance: only a fall is followed that far.
    first, last = (ratio(before), ratio(after)) if after >= before else _apart(before, after)
    if last == first:
        return f"stays at {first}"
    return f"{first} → {last}" if after < before else f"rises to {last}"


def _apart(before: float | None, after: float | None) -> tuple[str, str]:
    """Return two ratios, with a digit more where they look the same: a small effect lowers an error by 0.2 %."""
    first, last = ratio(before), ratio(after)
    if first != last or before is None or after is None or not abs(before) < 10.0:
        return first, last
    finer = f"{before:.3f}", f"{after:.3f}"
    return (first, last) if finer[0] == finer[1] else finer


def promise(effect: str, before: float, after: float) -> str:
    """Return what adding an effect that is there brings, without a full stop.

    Parameters
    ----------
    effect : str
        Its id, or ``it``.
    before, after : float
        The error without and with it alone, over the noise floor.
    """
    if after < before:
        first, last = _apart(before, after)
        if first == last:
            return (
                f"Adding {effect} should lower the held-out error a little below {ratio(before)} times the noise floor"
            )
        return f"Adding {effect} should cut the held-out error {fall(before, after)}"
    return f"Alone {effect} does not lower the held-out error; beside the other effects it may"


def share(value: float | None) -> str:
    """Fraction as per cent, e.g. ``63 %``."""
    if value is None or not math.isfinite(value):
        return "-"
    if 0.0 < value < 0.0005:
        return "< 0.1 %"
    return f"{100.0 * value:.1f} %" if 0.0005 <= abs(value) < 0.0995 else f"{100.0 * value:.0f} %"


def probability(value: float | None) -> str:
    """Probability as per cent; near 0 and 1 as a bound, e.g. ``> 99.9 %``, since no evidence is certain."""
    if value is None or not math.isfinite(value):
        return "-"
    if value < 0.001:
        return "< 0.1 %"
    if value > 0.999:
        return "> 99.9 %"
    return f"{100.0 * value:.1f} %" if value < 0.0995 or value > 0.9945 else f"{100.0 * value:.0f} %"


def counted(count: int, singular: str) -> str:
    """Give a number with its noun, e.g. ``1 note`` or ``3 notes``."""
    return f"{count} {singular}" if count == 1 else f"{count} {singular}s"


def p_value(value: float | None) -> str:
    """Probability without false precision, e.g. ``< 1e-06`` or ``0.031``."""
    if value is None or not math.isfinite(value):
        return "-"
    return (
        "< 1e-06"
        if value < 1e-6
        else f"{value:.1e}"
        if value < 1e-3
        else f"{value:.3f}"
        if value < 0.1
        else f"{value:.2f}"
    )


@dataclass(frozen=True)
class Digits:
    """A value in the digits that its standard error warrants.

    Attributes
    ----------
    value, error : str
        In the shown unit; the error is empty where there is none.
    factor : float
        Shown value = factor * value in the SI unit.
    unit : str
        The shown unit.
    """

    value: str
    error: str
    factor: float
    unit: str


def digits_of(value: float, standard_error: float, unit: str) -> Digits:
    """Return a value in the shown unit, rounded by its standard error.

    Parameters
    ----------
    value, standard_error : float
        In `unit`.
    unit : str
        SI unit.
    """
    known = math.isfinite(standard_error) and standard_error > 0.0
    factor, shown = shown_unit(unit, max(abs(value), standard_error) if known else value)
    value, standard_error = factor * value, factor * standard_error
    if not known:
        return Digits(number(value), "", factor, shown)
    if standard_error >= 1e5 or standard_error < 1e-6:
        return Digits(number(value), number(standard_error, 2), factor, shown)
    places = max(0, 1 - math.floor(math.log10(standard_error)))
    return Digits(f"{value:.{places}f}", f"{standard_error:.{places}f}", factor, shown)


def with_error(value: float, standard_error: float, unit: str) -> str:
    """Value and standard error in the shown unit, rounded by the error.

    Parameters
    ----------
    value, standard_error : float
        In `unit`.
    unit : str
        SI unit.

    Returns
    -------
    str
        For instance ``0.0200 ± 0.0004 deg/s per g``.
    """
    shown = digits_of(value, standard_error, unit)
    return f"{shown.value} ± {shown.error} {shown.unit}" if shown.error else f"{shown.value} {shown.unit}"


def mean(value: float | None, unit: str, standard_error: float) -> str:
    """Value in three digits of the shown unit, none of them below its standard error, e.g. ``0.000 m/s²``.

    Parameters
    ----------
    value, standard_error : float
        In `unit`.
    unit : str
        SI unit.
    """
    if value is None or not math.isfinite(value) or not math.isfinite(standard_error) or abs(value) >= standard_error:
        return quantity(value, unit)
    factor, shown = shown_unit(unit, standard_error)
    places = max(0, -math.floor(math.log10(factor * standard_error))) if standard_error > 0.0 else 0
    return f"{0.0:.{places}f} {shown}"


def chosen(value: float, unit: str) -> Digits:
    """Return a value that a person has chosen, in the shown unit: in six digits, without zeros at the end.

    Parameters
    ----------
    value : float
        In `unit`.
    unit : str
        SI unit.
    """
    factor, shown = shown_unit(unit, value)
    return Digits(f"{factor * value:.6g}", "", factor, shown)


def quantity(value: float | None, unit: str) -> str:
    """Value in the shown unit, e.g. ``0.573 deg/s``; a dash without a value."""
    if value is None or not math.isfinite(value):
        return "-"
    factor, shown = shown_unit(unit, value)
    return f"{number(factor * value)} {shown}"


def span(t_start: float, t_end: float) -> str:
    """Stretch of time, e.g. ``120 to 180 s``; a dash if it is not known."""
    if not (math.isfinite(t_start) and math.isfinite(t_end)):
        return "-"
    places = 0 if t_end - t_start >= 20.0 else 1 if t_end - t_start >= 2.0 else 3
    return f"{t_start:.{places}f} to {t_end:.{places}f} s"
