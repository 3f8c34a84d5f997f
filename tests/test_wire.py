"""The wire protocol, against frames that are made here with struct as docs/wire.md says."""

import struct
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import _imufit


def crc16(data: bytes) -> int:
    """CRC-16/IBM-3740, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def stuffed(data: bytes) -> bytes:
    """Consistent overhead byte stuffing, with its end."""
    out = bytearray()
    for piece in data.split(b"\0"):
        rest = piece
        while len(rest) >= 254:
            out += b"\xff" + rest[:254]
            rest = rest[254:]
        out += bytes([len(rest) + 1]) + rest
    return bytes(out) + b"\0"


@dataclass
class Device:
    """Sends frames, as a microcontroller would."""

    start: int = 1
    sequence: int = 0
    sent: list[int] = field(default_factory=list)

    def frame(self, kind: int, payload: bytes) -> bytes:
        body = struct.pack("<BBH", kind, self.start, self.sequence % 65536) + payload
        self.sequence += 1
        return stuffed(body + struct.pack("<H", crc16(body)))

    def announce(self) -> bytes:
        acc = b"".join(struct.pack("<B5s3f", 5, name, 0.001, 0.0, 30.0) for name in (b"acc_x", b"acc_y", b"acc_z"))
        streams = struct.pack("<BfBB", 0, 100.0, 0, 3) + acc + struct.pack("<Bf3B", 2, 10.0, 0x18, 0x20, 0)
        return self.frame(1, struct.pack("<BIB4sB", 1, 1000, 4, b"mine", 2) + streams)

    def sample(self, stamp: int, acc: tuple[int, int, int], mag: tuple[int, int, int] | None = None) -> bytes:
        self.sent.append(stamp)
        held = 1 if mag is None else 3
        more = b"" if mag is None else struct.pack(">3h", mag[0], mag[2], mag[1])
        return self.frame(2, struct.pack("<IB3h", stamp % 2**32, held, *acc) + more)


def test_counts_become_si_units_and_a_slow_stream_is_nan_between():
    device, decoder = Device(), _imufit.WireDecoder()
    decoder.feed(device.announce() + device.sample(10, (1, -2, 9807), (1090, 0, -545)) + device.sample(20, (0, 0, 0)))
    (batch,) = decoder.take()
    assert batch["columns"] == ["acc_x", "acc_y", "acc_z", "mag_x", "mag_y", "mag_z"]
    assert batch["name"] == "mine"
    assert [batch["tick"], batch["rates"][0], batch["rates"][3]] == pytest.approx([1e-6, 100.0, 10.0])
    assert batch["ranges"] == pytest.approx([30.0, 30.0, 30.0, 130.0, 130.0, 130.0])
    np.testing.assert_allclose(batch["values"][0], [0.001, -0.002, 9.807, 100.0, 0.0, -50.0], rtol=1e-7)
    assert np.isnan(batch["values"][1, 3:]).all()
    assert batch["stamps"].tolist() == [10, 20]
    assert batch["sequence"].tolist() == [1, 2]


def test_long_runs_without_a_zero_are_stuffed_as_the_paper_says():
    device, decoder = Device(), _imufit.WireDecoder()
    text = "x" * 700
    decoder.feed(device.frame(3, text.encode()))
    assert decoder.take_texts() == [text]


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_every_intact_frame_comes_once_and_in_order(data):
    device = Device(sequence=data.draw(st.integers(0, 65535)))
    wire, want = [device.announce()], []
    for k in range(data.draw(st.integers(1, 40))):
        frame = device.sample(1000 * k, (k, -k, 0))
        fate = data.draw(st.sampled_from(["intact"] * 4 + ["lost", "cut", "garbage before"]))
        if fate == "cut":
            frame = frame[: data.draw(st.integers(0, len(frame) - 2))] + b"\0"
        if fate == "garbage before":
            wire.append(data.draw(st.binary(max_size=30)) + b"\0")
        if fate != "lost":
            wire.append(frame)
        if fate in ("intact", "garbage before"):
            want.append(1000 * k)
    stream = b"".join(wire)
    decoder = _imufit.WireDecoder()
    while stream:
        n = data.draw(st.integers(1, 200))
        decoder.feed(stream[:n])
        stream = stream[n:]
    decoder.finish()
    batches = decoder.take()
    assert [int(stamp) for batch in batches for stamp in batch["stamps"]] == want
    told = sum(int(batch["lost"].sum()) for batch in batches)
    assert told == (want[-1] // 1000 + 1 - len(want) if want else 0)


def test_an_encoder_sends_what_a_device_sends():
    channels = [(name, 0.001, 0.0, 30.0) for name in ("acc_x", "acc_y", "acc_z")]
    streams = [(100.0, "i16", b"", channels), (10.0, "hmc5883l", bytes([0x18, 0x20, 0]), [])]
    encoder, device = _imufit.WireEncoder("mine", 1000, streams, 1), Device()
    assert encoder.announce() == device.announce()
    values = np.array([[0.001, -0.002, 9.807, 100.0, 0.0, -50.0], [0.0, 0.5, 40.0, *[np.nan] * 3]])
    data, ends = encoder.samples(np.array([7, 8], dtype=np.uint32), values)
    assert data == device.sample(7, (1, -2, 9807), (1090, 0, -545)) + device.sample(8, (0, 500, 30000))
    assert ends[-1] == len(data)


@pytest.mark.parametrize(
    ("streams", "said"),
    [
        ([], "1 to 8 streams"),
        ([(1.0, "i12", b"", [("a", 1.0, 0.0, 0.0)])], "none of i16"),
        ([(1.0, "mpu6050", b"\0", [])], "4 registers"),
        ([(1.0, "i16", b"", [("a", 1.0, 0.0, 0.0), ("a", 1.0, 0.0, 0.0)])], "one name"),
    ],
)
def test_what_cannot_be_announced_is_refused(streams, said):
    with pytest.raises(ValueError, match=said):
        _imufit.WireEncoder("x", 1000, streams, 0)


def test_values_of_another_shape_are_refused():
    encoder = _imufit.WireEncoder("x", 1000, [(1.0, "i16", b"", [("a", 1.0, 0.0, 0.0)])], 0)
    with pytest.raises(ValueError, match="not \\(2, 1\\)"):
        encoder.samples(np.zeros(2, dtype=np.uint32), np.zeros((2, 3)))


def test_lines_of_text_with_a_header():
    decoder = _imufit.LineDecoder()
    decoder.feed(b"hello\nt_ms,acc_x\n1,0.5\n2,\n3,0.7,9\n4,0.9\n")
    (batch,) = decoder.take()
    assert batch["columns"] == ["t_ms", "acc_x"]
    np.testing.assert_array_equal(batch["values"], [[1, 0.5], [2, np.nan], [4, 0.9]])
    assert batch["lost"].tolist() == [0, 0, 1]
    assert decoder.take_texts() == ["hello"]
    assert decoder.counts()["damaged"] == 1


@settings(max_examples=200, deadline=None)
@given(st.lists(st.binary(max_size=100), max_size=10))
def test_no_bytes_whatever_are_a_fault(pieces):
    for decoder in (_imufit.WireDecoder(), _imufit.LineDecoder()):
        for piece in pieces:
            decoder.feed(piece)
            decoder.interrupted()
        decoder.finish()
        decoder.take()
