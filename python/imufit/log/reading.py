"""A user's options for a file that is read as a log: columns, frame, noise, and what to leave out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from imufit.errors import InputError
from imufit.log.columns import GROUPS, SENSORS
from imufit.log.metadata import Frame, Metadata
from imufit.log.place import Place
from imufit.log.units import conversion, parse_mapping
from imufit.log.words import nearest, sensor_of, words_of
from imufit.printable import NAME, printable

_VALUE = re.compile(r"(?P<number>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")


@dataclass(frozen=True)
class Reading:
    """How a file is to be read, where the file does not state it or states it wrongly.

    Parameters
    ----------
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    frame : {"NED", "ENU", "NWU"}, optional
        Reference frame, whatever the file states.
    noise : mapping, optional
        White noise standard deviation of one sample of "acc" (m/s^2), "gyr" (rad/s) and "mag" (uT); a sensor that is
        not named keeps what the file states.
    drop : sequence of str
        Columns to leave out: of the file, or of the log that is made of it; ``acc``, ``gyr``, ``mag``, ``ref_q`` and
        ``ref_p`` stand for all columns of that group. A text may hold several names with commas between.

    Raises
    ------
    InputError
        A frame or a noise cannot be.
    """

    mapping: Mapping[str, str] | None = None
    frame: Frame | None = None
    noise: Mapping[str, float] = field(default_factory=dict)
    drop: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        stated: dict[str, Any] = {"noise": dict(self.noise)}
        if self.frame is not None:
            stated["frame"] = self.frame
        Metadata.from_mapping(stated)

    @classmethod
    def of_texts(
        cls, mapping: Sequence[str], frame: Frame | None, noise: Sequence[str], drop: Sequence[str]
    ) -> Reading:
        """Take the options of the command line apart.

        Parameters
        ----------
        mapping, noise : sequence of str
            As for `parse_mapping` and `parse_noise`.
        frame : str or None
            Reference frame.
        drop : sequence of str
            As for `Reading`.
        """
        return cls(parse_mapping(*mapping) or None, frame, parse_noise(*noise), tuple(drop))

    def dropped(self, names: Sequence[str], targets: Iterable[str], place: Place) -> frozenset[str]:
        """Return the columns to leave out, of the file and of the log.

        Parameters
        ----------
        names : sequence of str
            Columns of the file.
        targets : iterable of str
            Columns of the log that are made of columns with other names.
        place : Place
            To name the file in errors.

        Raises
        ------
        InputError
            The column is missing, or the mapping makes it.
        """
        shown = {printable(name, NAME): name for name in names}
        known = dict.fromkeys([*shown, *targets])
        by_words: dict[str, list[str]] = {}
        for name in names:
            by_words.setdefault(_column_meant(name), []).append(name)
        found: set[str] = set()
        for text in self.drop:
            whole = text.strip() in known
            for name in [text.strip()] if whole else [part.strip() for part in text.split(",") if part.strip()]:
                wanted = (name,) if name in shown else (name, *GROUPS.get(name, ()))
                meant = {shown.get(each, each) for each in wanted if each in known}
                meant |= {column for each in wanted if each not in shown for column in by_words.get(each, ())}
                if not meant:
                    raise self._not_there(name, known, place)
                found |= meant
        for group, members in GROUPS.items():
            columns = {each: [each] if each in names else by_words.get(each, []) for each in members}
            gone = [each for each, made in columns.items() if made and found.issuperset(made)]
            stays = [each for each, made in columns.items() if made and each not in gone]
            if gone and stays:
                raise place.error(
                    f"column {gone[0]} is to be left out, but {' and '.join(stays)} stay",
                    column=gone[0],
                    remedy=f"They belong together: leave out {group}.",
                )
        for target in self.mapping or {}:
            if target in found and target not in names:
                raise place.error(
                    f"column {target} is mapped and left out at once", column=target, remedy="Choose one of them."
                )
        return frozenset(found)

    def _not_there(self, name: str, known: Mapping[str, None], place: Place) -> InputError:
        """Make the error for a column to leave out that is not there, with the nearest one that is."""
        groups = [group for group, columns in GROUPS.items() if known.keys() & set(columns)]
        near = nearest(name, [*known, *groups])
        listed = ", ".join(list(known)[:12])
        return place.error(
            f"column {printable(name, NAME)} is to be left out, but it is not in the file",
            column=name,
            remedy=f"Did you mean {near[0]}?" if near else f"The columns are {listed}.",
        )

    def metadata(self, stated: Metadata) -> Metadata:
        """Return metadata with this frame and noise in the place of those in the file.

        Parameters
        ----------
        stated : Metadata
            Of the file.
        """
        noise = {**stated.noise, **{name: float(value) for name, value in self.noise.items()}}
        return replace(stated, frame=self.frame or stated.frame, noise=noise)

    def notes(self, stated: Mapping[str, Any], place: Place) -> tuple[str, ...]:
        """Say where this contradicts the file.

        Parameters
        ----------
        stated : mapping
            Metadata as they stand in the file.
        place : Place
            To name the file.
        """
        own = stated.get("frame")
        if self.frame is None or own in (None, self.frame):
            return ()
        return (f"{place.name}: the frame is {self.frame} as asked; the file states {own}",)


def parse_noise(*texts: str) -> dict[str, float]:
    """Read noise as it is given on the command line.

    Parameters
    ----------
    *texts : str
        Each ``SENSOR=VALUE``, or several of them with commas between: ``acc=0.02,gyr=0.05[deg/s]``. Without a unit in
        brackets the value is in m/s^2, rad/s or uT.

    Returns
    -------
    dict
        Standard deviation of one sample by sensor, SI units (uT for "mag").

    Raises
    ------
    InputError
        A text is not of that form, or a unit is not one of that sensor.
    """
    noise: dict[str, float] = {}
    for part in (part for text in texts for part in text.split(",") if part.strip()):
        sensor, equals, value = (piece.strip() for piece in part.partition("="))
        found = _VALUE.fullmatch(value)
        number = _number(found["number"]) if found else None
        if not equals or found is None or number is None:
            raise InputError(
                f"the noise {printable(part.strip(), NAME)!r} does not read SENSOR=VALUE",
                remedy="Write for example acc=0.02,gyr=0.05[deg/s].",
            )
        if sensor not in SENSORS:
            near = nearest(sensor, SENSORS)
            raise InputError(
                f"the noise is of {printable(sensor, NAME)}, which is not a sensor",
                remedy=f"Did you mean {near[0]}?" if near else f"The sensors are {', '.join(SENSORS)}.",
            )
        if sensor in noise:
            raise InputError(f"the noise of {sensor} is given twice")
        try:
            factor = conversion(GROUPS[sensor][0], found["unit"] or "").factor
        except InputError as error:
            raise InputError(f"the noise of {sensor}: {error.problem}", remedy=error.advice) from None
        noise[sensor] = number * factor
    return noise


def _column_meant(name: str) -> str:
    """Column of a sensor that a column of a file is by its words, such as ``mag_x`` of ``MagX (uT)``; else empty."""
    words = words_of(name)
    named = sensor_of(words.words) if words.axis else None
    return f"{named[0]}_{words.axis}" if named is not None else ""


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
