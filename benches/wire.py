"""Frames and lines per second of the decoders of the wire protocol, beside Python's own means in the same run.

Frames of an MPU6050 (27 bytes on the wire) that come in pieces of 4096 bytes, as a serial port has them. Beside it:

- struct: frame by frame with `bytes.split`, `binascii.crc_hqx` (the same polynomial in C, begun with 0xFFFF) and
  `struct`, the stuffing taken out by slices;
- numpy: frames of one length are rows of a matrix, stuffing and check sum go through it column by column; it has all
  frames at once and keeps no account of what is missing.

Lines of ten numbers: beside `float` on the cells, Python's csv, `numpy.loadtxt` and pyarrow's reader of CSV; the last
two have the whole text at once. All must find the same values. Ratios (ours / the other) carry over to other machines.
Run: ``python benches/wire.py [FRAMES]``.
"""

import binascii
import csv
import io
import struct
import sys
import time
from collections.abc import Callable

import numpy as np
import pyarrow.csv
from imufit import _imufit

G = 9.80665
PIECE = 4096
REPEATS = 5
REGISTERS = bytes([4, 3, 0, 0])
SCALES = np.array([G / 16384] * 3 + [np.radians(1) / 131] * 3 + [1 / 340])
OFFSETS = np.array([0.0] * 6 + [36.53])
ORDER = [0, 1, 2, 4, 5, 6, 3]  # registers: accelerometer, thermometer, gyro
HEAD = 9  # bytes before the registers: kind, start, sequence, stamp, streams
LENGTH = HEAD + 14 + 2
TABLE = np.array([binascii.crc_hqx(bytes([k]), 0) for k in range(256)], dtype=np.uint16)

Array = np.ndarray


def pieces(stream: bytes) -> list[bytes]:
    return [stream[k : k + PIECE] for k in range(0, len(stream), PIECE)]


def ours(stream: bytes) -> Array:
    decoder = _imufit.WireDecoder()
    out = []
    for piece in pieces(stream):
        decoder.feed(piece)
        out += [batch["values"] for batch in decoder.take()]
    return np.concatenate(out)


def unstuffed(frame: bytes) -> bytes:
    out, at = bytearray(), 0
    while at < len(frame):
        run = frame[at]
        out += frame[at + 1 : at + run]
        at += run
        if run < 255 and at < len(frame):
            out.append(0)
    return bytes(out)


def by_struct(stream: bytes) -> Array:
    unpack = struct.Struct(">7h").unpack_from
    rows, rest, last, lost = [], b"", None, 0
    for piece in pieces(stream):
        *frames, rest = (rest + piece).split(b"\0")
        for frame in frames:
            body = unstuffed(frame)
            if len(body) < 6 or binascii.crc_hqx(body[:-2], 0xFFFF) != body[-2] | body[-1] << 8:
                continue
            sequence = body[2] | body[3] << 8
            lost += 0 if last is None else (sequence - last - 1) % 65536
            last = sequence
            if body[0] == 2:
                rows.append(unpack(body, HEAD))
    return np.array(rows)[:, ORDER] * SCALES + OFFSETS


def by_numpy(stream: bytes) -> Array:
    data = np.frombuffer(stream, np.uint8)
    ends = np.flatnonzero(data == 0)
    begins = np.concatenate([[0], ends[:-1] + 1])
    whole = begins[ends - begins == LENGTH + 1]
    frames = data[whole[:, None] + np.arange(LENGTH + 1)].T.copy()
    # The byte that encodes the next end of a run stands where a 0 was.
    following = frames[0].astype(np.int64)
    check = np.full(len(whole), 0xFFFF, np.uint16)
    body = np.empty((LENGTH, len(whole)), np.uint8)
    for k in range(1, LENGTH + 1):
        is_code = following == k
        body[k - 1] = np.where(is_code, 0, frames[k])
        following = np.where(is_code, k + frames[k], following)
        if k <= LENGTH - 2:
            check = TABLE[(check >> 8) ^ body[k - 1]] ^ (check << 8)
    good = (check == body[-2] | body[-1].astype(np.uint16) << 8) & (body[0] == 2)
    counts = np.ascontiguousarray(body[HEAD : HEAD + 14, good].T).view(">i2")
    return counts[:, ORDER] * SCALES + OFFSETS


def our_lines(text: bytes) -> Array:
    decoder = _imufit.LineDecoder()
    out = []
    for piece in pieces(text):
        decoder.feed(piece)
        out += [batch["values"] for batch in decoder.take()]
    return np.concatenate(out)


def by_float(text: bytes) -> Array:
    rows, rest = [], b""
    for piece in pieces(text):
        *lines, rest = (rest + piece).split(b"\n")
        for line in lines:
            try:
                rows.append([float(cell) for cell in line.split(b",")])
            except ValueError:
                continue
    return np.array(rows)


def by_csv(text: bytes) -> Array:
    reader = csv.reader(io.StringIO(text.decode()))
    next(reader)
    return np.array([[float(cell) for cell in row] for row in reader])


def by_loadtxt(text: bytes) -> Array:
    return np.loadtxt(io.BytesIO(text), delimiter=",", skiprows=1)


def by_pyarrow(text: bytes) -> Array:
    return np.column_stack([column.to_numpy() for column in pyarrow.csv.read_csv(io.BytesIO(text)).columns])


def seconds(work: Callable[[bytes], Array], stream: bytes) -> tuple[float, Array]:
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        found = work(stream)
        times.append(time.perf_counter() - begin)
    return min(times), found


def compare(what: str, stream: bytes, n: int, own: Callable[[bytes], Array], others: dict[str, Callable]) -> None:
    took, want = seconds(own, stream)
    print(f"{what}: {n / took:,.0f}/s, {len(stream) / took / 1e6:.0f} MB/s; {len(stream) / n:.1f} bytes each")
    assert len(want) == n
    for name, work in others.items():
        other, found = seconds(work, stream)
        np.testing.assert_allclose(found, want, rtol=1e-12, atol=1e-12)
        print(f"  {other / took:7.1f} times {name} ({n / other:,.0f}/s)")


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
    random = np.random.default_rng(1)
    encoder = _imufit.WireEncoder("bench", 1000, [(1000.0, "mpu6050", REGISTERS, [])], 1)
    stamps = np.arange(n, dtype=np.uint32) * 1000
    values = random.normal(np.array([0, 0, G, 0, 0, 0, 25.0]), 1, (n, 7))
    samples, _ = encoder.samples(stamps, values)
    # An announcement has another length than a sample.
    stream = encoder.announce() + samples
    compare("frames", stream, n, ours, {"struct": by_struct, "numpy, all at once": by_numpy})

    names = "t,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z,mag_x,mag_y,mag_z"
    rows = np.column_stack([stamps, np.rint(random.normal(0, 10, (n, 9)) * 1e4) / 1e4])[: n // 4]
    text = (names + "\n" + "".join(",".join(f"{v:.10g}" for v in row) + "\n" for row in rows)).encode()
    others = {"float": by_float, "csv": by_csv, "numpy.loadtxt, all at once": by_loadtxt}
    compare("lines", text, len(rows), our_lines, {**others, "pyarrow, all at once": by_pyarrow})


if __name__ == "__main__":
    main()
