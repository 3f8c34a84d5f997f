"""Mutations of an NPZ file that keep it a zip file: its members, their headers, how they are packed."""

import io
import struct
import warnings
import zipfile
from random import Random

HEADERS = (
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 9223372036854775807), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': 300, }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': ('a',), }",
    "{'descr': '<f8', 'fortran_order': False, }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '|V0', 'fortran_order': False, 'shape': (300,), }",
    "{'descr': '<U0', 'fortran_order': False, 'shape': (300,), }",
    "{'descr': '<U1000000000', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': [('a', '<f8'), ('a', '<f8')], 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<M8[as]', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': 'zzz', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f8', 'fortran_order': 'maybe', 'shape': (3,), }",
    "__import__('os')",
    "(" * 2000,
    "[" * 5000 + "]" * 5000,
    "\x00" * 40,
    "",
)

Members = list[tuple[str, bytes]]


def members(data: bytes) -> Members:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            return [(info.filename, file.read(info)) for info in file.infolist()]
    except Exception:  # a step before has made it no zip file: it stays as it is
        return []


def packed(found: Members, method: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", method) as file:
        warnings.simplefilter("ignore")
        for name, content in found:
            info = zipfile.ZipInfo(name)
            info.compress_type = method
            file.writestr(info, content)
    return out.getvalue()


def duplicate_member(rng: Random, data: bytes) -> bytes:
    found = members(data)
    if not found:
        return data
    name, content = rng.choice(found)
    found.insert(rng.randrange(len(found) + 1), (name, rng.choice((content, b"", rng.choice(found)[1], content[:90]))))
    return packed(found)


def header(rng: Random, data: bytes) -> bytes:
    """Let one array declare what it is not."""
    found = members(data)
    if not found:
        return data
    at = rng.randrange(len(found))
    text = rng.choice(HEADERS).encode("latin-1") + b"\n"
    length = rng.choice((len(text), len(text), len(text), 65535, 0))
    content = b"\x93NUMPY" + rng.choice((b"\x01\x00", b"\x01\x00", b"\x02\x00", b"\x09\x00"))
    size = struct.pack("<H", length) if content[6] == 1 else struct.pack("<I", length)
    found[at] = (found[at][0], content + size + text + found[at][1][128:])
    return packed(found)


def member_bytes(rng: Random, data: bytes) -> bytes:
    """Damage the bytes of one array, with a right checksum around them."""
    found = members(data)
    if not found:
        return data
    at = rng.randrange(len(found))
    name, content = found[at]
    if content:
        place = rng.randrange(min(len(content), rng.choice((12, 128, len(content)))))
        content = rng.choice(
            (
                content[:place],
                content[:place] + bytes([rng.randrange(256)]) + content[place + 1 :],
                content[:place] + content[place + 1 :],
            )
        )
    found[at] = (name, content)
    return packed(found)


def member_name(rng: Random, data: bytes) -> bytes:
    found = members(data)
    if not found:
        return data
    at = rng.randrange(len(found))
    new = rng.choice(
        ("", ".npy", "../../x.npy", "/x.npy", "acc_x", "acc_x.NPY", "\x1b[2J.npy", "x" * 60_000, "a/b.npy")
    )
    found[at] = (new, found[at][1])
    return packed(found)


def method(rng: Random, data: bytes) -> bytes:
    """Pack otherwise, or claim another method than the one that it was packed by."""
    found = members(data)
    if not found:
        return data
    which = rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, 99, 1, 0xFFFF))
    if which in (zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        return packed(found, which)
    changed = bytearray(packed(found))
    for signature, offset in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        at = changed.find(signature)
        if at >= 0:
            struct.pack_into("<H", changed, at + offset, which)
    return bytes(changed)


def encrypted(_rng: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = changed.find(signature)
        if 0 <= at < len(changed) - offset:
            changed[at + offset] |= 1
    return bytes(changed)


def without_index(_rng: Random, data: bytes) -> bytes:
    at = data.find(b"PK\x01\x02")
    return data[:at] if at > 0 else data


def bomb(_rng: Random, data: bytes) -> bytes:
    """Add an array of 16 MB of zeros, packed into 16 kB."""
    found = members(data)
    zeros = b"\x93NUMPY\x01\x00v\x00" + f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({2**21},), }}".encode()
    return packed([*found, ("bomb.npy", zeros.ljust(127) + b"\n" + bytes(2**24))], zipfile.ZIP_DEFLATED)


def other_member(rng: Random, data: bytes) -> bytes:
    extra = rng.choice((("readme.txt", b"hello"), ("imufit.npy", b""), ("folder/", b""), ("t", b"")))
    return packed([*members(data), extra])


ZIP_MUTATIONS = (
    duplicate_member,
    header,
    header,
    header,
    member_bytes,
    member_bytes,
    member_name,
    method,
    encrypted,
    without_index,
    bomb,
    other_member,
)
