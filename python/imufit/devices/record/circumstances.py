"""Port, start, mapping, frame and rig of a recording, as they stand at the beginning of its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final, Self

from imufit.devices.record.rig import AXES
from imufit.log.metadata import FRAMES

MOST: Final = 1e10
"""Largest time on the monotonic clock, s: a computer that runs for three centuries."""


@dataclass(frozen=True)
class Circumstances:
    """All that has to be known to make a log of a recording's rows, besides the rows and the announcement.

    Attributes
    ----------
    port : str
        Where the device was plugged in.
    utc : str
        When the recording began, ISO 8601 with its offset from UTC.
    monotonic : float
        The same moment on the clock of `time.monotonic`, s.
    mapping : dict of str to str or None
        Columns of the log from those of the device.
    frame : {"NED", "ENU", "NWU"}
        Navigation frame of the log.
    rig_axis : {"x", "y", "z"} or None
        Body axis about which a rig turns; None without one.
    rig_angle : float or None
        Commanded angle at the beginning, rad; None while the rig moves.
    began : datetime
        `utc` as a moment.

    Raises
    ------
    ValueError
        A value is of another kind or out of range.
    """

    port: str
    utc: str
    monotonic: float
    mapping: Mapping[str, str] | None = None
    frame: str = FRAMES[0]
    rig_axis: str | None = None
    rig_angle: float | None = None
    began: datetime = field(init=False, compare=False)

    def __post_init__(self) -> None:
        mapping = {} if self.mapping is None else self.mapping
        if not isinstance(mapping, Mapping):
            raise ValueError("this is not a mapping of columns")
        texts = [self.port, self.utc, *mapping, *mapping.values()]
        numbers = [self.monotonic, 0.0 if self.rig_angle is None else self.rig_angle]
        sound = (
            all(isinstance(text, str) for text in texts)
            and all(isinstance(number, int | float) and abs(number) <= MOST for number in numbers)
            and self.frame in FRAMES
            and self.rig_axis in (None, *AXES)
        )
        began = datetime.fromisoformat(self.utc) if sound else None
        if began is None or began.tzinfo is None:
            raise ValueError("these are not the circumstances of a recording")
        object.__setattr__(self, "began", began)

    def to_json(self) -> dict[str, Any]:
        """Plain values, as `from_json` takes them."""
        plain = {name: getattr(self, name) for name in ("port", "utc", "monotonic", "mapping", "frame")}
        return plain if self.rig_axis is None else {**plain, "rig": {"axis": self.rig_axis, "angle": self.rig_angle}}

    @classmethod
    def from_json(cls, plain: Any) -> Self:
        """Take plain values that were read from a file.

        Parameters
        ----------
        plain : mapping
            As `to_json` gave them.

        Raises
        ------
        ValueError
            A value is missing, unknown or of another kind.
        """
        try:
            rest = dict(plain)
            rig = {f"rig_{name}": value for name, value in rest.pop("rig", {}).items()}
            return cls(**rest, **rig)
        except (TypeError, AttributeError) as error:
            raise ValueError(str(error)) from None
