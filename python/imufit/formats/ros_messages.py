"""Messages of ROS 1 and ROS 2, decoded by rosbags by the definitions that their file carries, as rows of numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from imufit.formats.guard import library
from imufit.formats.limits import COLUMNS, LIST
from imufit.formats.rows import Rows

LARGEST_MESSAGE: Final = 65_536
"""Bytes of a message; longer ones are images, scans and maps, not rows of numbers (an `Imu` has about 330)."""
_DEFINITION: Final = 500_000
"""Characters of a definition; a message with 50 others inside has about 30 000."""
_TYPES: Final = 300
"""Definitions of a file; a robot of many parts records some 100, and each takes about 10 ms to prepare."""
_DEPTH: Final = 12
"""Levels of messages within messages; the deepest of the standard packages have 6."""
_STAMPS: Final = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})
_TRANSFORMS: Final = frozenset({"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"})
_LEFT_OUT: Final = "covariance"
"""Part of the name of fields that say how good a value is; they are constants of the driver."""


class Messages:
    """Decodes messages into the rows of tables, a table a topic.

    Parameters
    ----------
    path : Path
        The file, for messages to the user.
    extra : str
        The optional dependency that installs the library.
    form : str
        The format in words.
    """

    def __init__(self, path: Path, extra: str, form: str) -> None:
        self._typesys = library("rosbags.typesys", extra, path, form)
        self.rows = Rows(path)
        self._stores: dict[tuple[str, str], Any] = {}
        self.undecoded: dict[str, int] = {}
        """Messages by topic that could not be decoded, or are too long for a row."""

    def add(self, topic: str, kind: str, definition: str, language: str, raw: bytes, ros1: bool, time_ns: int) -> None:
        """Decode one message into a row.

        Parameters
        ----------
        topic : str
            Names the table.
        kind : str
            Type of the message, ``sensor_msgs/msg/Imu`` or, as ROS 1 has it, ``sensor_msgs/Imu``.
        definition : str
            Its definition with those of all inner types; empty for the definitions of the library.
        language : str
            ``msg`` or ``idl``.
        raw : bytes
            The message.
        ros1 : bool
            In the serialisation of ROS 1 instead of CDR.
        time_ns : int
            When it was recorded, ns.
        """
        if len(raw) > LARGEST_MESSAGE:
            self.undecoded[topic] = self.undecoded.get(topic, 0) + 1
            return
        try:
            kind = _long_name(kind)
            store = self._store(kind, definition, language)
            message = (store.deserialize_ros1 if ros1 else store.deserialize_cdr)(raw, kind)
        except MemoryError:
            raise
        except Exception:  # whatever generated code runs into on bytes that do not fit its definition
            self.undecoded[topic] = self.undecoded.get(topic, 0) + 1
            return
        if kind in _TRANSFORMS:
            for transform in message.transforms:
                self._append(f"{topic}/{transform.child_frame_id}", transform, store, time_ns)
        else:
            self._append(topic, message, store, time_ns)

    def notes(self) -> list[str]:
        """Return what was left out, in sentences."""
        notes = list(self.rows.notes())
        if self.undecoded:
            topics = list(self.undecoded)
            shown = ", ".join(topics[:5]) + ("" if len(topics) <= 5 else f" and {len(topics) - 5} more")
            notes.append(
                f"{sum(self.undecoded.values())} messages were left out, because they are not rows of numbers or "
                f"cannot be decoded: topics {shown}."
            )
        return notes

    def _store(self, kind: str, definition: str, language: str) -> Any:
        key = (kind, definition)
        if key not in self._stores and len(self._stores) < _TYPES:
            self._stores[key] = None  # a definition that cannot be read is tried once
            self._stores[key] = self._made(kind, definition, language)
        if self._stores.get(key) is None:
            raise ValueError("the definition cannot be read")
        return self._stores[key]

    def _made(self, kind: str, definition: str, language: str) -> Any:
        typesys = self._typesys
        if not definition:
            return typesys.get_typestore(typesys.Stores.LATEST)
        if len(definition) > _DEFINITION:
            return None
        types: dict[str, Any] = {}
        if language == "msg":
            types.update(typesys.get_types_from_msg(definition, kind))
        else:
            # several files of IDL in one text stand behind lines such as "IDL: sensor_msgs/msg/Imu"
            for part in definition.split("=" * 80 + "\n"):
                types.update(typesys.get_types_from_idl(part.partition("\n")[2] if part.startswith("IDL: ") else part))
        if _may_loop(types):
            return None
        store = typesys.get_typestore(typesys.Stores.EMPTY)
        store.register(types)
        return store

    def _append(self, table: str, message: Any, store: Any, time_ns: int) -> None:
        values: dict[str, Any] = {}
        header = getattr(message, "header", None)
        stamp = getattr(header, "stamp", None)
        time = _seconds(stamp) if stamp is not None else 0.0
        self._flatten(message, "", values, 0)
        self.rows.append(table, values, time if time else time_ns * 1e-9)

    def _flatten(self, message: Any, prefix: str, values: dict[str, Any], depth: int) -> None:
        for field in type(message).__dataclass_fields__:
            if field == "__msgtype__" or (field == "header" and not prefix) or _LEFT_OUT in field:
                continue
            self._field(getattr(message, field), f"{prefix}.{field}" if prefix else field, values, depth)

    def _field(self, value: Any, name: str, values: dict[str, Any], depth: int) -> None:
        if type(value) in (float, int):  # nearly all fields: an hour of messages has tens of millions
            values[name] = float(value)
            return
        kind = getattr(value, "__msgtype__", None)
        if kind in _STAMPS:
            values[name] = _seconds(value)
        elif kind is None:
            values.update(self.rows.flat(value, name) if not _messages(value) else self._members(value, name, depth))
        elif depth < _DEPTH and len(values) < COLUMNS:
            self._flatten(value, name, values, depth + 1)
        else:
            self.rows.left_out[name] = None

    def _members(self, members: list[Any], name: str, depth: int) -> dict[str, Any]:
        values: dict[str, Any] = {}
        if len(members) > LIST or depth >= _DEPTH:
            self.rows.left_out[name] = None
        else:
            for index, member in enumerate(members):
                self._field(member, f"{name}[{index}]", values, depth + 1)
        return values


def _may_loop(types: dict[str, Any]) -> bool:
    """Return whether a definition has lists whose members take no bytes: the message then bounds no list's length."""
    empty: set[str] = set()
    for _ in range(_DEPTH):
        empty |= {
            name
            for name, (_, fields) in types.items()
            if all(kind.name == "NAME" and of in empty for _, (kind, of) in fields)
        }
    return any(
        kind.name in ("ARRAY", "SEQUENCE") and of[0][0].name == "NAME" and of[0][1] in empty
        for _, fields in types.values()
        for _, (kind, of) in fields
    )


def _messages(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and hasattr(value[0], "__msgtype__")


def _seconds(stamp: Any) -> float:
    nanoseconds = getattr(stamp, "nanosec", None)
    return float(stamp.sec) + 1e-9 * float(nanoseconds if nanoseconds is not None else 0)


def _long_name(kind: str) -> str:
    package, _, name = kind.partition("/")
    return kind if "/msg/" in kind or not name else f"{package}/msg/{name}"
