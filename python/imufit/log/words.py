"""Names of foreign columns taken apart into words: sensor, axis, unit, what else stands there, and what is meant."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from imufit.log.columns import CONTRACT, GROUPS, without_unit
from imufit.log.units import written

_WORD: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_STUCK: Final = re.compile(r"(a|f|g|m|w|b|h|acc|accel|gyr|gyro|mag|magn|omega|raw)([xyz])")
_INDEX: Final = re.compile(r"\[\d+\]$")
_UNIT: Final = re.compile(r"\s*[(\[]([^()\[\]]*(?:\([^()]*\)[^()\[\]]*)?)[)\]]\s*$")

SENSOR_WORDS: Final = {
    "acc": frozenset(
        ("acc", "accel", "accelerometer", "acceleration", "accelerations", "beschleunigung", "ac", "a", "f")
    ),
    "gyr": frozenset(
        ("gyr", "gyro", "gyroscope", "gy", "omega", "drehrate", "angularrate", "angularvelocity", "w", "g")
    ),
    "mag": frozenset(
        ("mag", "magn", "magnet", "magnetometer", "magneticfield", "magnetfeld", "magnetic", "m", "b", "h")
    ),
}
"""Words that name a sensor; single letters only where nothing else does."""
_PAIRS: Final = {
    ("angular", "velocity"): "angularvelocity",
    ("angular", "rate"): "angularrate",
    ("rotation", "rate"): "angularrate",
    ("magnetic", "field"): "magneticfield",
    ("magnetic", "flux"): "magneticfield",
    ("since", "start"): "elapsed",
    ("since", "boot"): "elapsed",
}
"""Two words that name a sensor or the time together."""
COMPUTED: Final = frozenset(
    (
        "linear",
        "lin",
        "user",
        "gravity",
        "est",
        "estimated",
        "estimate",
        "rotated",
        "filtered",
        "bias",
        "variance",
        "cov",
        "covariance",
        "std",
        "integral",
        "world",
        "error",
        "err",
        "offset",
        "setpoint",
        "target",
        "norm",
        "abs",
        "absolute",
        "dt",
        "delta",
        "ned",
        "enu",
        "earth",
        "compensated",
        "free",
    )
)
"""Words of columns that were computed from readings, or describe them: no specific force, rate or field of the body."""
_NEUTRAL: Final = frozenset(
    (
        "sensor",
        "data",
        "imu",
        "cal",
        "calibrated",
        "ln",
        "x",
        "y",
        "z",
        "adc",
        "smooth",
        "sample",
        "shimmer",
        "value",
        "values",
        "reading",
        "readings",
        "combined",
        "mpu",
        "board",
        "msg",
        "axis",
    )
)
"""Words that stand beside a sensor's name without saying anything that makes it another sensor."""
TIME_WORDS: Final = frozenset(
    (
        "t",
        "time",
        "timestamp",
        "timestamps",
        "times",
        "ts",
        "millis",
        "micros",
        "seconds",
        "secs",
        "sec",
        "elapsed",
        "timesec",
        "date",
        "datetime",
        "zeit",
        "clock",
        "sampletimefine",
    )
)
_NO_TIME: Final = frozenset(
    (
        "relative",
        "dt",
        "integral",
        "offset",
        "invalid",
        "packet",
        "delta",
        "update",
        "start",
        "end",
        "sync",
        "fix",
        "local",
    )
)

_LONGEST_UNIT: Final = 4
"""Words that a unit within a name has at most, as in ``m_per_s_2``."""
_SI: Final = {"acc": "m/s^2", "gyr": "rad/s"}
"""The meaning of the word SI in a name."""
_QUANTITY: Final = {
    "acc": "specific force",
    "gyr": "angular rate",
    "mag": "magnetic flux density",
    "t": "time",
    "temp": "temperature",
}


@dataclass(frozen=True)
class Words:
    """A column's name, taken apart.

    Parameters
    ----------
    column : str
        The name.
    words : tuple of str
        Its words in small letters, those of its table in front, without axis and unit in brackets.
    axis : str
        "x", "y" or "z"; empty where the name has none.
    bracket : str
        What stands in brackets at the end and is not an index; empty without.
    index : bool
        Whether the axis is an index counted from 0.
    """

    column: str
    words: tuple[str, ...]
    axis: str
    bracket: str
    index: bool = False

    @property
    def triple(self) -> tuple[str, ...]:
        """The common part of the three axes of a sensor."""
        return (*self.words, "#" if self.index else "", self.bracket)


def words_of(name: str, axes: dict[str, str] | None = None) -> Words:
    """Take a name apart.

    Parameters
    ----------
    name : str
        Column of a file, with its table's name and a point in front where the file has several.
    axes : dict, optional
        Axes of the columns that bear numbers instead of names (``c2``).
    """
    plain, bracket, axis, index = name, "", "", False
    if (found := _UNIT.search(name)) and not found[1].isdigit():
        plain, bracket = name[: found.start()], found[1]
    if found := _INDEX.search(plain):
        number = int(found[0][1:-1])
        axis, index = ("xyz"[number], True) if number < 3 else ("", True)
        plain = plain[: found.start()]
    if axes and name in axes:
        axis, plain = axes[name], plain.rpartition(".")[0]
    words = [word for raw in _WORD.findall(plain.replace("µ", "u")) for word in _unstuck(raw.lower())]
    if not axis:
        places = [k for k, word in enumerate(words) if word in ("x", "y", "z")]
        if places:
            axis = words.pop(places[-1])
    return Words(name, tuple(_joined(words)), axis, bracket, index)


