"""MATLAB's files (``.mat``): up to version 7.2 read by scipy, 7.3 by h5py."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Final

import numpy as np

from imufit.errors import InputError
from imufit.formats import hdf5
from imufit.formats.arrays import Named, tables_of
from imufit.formats.limits import WHOLE, check_size, check_values
from imufit.formats.matlab_elements import HEADER, check_elements
from imufit.formats.recording import Recording

FORM: Final = "MATLAB file"
_MAGIC: Final = b"MATLAB 5.0 MAT-file"
_DEPTH: Final = 16
"""Levels of structs within structs; those that a motion capture system writes have 4."""
_LIST: Final = 64
"""Members of an array of structs that are read one by one."""


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins with MATLAB's text, or names its version where the text is another."""
    return head.startswith((_MAGIC, b"MATLAB 7.3 MAT-file")) or (
        # the first 116 bytes are free text; behind them stand version 1.0 and the order of bytes
        len(head) >= HEADER and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI") and b"\0" not in head[:16]
    )


def read(path: Path) -> Recording:
    """Read a file of any version."""
    with path.open("rb") as file:
        head = file.read(1024)
    if hdf5.MAGIC in head:
        return hdf5.read_matlab(path, FORM)
    import scipy.io  # noqa: PLC0415 - costs a tenth of a second that other commands do not need

    check_size(path, WHOLE)
    data = path.read_bytes()
    check_elements(path, data)
    source: Any = io.BytesIO(data)  # scipy reads open files as well, which its types do not say
    declared = scipy.io.whosmat(source)
    check_values(path, sum(int(np.prod([max(int(k), 1) for k in shape], dtype=float)) for _, shape, _ in declared))
    content = scipy.io.loadmat(source, simplify_cells=True, verify_compressed_data_integrity=True)
    named = Named(".")
    opaque = False
    for name, value in content.items():
        if name.startswith("__"):
            opaque = opaque or name == "__function_workspace__"
            continue
        _add(named, name, value, 0)
    tables, notes = tables_of(path, named)
    if not tables and opaque:
        raise InputError(
            "the file holds only objects of MATLAB, such as a table or a timetable",
            file=path,
            remedy="Save T.Variables or table2struct(T, 'ToScalar', true) instead, or export with writetable(T, FILE).",
        )
    return Recording(FORM, tables, notes)


def _add(named: Named, name: str, value: Any, depth: int) -> None:
    if depth > _DEPTH:
        named.left_out.append(name)
    elif isinstance(value, dict):
        for key, member in value.items():
            _add(named, f"{name}.{key}", member, depth + 1)
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        members = value if isinstance(value, list) else list(value.reshape(-1))
        if members and all(isinstance(member, str) for member in members):
            named.add(name, np.array(members, dtype=object))
        elif len(members) <= _LIST:
            for index, member in enumerate(members):
                _add(named, f"{name}[{index}]", member, depth + 1)
        else:
            named.left_out.append(name)
    elif isinstance(value, str | np.ndarray | np.generic | bool | int | float):
        named.add(name, value)
    else:
        named.left_out.append(name)
