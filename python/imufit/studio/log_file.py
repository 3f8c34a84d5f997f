"""Logs as they were brought to the studio: the file, how it is read, and the file that was joined to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any, Final

from imufit.errors import InputError
from imufit.log import LogSource, LogStream, Reading, contents, open_log
from imufit.log.columns import GROUPS, SENSOR_NAMES
from imufit.log.foreign import bracket
from imufit.remedy import Option, Remedy
from imufit.results.phrasing import listed

READING: Final = ("mapping", "frame", "noise", "drop")
"""Options of reading a log."""
JOINING: Final = ("lag", "skew")
"""Options of joining a reference to a log."""


@dataclass(frozen=True)
class LogFile:
    """A log on the disk and what makes it readable.

    Attributes
    ----------
    path : Path
        Of the sensor's file.
    name : str
        Its name in text that a person copies: the path as given, or the bare name of a file that a browser sent.
    reading : Reading
        How it is read.
    reference : LogFile or None
        The file that is joined to it; the file itself where its own reference is moved in time.
    lag, skew : float or None
        Delay of the reference's stamps, s, and rate by which its clock is fast; None is found by the joining.
    """

    path: Path
    name: str
    reading: Reading = field(default_factory=Reading)
    reference: LogFile | None = None
    lag: float | None = None
    skew: float | None = None

    def open(self) -> LogSource:
        """Open the log; see :meth:`opened`."""
        return self.opened()[0]

    def opened(self) -> tuple[LogSource, list[str]]:
        """Open the log, and say how its reference was joined; a log with a joined reference is read into memory.

        Raises
        ------
        InputError
            It cannot be read, or the two are not of one motion.
        """
        if self.reference is None:
            way = self.reading
            return open_log(self.path, way.mapping, frame=way.frame, noise=way.noise, drop=way.drop), []
        from imufit.verbs import join  # noqa: PLC0415  the joining is only loaded where it is needed

        other = self.reference
        log = _stream(self, bare=False).read()
        reference = log if other.path == self.path else _stream(other, bare=True).read()
        found = join(log, reference, lag=self.lag, skew=self.skew)
        return found.log, found.sentences()

    def joined(self, reference: LogFile) -> LogFile:
        """Return the same log with another one's reference.

        Parameters
        ----------
        reference : LogFile
            The file of the reference.
        """
        return replace(self, reference=reference)

    def mended(self, option: Option) -> LogFile:
        """Return the same log with one option of a remedy applied.

        Parameters
        ----------
        option : Option
            Keyword argument of reading or joining, with its value.

        Raises
        ------
        InputError
            The option is of neither.
        """
        name, value = option
        if name == "mapping":
            return replace(self, reading=replace(self.reading, mapping={**(self.reading.mapping or {}), **value}))
        if name in READING:
            return replace(self, reading=replace(self.reading, **{name: value}))
        if name in JOINING:
            return replace(self, **{name: value}, reference=self.reference or replace(self, reference=None))
        raise InputError(f"{name} is not an option of reading or joining")


def _stream(file: LogFile, bare: bool) -> LogStream:
    way = file.reading
    return LogStream(file.path, way.mapping, bare, frame=way.frame, noise=way.noise, drop=way.drop)


def remedies(advice: str | Remedy | None) -> list[Option]:
    """Return the options of a remedy that the studio can apply, each once.

    Parameters
    ----------
    advice : str, Remedy or None
        The remedy of a fault of the data, or of an error.
    """
    options = advice.options if isinstance(advice, Remedy) else ()
    found: list[Option] = []
    for option in options:
        if option[0] in (*READING, *JOINING) and option not in found:
            found.append(option)
    return found


def option_words(option: Option) -> str:
    """Return an option in few words, for a button.

    Parameters
    ----------
    option : Option
        Keyword argument with its value.
    """
    name, value = option
    if isinstance(value, Mapping):
        return f"Read {listed(list(_sources(value)))}"
    words = {
        "frame": f"Read in frame {value}",
        "lag": f"Shift the reference by {value} s",
        "drop": f"Leave out {value}",
    }
    return words.get(name, f"Apply {name} = {value}")


def _sources(mapping: Mapping[str, str]) -> Iterator[str]:
    """Word where a mapping takes each sensor from, and in which unit; columns of a part of a sensor stand alone."""
    left = dict(mapping)
    for sensor, name in SENSOR_NAMES.items():
        parts = [bracket(left[column]) for column in GROUPS[sensor] if column in left]
        if len(parts) == len(GROUPS[sensor]) and len({unit for _, unit in parts}) == 1:
            yield f"the {name} from {' '.join(column for column, _ in parts)}{_in_unit(parts[0][1])}"
            left = {target: source for target, source in left.items() if target not in GROUPS[sensor]}
    for target, source in left.items():
        column, unit = bracket(source)
        yield f"{target} from {column}{_in_unit(unit)}"


def _in_unit(unit: str) -> str:
    return f" in {unit}" if unit else ""


@dataclass(frozen=True)
class Arrival:
    """A file that was brought, and what was recognised in it.

    Attributes
    ----------
    file : LogFile
        The file.
    rows : int
        Its rows.
    duration : float
        From the first to the last row, s.
    sensors : tuple of str
        ``acc``, ``gyr`` and ``mag``, as far as they are there.
    reference : bool
        Whether it has a reference attitude, an angle or labelled poses.
    notes : tuple of str
        Notes of reading: faults that it noticed, and columns that it changed.
    """

    file: LogFile
    rows: int
    duration: float
    sensors: tuple[str, ...]
    reference: bool
    notes: tuple[str, ...]

    @property
    def words(self) -> str:
        """The contents in a line."""
        parts = [f"{self.rows} rows over {self.duration:.1f} s", *(SENSOR_NAMES[name] for name in self.sensors)]
        return ", ".join([*parts, "reference" if self.reference else "no reference"])


def arrived(file: LogFile) -> Arrival:
    """Recognise a file: a log, or a reference alone.

    Parameters
    ----------
    file : LogFile
        The file.

    Raises
    ------
    InputError
        It is neither.
    """
    try:
        log: LogSource = file.open()
        found = contents(log)
    except InputError as error:
        try:
            found = contents(_stream(file, bare=True))
        except InputError:
            raise error from None
        if "ref_q" in found.missing:
            raise
    names = {column.name for column in found.columns if column.samples}
    sensors = tuple(name for name in SENSOR_NAMES if name not in found.missing)
    reference = "ref_q" not in found.missing or "pose" not in found.missing or "ref_angle" in names
    return Arrival(file, found.n, found.duration, sensors, reference, found.notes)


class Way(Enum):
    """Ways to use files that were brought together."""

    OPEN = "open"
    TOGETHER = "together"
    JOIN = "join"


@dataclass(frozen=True)
class Offer:
    """One use of files that were brought.

    Attributes
    ----------
    way : Way
        The use.
    files : tuple of LogFile
        The logs that result.
    words : str
        The offer in a sentence.
    """

    way: Way
    files: tuple[LogFile, ...]
    words: str


def join_of(log: LogFile, reference: LogFile) -> Offer:
    """Offer to join a reference to a log.

    Parameters
    ----------
    log, reference : LogFile
        The files.
    """
    return Offer(Way.JOIN, (log.joined(reference),), f"Join the reference of {reference.name} to {log.name}")


def offers(arrivals: Sequence[Arrival]) -> list[Offer]:
    """List the uses of files that were brought, the likeliest first.

    Parameters
    ----------
    arrivals : sequence of Arrival
        The files.
    """
    found: list[Offer] = []
    with_sensors = [item for item in arrivals if item.sensors]
    if len(arrivals) == 2 and with_sensors:
        pairs = [(a, b) for a in with_sensors for b in arrivals if b is not a and b.reference]
        # A log that has a reference of its own hardly needs another one.
        pairs.sort(key=lambda pair: (pair[0].reference, bool(pair[1].sensors)))
        found += [join_of(a.file, b.file) for a, b in pairs]
    if len(with_sensors) > 1:
        together = Offer(
            Way.TOGETHER, tuple(item.file for item in with_sensors), "Open all of them as logs of one sensor"
        )
        found.insert(0 if all(item.reference for item in with_sensors) else len(found), together)
    alone = " alone" if len(arrivals) > 1 else ""
    found += [Offer(Way.OPEN, (item.file,), f"Open {item.file.name}{alone}") for item in with_sensors]
    return found


def reading_options(reading: Reading) -> dict[str, Any]:
    """Return the options of reading that say anything, as keyword arguments.

    Parameters
    ----------
    reading : Reading
        The options.
    """
    given: dict[str, Any] = {
        "mapping": dict(reading.mapping or {}),
        "frame": reading.frame,
        "noise": dict(reading.noise),
        "drop": list(reading.drop),
    }
    return {name: value for name, value in given.items() if value}
