"""Mutations of a file as bytes, whatever its format: flips, cuts, pieces put in, left out, moved or repeated."""

from random import Random

REPLACEMENTS = (
    b"\x00",
    b"\xff",
    b"\xfe\xff",
    b"\xef\xbb\xbf",
    b"\xc3\x28",
    b"\xed\xa0\x80",
    b"\x1b[31m",
    b"\x9b",
    b"\r",
    b"\r\n",
    b"\n",
    b"\n\n\n",
    b",",
    b";",
    b"\t",
    b'"',
    b"'",
    b"#",
    b"=",
    b"[",
    b"]",
    b"{",
    b"}",
    b"(",
    b"1e400",
    b"nan",
    b"PK\x05\x06",
    b"PAR1",
    b"\xff\xff\xff\x7f",
    b"\x80\x80\x80\x80\x80\x80\x80\x80\x80\x01",
    b"\x00" * 300,
    b"\xe2\x80\xae",
)


def place(rng: Random, data: bytes) -> int:
    """Draw a place; the ends, where headers and indexes lie, are drawn more often."""
    if not data:
        return 0
    which = rng.random()
    if which < 0.25:
        return rng.randrange(min(len(data), 400))
    if which < 0.5:
        return len(data) - 1 - rng.randrange(min(len(data), 400))
    return rng.randrange(len(data))


def flip(rng: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 8, 64))):
        if changed:
            changed[place(rng, data)] ^= 1 << rng.randrange(8)
    return bytes(changed)


def random_bytes(rng: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 3, 30))):
        if changed:
            changed[place(rng, data)] = rng.randrange(256)
    return bytes(changed)


def cut(rng: Random, data: bytes) -> bytes:
    return data[: place(rng, data)]


def cut_front(rng: Random, data: bytes) -> bytes:
    return data[place(rng, data) :]


def put_in(rng: Random, data: bytes) -> bytes:
    at = place(rng, data)
    return data[:at] + rng.choice(REPLACEMENTS) * rng.choice((1, 1, 1, 40)) + data[at:]


def put_over(rng: Random, data: bytes) -> bytes:
    at, piece = place(rng, data), rng.choice(REPLACEMENTS)
    return data[:at] + piece + data[at + len(piece) :]


def leave_out(rng: Random, data: bytes) -> bytes:
    at = place(rng, data)
    return data[:at] + data[at + rng.choice((1, 2, 4, 100, 1000)) :]


def repeat_piece(rng: Random, data: bytes) -> bytes:
    at, length = place(rng, data), rng.choice((1, 8, 100, 1000))
    return data[: at + length] + data[at : at + length] * rng.choice((1, 1, 5)) + data[at + length :]


def append(rng: Random, data: bytes) -> bytes:
    return data + rng.choice((b"\x00" * 100, data[:200], rng.randbytes(50), b"\n" * 50))


def twice(_rng: Random, data: bytes) -> bytes:
    return data + data


def nothing(_rng: Random, _data: bytes) -> bytes:
    return b""


def noise(rng: Random, _data: bytes) -> bytes:
    return rng.randbytes(rng.choice((1, 10, 1000, 20_000)))


def utf16(rng: Random, data: bytes) -> bytes:
    return data.decode("latin-1").encode(rng.choice(("utf-16", "utf-16-le", "utf-32")))


BYTE_MUTATIONS = (
    flip,
    flip,
    random_bytes,
    cut,
    cut,
    cut_front,
    put_in,
    put_in,
    put_over,
    leave_out,
    repeat_piece,
    append,
    twice,
    nothing,
    noise,
    utf16,
)
