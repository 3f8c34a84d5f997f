"""Pickles (``.pkl``): refused."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NoReturn

from imufit.errors import InputError

FORM: Final = "Python pickle"


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as a pickle of protocol 4 or 5 does."""
    return head[:3] in (b"\x80\x04\x95", b"\x80\x05\x95")


def read(path: Path) -> NoReturn:
    """Refuse a pickle."""
    raise InputError(
        "the file is a pickle, and reading one runs whatever code its writer put in",
        file=path,
        remedy="Load it yourself where you trust it, and write a table: frame.to_parquet('log.parquet') for pandas, "
        "numpy.savez('log.npz', t=t, acc_x=...) for arrays.",
    )
