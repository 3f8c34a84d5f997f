"""The metadata of a log: frame, gravity, field, rig axis, noise."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal, cast

import tomli_w

from imufit.errors import InputError
from imufit.log.columns import GROUPS, LARGEST
from imufit.log.documents import table_from_json, table_from_toml
from imufit.printable import NAME, printable

Frame = Literal["NED", "ENU", "NWU"]
FRAMES: Final = ("NED", "ENU", "NWU")
AXES: Final = ("x", "y", "z")
STANDARD_GRAVITY: Final = 9.80665
SMALLEST_GRAVITY: Final = 1e-3
"""m/s^2; the moons of Mars have 3e-3. A smaller value is a slip, and a division by it has no meaning."""

ALIKE: Final = 0.8
"""Share of letters in common (difflib) from which a name is a slip for another: one letter of five lost has 0.89, two
letters exchanged 0.8; `source` and `sensor` have 0.5."""

SMALLEST_NOISE: Final = 1e-18
"""Smallest standard deviation that can be stated, m/s^2, rad/s or uT: a thousandth of that of the free-falling test
masses of LISA Pathfinder (2e-15 m/s^2). The fourth power of the largest reading over it has room in a float64."""


@dataclass(frozen=True)
class Metadata:
    """Metadata of a log.

    Parameters
    ----------
    frame : {"NED", "ENU", "NWU"}
        Reference frame of attitude, position and field.
    gravity : float
        Magnitude of gravity, m/s^2.
    mag_reference : tuple of 3 floats, optional
        Earth's field in the reference frame, uT.
    rig_axis : {"x", "y", "z"}, optional
        Body axis about which a one-axis rig turns.
    sensor : str, optional
        Free text.
    noise : dict
        White noise standard deviation for "acc" (m/s^2), "gyr" (rad/s), "mag" (uT).
    acc_range, gyr_range : float, optional
        End of the sensor's range, m/s^2 and rad/s.
    extra : dict
        Everything else that stood there; kept when the log is written.
    """

    frame: Frame = "NED"
    gravity: float = STANDARD_GRAVITY
    mag_reference: tuple[float, float, float] | None = None
    rig_axis: Literal["x", "y", "z"] | None = None
    sensor: str | None = None
    noise: dict[str, float] = field(default_factory=dict)
    acc_range: float | None = None
    gyr_range: float | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any], file: str | Path | None = None) -> Metadata:
        """Check the values and make metadata of them.

        Parameters
        ----------
        values : mapping
            Keys as in the file; None counts as absent, unknown keys go to `extra` unless they look like a known one.
        file : str or Path, optional
            File to name in errors.

        Raises
        ------
        InputError
            A value cannot be; the key is named.
        """
        known: dict[str, Any] = {}
        extra: dict[str, Any] = {}
        for key, value in values.items():
            if key == "extra" and isinstance(value, Mapping):
                extra.update(value)
            elif key not in KNOWN:
                _check_unknown(str(key), values, file)
                extra[key] = value
            elif value is not None:
                known[key] = _CHECKS[key](value, file)
        return cls(**known, extra=extra)

    def to_mapping(self) -> dict[str, Any]:
        """Values as plain numbers, text, lists and dicts, without what is absent."""
        values: dict[str, Any] = dict(self.extra)
        values |= {"frame": self.frame, "gravity": self.gravity}
        if self.mag_reference is not None:
            values["mag_reference"] = list(self.mag_reference)
        if self.rig_axis is not None:
            values["rig_axis"] = self.rig_axis
        if self.sensor is not None:
            values["sensor"] = self.sensor
        if self.noise:
            values["noise"] = dict(self.noise)
        return values | {f"{sensor}_range": end for sensor, end in self.ranges.items()}

    @property
    def ranges(self) -> dict[str, float]:
        """End of the range of each sensor of which it is known, "acc" in m/s^2, "gyr" in rad/s."""
        ends = {"acc": self.acc_range, "gyr": self.gyr_range}
        return {sensor: end for sensor, end in ends.items() if end is not None}

    def to_json(self) -> str:
        """Text for the Parquet schema."""
        return json.dumps(self.to_mapping())


def mapping_from_json(text: str | bytes, file: Path) -> dict[str, Any]:
    """Read metadata that is kept as JSON inside a log file."""
    return table_from_json(text, file, "imufit")


def sidecar_path(path: Path) -> Path:
    """Place of the sidecar of a log: the same name with the suffix ``.toml``."""
    # A folder may be given as "." or "/", which are without a name.
    named = path if path.name else path.resolve()
    return named.with_suffix(".toml") if named.name else named / "log.toml"


def read_sidecar(path: Path) -> dict[str, Any]:
    """Read the sidecar of the log at `path`; empty when there is none."""
    sidecar = sidecar_path(path)
    if not sidecar.is_file():
        return {}
    return table_from_toml(sidecar, "Correct it or move it away.")


def read_metadata(path: Path, embedded: Mapping[str, Any]) -> Metadata:
    """Metadata of the log at `path`: its own, key by key overruled by the sidecar."""
    sidecar = read_sidecar(path)
    if sidecar:
        Metadata.from_mapping(sidecar, sidecar_path(path))
    return Metadata.from_mapping({**embedded, **sidecar}, path)


def check_sidecar(path: Path) -> None:
    """Refuse to write the sidecar of the log at `path` over another kind of TOML file."""
    older = read_sidecar(path)
    if older and not KNOWN & older.keys():
        raise InputError(
            "this file is in the way: it does not hold log metadata, but the log's metadata would be written there",
            file=sidecar_path(path),
            remedy="Write the log under another name.",
        )


def sidecar_text(metadata: Metadata) -> str:
    """Metadata as they stand in a sidecar."""
    return tomli_w.dumps(_without_none(metadata.to_mapping()))


def _without_none(value: Any) -> Any:
    """Drop what TOML cannot hold."""
    if isinstance(value, dict):
        return {str(key): _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_without_none(item) for item in value if item is not None]
    return value


def _number(value: Any) -> float | None:
    """Return a finite number, or None when it is something else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _shown(value: Any) -> str:
    """Return the value as it is to stand in a message."""
    # Python writes no integer of more than 4300 digits.
    return f"an integer of {value.bit_length()} bits" if _is_huge(value) else printable(repr(value), NAME)


