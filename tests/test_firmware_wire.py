"""The firmware's frame encoder, compiled on this computer, against the decoder."""

import ctypes

import numpy as np
import pytest
from firmware_host import make
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import _imufit

KINDS = [np.dtype("<i2"), np.dtype("<i4"), np.dtype("<f4")]
numbers = st.floats(allow_nan=False, allow_infinity=False, width=32)


class Wire:
    """wire/wire.c; its functions by their names."""

    def __init__(self, library, start=1):
        self.library = ctypes.CDLL(str(library))
        for name in ("host_wire", "host_frame"):
            getattr(self.library, name).restype = ctypes.c_void_p
        self.wire = ctypes.c_void_p(self.library.host_wire(start))

    def call(self, name, *arguments):
        self.library[name].restype = None
        self.library[name](self.wire, *[ctypes.c_float(a) if isinstance(a, float) else a for a in arguments])

    def end(self):
        self.library.wire_end.restype = ctypes.c_bool
        has_room = self.library.wire_end(self.wire)
        n = ctypes.c_uint16()
        frame = self.library.host_frame(self.wire, ctypes.byref(n))
        assert has_room == (n.value > 0)
        return ctypes.string_at(frame, n.value)

    def announce(self, streams, name=b"bench", tick=1000):
        self.call("wire_announcement", name, tick, len(streams))
        for kind, channels in streams:
            self.call("wire_counts", 100.0, kind, len(channels))
            for channel in channels:
                self.call("wire_channel", *channel)
        return self.end()

    def sample(self, stamp, held, payload):
        self.call("wire_sample", stamp, held)
        for k in range(0, len(payload), 255):
            self.call("wire_bytes", payload[k : k + 255], len(payload[k : k + 255]))
        return self.end()


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return make(tmp_path_factory.mktemp("firmware"), "host") / "uno_mpu6050.so"


def channels(n):
    return [(f"c{k}".encode(), 1.0, 0.0, 0.0) for k in range(n)]


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_samples_of_any_bytes_are_read_as_they_were_sent(library, data):
    kind = data.draw(st.integers(0, 2))
    n = data.draw(st.integers(1, 60))
    size = n * KINDS[kind].itemsize
    dull = st.sampled_from([0, 1, 255])
    wire, decoder = Wire(library), _imufit.WireDecoder()
    stream = wire.announce([(kind, channels(n))])
    want, stamps = [], []
    for _ in range(data.draw(st.integers(1, 5))):
        payload = bytes(
            data.draw(st.one_of(st.binary(min_size=size, max_size=size), st.lists(dull, min_size=size, max_size=size)))
        )
        stamps.append(data.draw(st.integers(0, 2**32 - 1)))
        with np.errstate(invalid="ignore"):
            want.append(np.frombuffer(payload, KINDS[kind]).astype(float))
        stream += wire.sample(stamps[-1], 1, payload)
    assert stream.count(b"\0") == len(want) + 1
    decoder.feed(stream)
    (batch,) = decoder.take()
    np.testing.assert_array_equal(batch["values"], want)
    assert batch["stamps"].tolist() == stamps
    assert decoder.counts()["lost"] == decoder.counts()["damaged"] == 0


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(st.text("abcxyz_", min_size=1, max_size=9), numbers, numbers, numbers),
        min_size=1,
        max_size=20,
        unique_by=lambda c: c[0],
    ),
    st.text(max_size=60).filter(
        lambda t: "\0" not in t and len(t.encode("utf-8", "ignore")) == len(t.encode("utf-8", "replace"))
    ),
    st.integers(1, 2**32 - 1),
)
def test_an_announcement_is_read_as_it_was_sent(library, given_channels, name, tick):
    wire, decoder = Wire(library), _imufit.WireDecoder()
    half = len(given_channels) // 2
    streams = [s for s in (given_channels[:half], given_channels[half:]) if s]
    sent = [(0, [(c[0].encode(), *c[1:]) for c in stream]) for stream in streams]
    decoder.feed(wire.announce(sent, name.encode(), tick))
    announced = decoder.announcement()
    assert (announced["name"], announced["columns"]) == (name, [c[0] for c in given_channels])
    assert announced["tick"] == pytest.approx(tick * 1e-9, rel=1e-15)
    assert announced["ranges"] == [c[3] for c in given_channels]
    assert announced["rates"] == [100.0] * len(given_channels)


@pytest.mark.parametrize("last", [b"", b"\0", b"\0\0", b"\0\1"])
def test_runs_of_any_length_without_a_zero(library, last):
    lengths = [*range(236, 266), *range(490, 520), *range(990, 1006)]
    wire, decoder = Wire(library), _imufit.WireDecoder()
    for n in lengths:
        decoder.feed(wire.sample(0, 1, b"\1" * n + last))
    decoder.finish()
    # Nothing explains them, but their check sums are right.
    counts = decoder.counts()
    assert (counts["damaged"], counts["lost"], counts["unexplained"]) == (0, 0, len(lengths))


@settings(max_examples=100, deadline=None)
@given(st.text(st.characters(min_codepoint=1, max_codepoint=0x10FFFF, exclude_categories=["Cs"]), max_size=200))
def test_a_message_is_read_as_it_was_sent(library, text):
    wire, decoder = Wire(library), _imufit.WireDecoder()
    half = len(text) // 2
    wire.call("wire_message", text[:half].encode())
    wire.call("wire_more", text[half:].encode())
    decoder.feed(wire.end())
    assert decoder.take_texts() == [text]


def test_a_frame_without_room_is_left_out_and_missed(library):
    wire, decoder = Wire(library), _imufit.WireDecoder()
    stream = wire.announce([(0, channels(2))]) + wire.sample(1, 1, bytes(4))
    for n in (1014, 1015, 1100, 5000):
        wire.call("wire_message", b"x" * n)
        frame = wire.end()
        assert (len(frame) > 0) == (n == 1014), "1024 bytes on the wire and the end"
        stream += frame
    decoder.feed(stream + wire.sample(2, 1, bytes(4)))
    (batch,) = decoder.take()
    assert batch["lost"].tolist() == [0, 3]
    assert len(decoder.take_texts()) == 1