def _unstuck(word: str) -> tuple[str, ...]:
    found = _STUCK.fullmatch(word)
    return (found[1], found[2]) if found else (word,)


def _joined(words: list[str]) -> Iterator[str]:
    k = 0
    while k < len(words):
        pair = (words[k], words[k + 1] if k + 1 < len(words) else "")
        if pair in _PAIRS:
            yield _PAIRS[pair]
            k += 2
        else:
            yield words[k]
            k += 1


def sensor_of(words: tuple[str, ...]) -> tuple[str, tuple[str, ...]] | None:
    """Find the sensor that the words name.

    Returns
    -------
    (sensor, rest) or None
        "acc", "gyr" or "mag", and the words that name neither the sensor nor anything without meaning; None where no
        sensor is named, or where the column was computed.
    """
    if COMPUTED & set(words):
        return None
    for letters in (False, True):
        # a unit may stand behind the letter of a sensor: ax_g
        for k in range(len(words)) if letters else range(len(words) - 1, -1, -1):
            for sensor, names in SENSOR_WORDS.items():
                if words[k] in names and (len(words[k]) == 1) == letters:
                    return sensor, (*words[:k], *words[k + 1 :])
    return None


def unit_of(group: str, rest: tuple[str, ...], bracket: str) -> tuple[str | None, tuple[str, ...]]:
    """Find the unit that a name states.

    Parameters
    ----------
    group : str
        "acc", "gyr", "mag", "t" or "temp".
    rest : tuple of str
        Words that do not name the sensor.
    bracket : str
        What stands in brackets behind the name.

    Returns
    -------
    (unit or None, words)
        The words that are left.
    """
    quantity = _QUANTITY[group]
    unit = written(bracket, quantity) if bracket else None
    for length in range(min(_LONGEST_UNIT, len(rest)), 0, -1):
        stated = _unit_of_words(rest[-length:], group)
        if stated is not None:
            return unit or stated, rest[:-length]
    return unit, rest


def _unit_of_words(words: tuple[str, ...], group: str) -> str | None:
    """Find the unit that words at the end of a name spell, without blanks as a mapping writes it."""
    quantity, text = _QUANTITY[group], "".join(words)
    if text == "si" and group in _SI:
        return _SI[group]
    # gyro_rad (PX4): a gyroscope measures no angle, so that it is one a second
    return written(text, quantity) or (written(f"{text}/s", quantity) if group == "gyr" else None)


def strange(rest: tuple[str, ...]) -> int:
    """Count the words that may make a column another one than the plain sensor."""
    return sum(word not in _NEUTRAL for word in rest)


def time_columns(parsed: Iterable[Words]) -> list[tuple[str, str | None, int]]:
    """Find the columns that are time stamps by their words.

    Returns
    -------
    list of (column, unit, strange)
        Each with the unit that its name states, None without, and the count of its strange words.
    """
    found = []
    for words in parsed:
        if not words.axis and _names_time(words.words):
            unit, rest = unit_of("t", words.words, words.bracket)
            found.append((words.column, unit, strange(rest)))
    return found


def _names_time(words: tuple[str, ...]) -> bool:
    return bool(set(words) & TIME_WORDS or {"sample", "fine"} <= set(words)) and not set(words) & _NO_TIME


def meant(name: str) -> str | None:
    """Contract column that a foreign name most likely means.

    Parameters
    ----------
    name : str
        Column name that is not itself a contract column.

    Returns
    -------
    str or None
        The contract column, or None when the name does not look like one.
    """
    key = re.sub(r"[^a-z0-9]", "", without_unit(name).lower())
    for column in CONTRACT:
        if key == column.replace("_", ""):
            return column
    words = words_of(without_unit(name))
    sensor = sensor_of(words.words) if words.axis and not words.index else None
    if sensor is not None and not sensor[1]:
        return f"{sensor[0]}_{words.axis}"
    if not words.axis and _names_time(words.words) and set(unit_of("t", words.words, "")[1]) <= TIME_WORDS:
        return "t"
    return _close(name)


def _close(name: str) -> str | None:
    """Contract column that differs from the name by a slip of the finger; a digit is not a slip, it counts sensors."""
    if re.search(r"\d", name):
        return None
    grouped = [column for group in GROUPS.values() for column in group]
    for column in difflib.get_close_matches(name.lower(), grouped, n=3, cutoff=0.8):
        if column[-1] == name.lower()[-1]:
            return column
    return None


def one_of(wanted: str, names: Iterable[str]) -> str:
    """Say which of the given names is most like the wanted one, and which there are.

    Parameters
    ----------
    wanted : str
        Name that is not known.
    names : iterable of str
        Those that are.
    """
    names = list(names)
    near = nearest(wanted, names)
    return f"{f'Did you mean {near[0]}? ' if near else ''}Use one of {', '.join(names)}."


def nearest(wanted: str, names: Iterable[str], n: int = 1) -> list[str]:
    """Return those of the given names that are most like the wanted one, best first, at most n."""
    names = list(names)
    sure = [name for name in names if name not in CONTRACT and meant(name) == wanted]
    folded = {name.lower(): name for name in names}
    close = [folded[match] for match in difflib.get_close_matches(wanted.lower(), folded, n=n, cutoff=0.4)]
    return list(dict.fromkeys([*sure, *close]))[:n]
