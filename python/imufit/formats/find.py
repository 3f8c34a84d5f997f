"""Which format a file is of: by its content first, by its suffix where the content does not decide."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from imufit.errors import InputError
from imufit.formats import (
    arrow_file,
    dataflash,
    excel,
    hdf5,
    json_file,
    matlab,
    mcap_file,
    numpy_file,
    pickle_file,
    px4_ulog,
    ros1_bag,
    ros2_bag,
)
from imufit.formats.guard import guarded
from imufit.formats.recording import Recording

_HEAD: Final = 4096
"""Bytes from the beginning that are looked at: HDF5 may have 2048 bytes of something else in front."""


@dataclass(frozen=True)
class Format:
    """A format of another program.

    Parameters
    ----------
    name : str
        In words.
    suffixes : tuple of str
        Of its files.
    recognises : callable
        Whether a file, by its first bytes and its path, is one.
    read : callable
        Reads a file.
    extra : str or None
        The optional dependency of imufit that reads it; None where what imufit always needs does.
    by_suffix : bool
        Whether the suffix decides if the content does not; not where others use the suffix as well.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes, Path], bool]
    read: Callable[[Path], Recording]
    extra: str | None = None
    by_suffix: bool = True


FORMATS: Final = (
    Format(px4_ulog.FORM, (".ulg", ".ulog"), px4_ulog.recognises, px4_ulog.read, "px4"),
    Format(ros1_bag.FORM, (".bag",), ros1_bag.recognises, ros1_bag.read, "ros"),
    Format(ros2_bag.FORM, (".db3",), ros2_bag.recognises, ros2_bag.read, "ros"),
    Format(mcap_file.FORM, (".mcap",), mcap_file.recognises, mcap_file.read, "mcap"),
    Format(dataflash.FORM, (".bin",), dataflash.recognises, dataflash.read, "ardupilot", by_suffix=False),
    Format(matlab.FORM, (".mat",), matlab.recognises, matlab.read),
    Format(hdf5.FORM, (".h5", ".hdf5", ".hdf"), hdf5.recognises, hdf5.read, "hdf5"),
    Format(excel.FORM, (".xlsx", ".xlsm"), excel.recognises, excel.read, "excel"),
    Format(arrow_file.FORM, (".feather", ".arrow", ".ipc"), arrow_file.recognises, arrow_file.read),
    Format(numpy_file.FORM, (".npy",), numpy_file.recognises, numpy_file.read),
    Format(json_file.FORM, (".json", ".jsonl", ".ndjson"), json_file.recognises, json_file.read),
    Format(pickle_file.FORM, (".pkl", ".pickle"), pickle_file.recognises, pickle_file.read),
)
"""All formats, in the order in which their beginnings are looked for."""

SUFFIXES: Final = tuple(suffix for form in FORMATS for suffix in form.suffixes)
"""Suffixes of all formats, with the dot."""


def format_of(path: Path) -> Format | None:
    """Return the format of a file or of the folder of a ROS 2 bag, None where it is of none of these formats."""
    if path.is_dir():
        return next((form for form in FORMATS if form.read is ros2_bag.read and form.recognises(b"", path)), None)
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return None  # the next reader reports why it cannot be read
    for form in FORMATS:
        if form.recognises(head, path):
            return form
    suffix = path.suffix.lower()
    return next((form for form in FORMATS if form.by_suffix and suffix in form.suffixes), None)


def recording_of(path: Path) -> Recording | None:
    """Read a file of another program.

    Parameters
    ----------
    path : Path
        A file, or the folder of a ROS 2 bag.

    Returns
    -------
    Recording or None
        None where the file is of none of these formats.

    Raises
    ------
    InputError
        The file is of one of the formats, but damaged, too large, or without a table; or the library that reads the
        format is not installed.
    """
    form = format_of(path)
    if form is None:
        return None
    with guarded(path, form.name):
        found = form.read(path)
    if not found.tables:
        raise InputError(
            f"the file ({form.name}) holds no table of numbers"
            + "".join(f". {note.rstrip('.')}" for note in found.notes),
            file=path,
            remedy="Export the readings as CSV, with a row a sample.",
        )
    return found
