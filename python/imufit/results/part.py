"""How a part of a result shows itself: its fields in one line, and as a table in a notebook."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from imufit.printable import NAME, printable
from imufit.remedy import Remedy
from imufit.results.result import LONGEST, Result, shortened
from imufit.results.table import Table

_FEW: Final = 4
"""Items of a field that are shown one by one; 3 axes and 4 numbers of a quaternion are."""


class Part:
    """A frozen dataclass that stands in a result; arrays are counted and not printed."""

    def _repr_html_(self) -> str:
        rows = tuple((name.replace("_", " "), _shown(value)) for name, value in self._fields())
        return Table(type(self).__name__, ("field", "value"), rows).html()

    def __repr__(self) -> str:
        told = ", ".join(f"{name}={_shown(value, quoted=True)}" for name, value in self._fields())
        return f"{shortened(f'{type(self).__name__}({told}', LONGEST)})"

    def _fields(self) -> list[tuple[str, Any]]:
        assert dataclasses.is_dataclass(self)
        return [(field.name, getattr(self, field.name)) for field in dataclasses.fields(self)]


def _shown(value: Any, quoted: bool = False) -> str:  # noqa: PLR0911  one for each kind of value
    """Write a field in few characters."""
    match value:
        case str():
            return repr(printable(value, LONGEST)) if quoted else printable(value, LONGEST)
        case float() | np.floating():
            return f"{value:.6g}"
        case None | int() | np.bool_() | np.integer():
            return str(value)
        case Remedy():
            return _shown(str(value), quoted)
        case Part() | Result():
            return repr(value)
        case np.ndarray():
            return _items(value.ravel().tolist(), "values", quoted)
        case Mapping() | Sequence():
            return _items(value, "items", quoted)
    return f"<{type(value).__name__}>"


def _items(items: Mapping[Any, Any] | Sequence[Any], word: str, quoted: bool) -> str:
    """Write few items one by one, of more their number."""
    if len(items) > _FEW:
        return f"<{len(items)} {word}>"
    if isinstance(items, Mapping):
        return f"{{{', '.join(f'{printable(str(key), NAME)}: {_shown(items[key], quoted)}' for key in items)}}}"
    return f"[{', '.join(_shown(item, quoted) for item in items)}]"
