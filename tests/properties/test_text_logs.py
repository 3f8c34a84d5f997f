"""Whatever stands in a text file: reading gives a log or one line that says what is wrong."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from imufit.errors import InputError
from imufit.log import Log, contents, read

FULL = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
MAPPINGS = (
    None,
    {"t": "row[10Hz]", "acc_x": "c1", "acc_y": "c2", "acc_z": "c3"},
    {"t": "row[10Hz]", "acc_x": "ax", "acc_y": "ay", "acc_z": "az"},
    {"t": "t", "acc_x": "a_x", "acc_y": "a_y", "acc_z": "a_z[16384LSB/g+1]"},
)


def judge(data: bytes) -> list[Log]:
    """Read the bytes with each mapping and any suffix; anything but an `InputError` gets through."""
    logs, messages = [], []
    with tempfile.TemporaryDirectory() as folder:
        for name in ("a.log", "a.csv", "a.capture"):
            path = Path(folder) / name
            path.write_bytes(data)
            for mapping in MAPPINGS:
                try:
                    log = read(path, mapping)
                except InputError as error:
                    messages.append(str(error))
                    continue
                contents(log).to_dict()
                logs.append(log)
    assert not any("\n" in message for message in messages)
    return logs


numbers = st.one_of(
    st.integers(-40000, 40000).map(str),
    st.floats(-100, 100).map("{:.3f}".format),
    st.sampled_from(["", "nan", "inf", "1e999", "0x70", "1.2.3", "-", "12:30:01.5", "1,5", "true", "9" * 400]),
)
words = st.sampled_from(
    ["ax", "ay", "az", "a", "t", "x", "y", "z", "Accel", "RAW 0x68:", "I (12)", "# face_begin +X", "face_end", '"', "#"]
)
marks = st.sampled_from(
    ["=", ": ", " ", ", ", ";", "\t", "(", ")", "[", "]", "\r", "\x1b[0;32m", "\0", "\ufeff", "{", "}"]
)
pieces = st.lists(st.one_of(numbers, words, marks), max_size=14).map("".join)
records = st.tuples(numbers, numbers, numbers, numbers).map(lambda v: "t={} ax={} ay={} az={}".format(*v))
triples = st.tuples(numbers, numbers, numbers, numbers).map(lambda v: "RAW: t={} a=({}, {}, {})".format(*v))
rows = st.lists(numbers, min_size=3, max_size=4).map(" ".join)
lines = st.lists(st.one_of(pieces, records, triples, rows), max_size=12)


@FULL
@given(st.binary(max_size=300))
def test_arbitrary_bytes(data: bytes) -> None:
    judge(data)


@FULL
@given(lines, st.sampled_from(["\n", "\r\n", "\r"]), st.sampled_from(["utf-8", "cp1252", "utf-16"]), st.booleans())
def test_arbitrary_lines(lines: list[str], end: str, encoding: str, whole: bool) -> None:
    data = end.join(lines).encode(encoding, errors="replace")
    judge(data + end.encode() if whole else data)


@FULL
@given(st.lists(st.one_of(records, triples), min_size=4, max_size=8), st.data())
def test_cut_and_spoilt_records(lines: list[str], data: st.DataObject) -> None:
    text = bytearray("\n".join(lines).encode())
    for place in data.draw(st.lists(st.integers(0, len(text) - 1), max_size=4)):
        text[place] = data.draw(st.integers(0, 255))
    start = data.draw(st.integers(0, len(text) // 2))
    judge(bytes(text[start : data.draw(st.integers(start, len(text)))]))


def cells(k: int) -> list[float]:
    return [round(0.01 * k, 3), round(0.5 - 0.1 * k, 3), -9.8 + k]


@FULL
@given(st.sets(st.integers(0, 19), max_size=6), st.sampled_from(["half a word", "load:0x3f,len:0x17", "ax: waiting"]))
def test_no_complete_record_is_lost(spoilt: set[int], noise: str) -> None:
    made = [noise if k in spoilt else "ax={} ay={} az={}".format(*cells(k)) for k in range(20)]
    (log, *_) = judge("\n".join([*made, ""]).encode())
    assert log.acc is not None
    for k in set(range(20)) - spoilt:
        assert cells(k) in log.acc.tolist()
