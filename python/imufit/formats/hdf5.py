"""HDF5 (``.h5``, ``.hdf5``), and MATLAB's version 7.3 built on it, read by h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from imufit.errors import InputError
from imufit.formats.arrays import Named, tables_of
from imufit.formats.guard import library
from imufit.formats.limits import STREAMED, VALUES, check_size, check_values
from imufit.formats.recording import Recording

FORM: Final = "HDF5 file"
MAGIC: Final = b"\x89HDF\r\n\x1a\n"
_OBJECTS: Final = 10_000
"""Groups and datasets of a file; one of a study with 100 sensors of 20 signals has 2 000."""
_DEPTH: Final = 16
"""Groups within groups; a group can contain itself."""


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as HDF5 does, or has as much in front as the format allows."""
    return any(head[at : at + len(MAGIC)] == MAGIC for at in (0, 512, 1024, 2048))


def read(path: Path) -> Recording:
    """Read all datasets of a file."""
    return _read(path, FORM, "/", False)


def read_matlab(path: Path, form: str) -> Recording:
    """Read all variables of a MATLAB file of version 7.3, with the axes in MATLAB's order."""
    return _read(path, form, ".", True)


def _read(path: Path, form: str, separator: str, matlab: bool) -> Recording:
    h5py = library("h5py", "hdf5", path, form)
    check_size(path, STREAMED)
    named = Named(separator)
    walk = _Walk(path, h5py, named, matlab)
    with h5py.File(path, "r") as file:
        walk.group(file, "", 0)
    tables, notes = tables_of(path, named)
    if walk.damaged:
        shown = ", ".join(walk.damaged[:5])
        notes = (*notes, f"{len(walk.damaged)} datasets are damaged and were left out: {shown}.")
    return Recording(form, tables, notes)


class _Walk:
    def __init__(self, path: Path, h5py: Any, named: Named, matlab: bool) -> None:
        self._path = path
        self._h5py = h5py
        self._named = named
        self._matlab = matlab
        self._values = 0
        self._objects = 0
        self.damaged: list[str] = []

    def group(self, group: Any, prefix: str, depth: int) -> None:
        self._attributes(group, prefix)
        for key in group:
            self._objects += 1
            name = f"{prefix}{self._named.separator}{key}" if prefix else str(key)
            # links lead to places of this file that are met anyway, or to other files, which are none of ours
            if self._objects > _OBJECTS or not isinstance(group.get(key, getlink=True), self._h5py.HardLink):
                self._named.left_out.append(name)
                if self._objects > _OBJECTS:
                    return
                continue
            member = group[key]
            if isinstance(member, self._h5py.Dataset):
                try:
                    self._dataset(member, name)
                except InputError:
                    raise
                except Exception:  # a filter that fails on damaged bytes raises what it happens to run into
                    self.damaged.append(name)
            elif depth < _DEPTH and not str(key).startswith("#"):
                self.group(member, name, depth + 1)

    def _attributes(self, owner: Any, prefix: str) -> None:
        if self._matlab:
            return
        for key in owner.attrs:
            try:
                value = np.asarray(owner.attrs[key])
            except Exception:  # an attribute of a type that the library cannot read is not what the file is read for
                continue
            if value.size == 1 and value.dtype.kind in "biuf":
                name = f"{prefix}{self._named.separator}{key}" if prefix else str(key)
                self._named.settings[name] = float(value.reshape(-1)[0])

    def _dataset(self, dataset: Any, name: str) -> None:
        # raw data in other files, and views of other files, are none of this file's
        if dataset.shape is None or dataset.external or dataset.is_virtual:
            self._named.left_out.append(name)
            return
        kind = dataset.dtype.kind
        compound = dataset.dtype.names or ()
        self._values += min(int(dataset.size), VALUES + 1) * max(len(compound), 1)
        check_values(self._path, self._values)
        self._attributes(dataset, name)
        if self._matlab:
            decoded = dataset.attrs.get("MATLAB_class", b"")
            if decoded in (b"char", b"cell", "char", "cell") or "MATLAB_empty" in dataset.attrs:
                return
        if compound and len(dataset.shape) == 1:
            table = dataset[()]
            for field in compound:
                self._named.add(f"{name}{self._named.separator}{field}", table[field])
        elif kind in "biufS" and dataset.dtype.itemsize <= 128:
            values = dataset[()]
            self._named.add(name, values.T if self._matlab else values)
        elif self._h5py.check_string_dtype(dataset.dtype) is not None and len(dataset.shape) == 1:
            self._named.add(name, np.array(dataset.asstr(errors="replace")[()], dtype=object))
        elif dataset.size:
            self._named.left_out.append(name)
