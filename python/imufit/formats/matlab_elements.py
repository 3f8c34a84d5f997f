"""The elements of a MATLAB file, checked before scipy reads them: on kinds that it does not know, scipy crashes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from imufit.formats.limits import RATIO, UNSUSPECTED, WHOLE, check_expansion

HEADER: Final = 128
"""Bytes before the first element."""
_MATRIX: Final = 14
_PACKED: Final = 15
"""Kinds of element by MATLAB's description of the format: a variable, and one that is packed by zlib."""
_NUMBERS: Final = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18})
"""Kinds of element that hold numbers or text."""
_PLAIN: Final = frozenset(range(6, 16)) | {4}
"""Classes of variables with one array, or two where it is complex: numbers and text."""
_SPARSE: Final = 5
_COMPLEX: Final = 0x08
_DEPTH: Final = 64
"""Variables within variables."""
_STEP: Final = 1 << 20
"""Bytes unpacked at a time, so that the bound is noticed early."""


def check_elements(path: Path, data: bytes) -> None:
    """Check that the file is built as the format states, and does not unpack to more than readings can.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its content; one of version 4, which has no elements, passes.

    Raises
    ------
    ValueError
        An element is of an unknown kind, or does not end where its parent does.
    InputError
        The file would unpack to too much.
    """
    if len(data) < HEADER or data[126:128] not in (b"IM", b"MI"):
        return
    order: Literal["<", ">"] = "<" if data[126:128] == b"IM" else ">"
    at, unpacked = HEADER, 0
    while at + 8 <= len(data):
        kind, length = struct.unpack_from(order + "II", data, at)
        body = data[at + 8 : at + 8 + length]
        if len(body) < length:
            raise ValueError("the last variable is not whole")
        if kind == _PACKED:
            body = _unpacked(path, body, len(data), unpacked)
            unpacked += len(body)
            if len(body) < 8:
                raise ValueError("a packed variable is empty")
            kind, inner = struct.unpack_from(order + "II", body, 0)
            if inner > len(body) - 8:
                raise ValueError("a packed variable is not whole")
            body = body[8 : 8 + inner]
        if kind != _MATRIX:
            raise ValueError("extra bytes stand between the variables")
        _check_matrix(memoryview(body), order, 0)
        at += 8 + length


def _unpacked(path: Path, packed: bytes, size: int, before: int) -> bytes:
    unpacker = zlib.decompressobj()
    parts = []
    total = before
    most = min(WHOLE, max(UNSUSPECTED, RATIO * size))
    while packed:
        parts.append(unpacker.decompress(packed, _STEP))
        total += len(parts[-1])
        if total > most:
            check_expansion(path, size, total)
        packed = unpacker.unconsumed_tail
    return b"".join(parts)


def _check_matrix(body: memoryview, order: str, depth: int) -> None:
    if not body:
        return  # an empty variable has nothing but its tag
    if depth > _DEPTH:
        raise ValueError("variables are nested too deeply")
    kinds = []
    flags = None
    for kind, content in _elements(body, order):
        if flags is None:
            if kind != 6 or len(content) != 8:
                raise ValueError("a variable begins without its class")
            flags = int(struct.unpack_from(order + "I", content, 0)[0])
        elif kind == _MATRIX:
            _check_matrix(content, order, depth + 1)
        kinds.append(kind)
    if flags is None:
        raise ValueError("a variable has no class")
    number, is_complex = flags & 0xFF, bool((flags >> 8) & _COMPLEX)
    if number in _PLAIN or number == _SPARSE:
        wanted = 4 + is_complex + (2 if number == _SPARSE else 0)
        if len(kinds) < wanted or any(kind not in _NUMBERS for kind in kinds):
            raise ValueError("a variable lacks its values")


def _elements(body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    at = 0
    while at + 8 <= len(body):
        (word,) = struct.unpack_from(order + "I", body, at)
        if word >> 16:  # up to four bytes of content stand within the tag
            kind, length = word & 0xFFFF, word >> 16
            if length > 4:
                raise ValueError("a small element is too long")
            start, end = at + 4, at + 8
        else:
            kind, length = word, int(struct.unpack_from(order + "I", body, at + 4)[0])
            start = at + 8
            end = start + (length if kind == _MATRIX else -(-length // 8) * 8)
        if kind not in _NUMBERS and kind != _MATRIX:
            raise ValueError(f"unknown kind {kind} of element")
        if start + length > len(body):
            raise ValueError("an element is longer than its variable")
        yield kind, body[start : start + length]
        at = end
