"""What a crash left of a recording becomes a log."""

from __future__ import annotations

import re
from pathlib import Path

from imufit.errors import InputError
from imufit.record.finish import check_target
from imufit.record.part import part_path, parts_of
from imufit.record.recorder import converted
from imufit.results import Recording


def recover(file: str | Path, log: str | Path | None = None, *, force: bool = False, keep: bool = False) -> Recording:
    """Make the log of what a recording left that was killed or ran out of disk.

    Every whole batch is saved; what was cut off behind the last one is left out, and said.

    Parameters
    ----------
    file : str or Path
        The part, ``walk.parquet.part``, or the log that was to be, ``walk.parquet``.
    log : str or Path, optional
        Log to write; without it the one that was to be.
    force : bool
        Whether an existing log may be overwritten.
    keep : bool
        Whether the parts stay. Otherwise they are deleted once the log is on the disk and was read again.

    Returns
    -------
    Recording
        What was saved.

    Raises
    ------
    InputError
        There is no part, nothing whole is in it, a recording is still writing it, or the log cannot be written.
    """
    file = Path(file)
    found = re.fullmatch(r"(.+)\.part\d*", file.name)
    wanted = file.with_name(found[1]) if found else file
    parts = parts_of(wanted)
    if not parts:
        raise InputError(
            f"there is no {part_path(wanted)}", file=file, remedy="Name the .part file that the recording left."
        )
    target = wanted if log is None else Path(log)
    check_target(target, force)
    return converted(parts, target, keep=keep)