def _is_huge(value: Any) -> bool:
    return isinstance(value, int) and value.bit_length() > 64


def _check_unknown(key: str, values: Mapping[str, Any], file: str | Path | None) -> None:
    """Refuse a key that looks like a slip for a known one, which would be ignored without a word."""
    close = difflib.get_close_matches(key.lower(), KNOWN - values.keys(), n=1, cutoff=ALIKE)
    if close:
        raise InputError(
            f"metadata have no key {printable(key, NAME)}",
            file=file,
            column=key,
            remedy=f"Did you mean {close[0]}? If not, put the key into the table extra.",
        )


def _frame(value: Any, file: str | Path | None) -> Frame:
    if value not in FRAMES:
        raise InputError(
            f"metadata frame is {_shown(value)}, which is not a frame",
            file=file,
            column="frame",
            remedy="Write NED, ENU or NWU.",
        )
    return cast(Frame, value)


def _gravity(value: Any, file: str | Path | None) -> float:
    number = _number(value)
    if number is None or not SMALLEST_GRAVITY <= number <= 30.0:
        raise InputError(
            f"metadata gravity is {_shown(value)}, which is not a gravity in m/s²",
            file=file,
            column="gravity",
            remedy=f"Write a number such as {STANDARD_GRAVITY}.",
        )
    return number


def _mag_reference(value: Any, file: str | Path | None) -> tuple[float, ...]:
    items = value.tolist() if hasattr(value, "tolist") else value
    numbers = [_number(item) for item in items] if isinstance(items, list | tuple) else []
    if len(numbers) != 3 or not all(number is not None and abs(number) <= LARGEST["mag_x"] for number in numbers):
        raise InputError(
            f"metadata mag_reference is {_shown(value)}, not three numbers",
            file=file,
            column="mag_reference",
            remedy="Write [x, y, z] in uT, in the reference frame.",
        )
    return tuple(cast(list[float], numbers))


def _rig_axis(value: Any, file: str | Path | None) -> str:
    if value not in AXES:
        raise InputError(
            f"metadata rig_axis is {_shown(value)}, which is not a body axis",
            file=file,
            column="rig_axis",
            remedy='Write "x", "y" or "z".',
        )
    return str(value)


def _sensor(value: Any, file: str | Path | None) -> str:
    if not isinstance(value, str):
        raise InputError(
            f"metadata sensor is {_shown(value)}, not text", file=file, column="sensor", remedy="Put it in quotes."
        )
    return value


def _noise(value: Any, file: str | Path | None) -> dict[str, float]:
    remedy = "Write a table such as {acc = 0.02, gyr = 0.001, mag = 0.5}, in m/s^2, rad/s and uT."
    if not isinstance(value, Mapping):
        raise InputError(f"metadata noise is {_shown(value)}, not a table", file=file, column="noise", remedy=remedy)
    for sensor, deviation in value.items():
        if sensor not in ("acc", "gyr", "mag"):
            raise InputError(
                f"metadata noise names the sensor {_shown(sensor)}", file=file, column="noise", remedy=remedy
            )
        number = _number(deviation)
        possible = number is not None and SMALLEST_NOISE <= number <= LARGEST[GROUPS[sensor][0]]
        if not possible and number != 0.0:
            raise InputError(
                f"metadata noise.{sensor} is {_shown(deviation)}; no sensor has such a standard deviation",
                file=file,
                column="noise",
                remedy=remedy,
            )
    return {str(sensor): float(deviation) for sensor, deviation in value.items()}


def _range(sensor: str, unit: str, value: Any, file: str | Path | None) -> float:
    number = _number(value)
    if number is None or not 0.0 < number <= LARGEST[GROUPS[sensor][0]]:
        raise InputError(
            f"metadata {sensor}_range is {_shown(value)}, which is not the end of a range",
            file=file,
            column=f"{sensor}_range",
            remedy=f"Write a positive number in {unit}, or leave it out.",
        )
    return number


_CHECKS: Final[dict[str, Callable[[Any, str | Path | None], Any]]] = {
    "frame": _frame,
    "gravity": _gravity,
    "mag_reference": _mag_reference,
    "rig_axis": _rig_axis,
    "sensor": _sensor,
    "noise": _noise,
    "acc_range": partial(_range, "acc", "m/s^2"),
    "gyr_range": partial(_range, "gyr", "rad/s"),
}
KNOWN: Final = frozenset(item.name for item in fields(Metadata)) - {"extra"}
