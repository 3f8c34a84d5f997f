"""The firmware's own programs on this computer, with simulated sensors: what they send, whatever their bus does."""

import numpy as np
import pytest
from firmware_host import NO_ANSWER, OK, STUCK, Program, make
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from imufit import _imufit


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make(tmp_path_factory.mktemp("firmware"), "host")


@pytest.fixture
def gy86(folder):
    return Program(folder / "stm32f4_gy86.so")


@pytest.fixture
def uno(folder):
    return Program(folder / "uno_mpu6050.so")


def decoded(wire):
    decoder = _imufit.WireDecoder()
    decoder.feed(wire)
    decoder.finish()
    assert decoder.counts()["damaged"] == decoder.counts()["unknown"] == 0
    return decoder


def test_a_gy86_sends_each_reading_once_at_a_thousand_a_second_and_the_field_at_75(gy86):
    decoder = decoded(gy86.run(3.0))
    (batch,) = decoder.take()
    assert (batch["name"], batch["rates"][0], batch["rates"][7]) == ("STM32F4 GY-86", 1000.0, 75.0)
    acc = np.rint(batch["values"][:, 0] * 8192 / 9.80665).astype(int)
    np.testing.assert_array_equal(acc, np.arange(1, len(acc) + 1))
    assert len(acc) > 2800
    assert decoder.counts()["lost"] == 0
    late = batch["stamps"] * batch["tick"] - np.array(gy86.sensors.readings[: len(acc)])
    assert ((late >= 0) & (late < 5e-4)).all()
    field = np.rint(batch["values"][:, 7] * 10.9)
    np.testing.assert_array_equal(field[np.isfinite(field)], np.arange(1, np.isfinite(field).sum() + 1))
    assert np.isfinite(field).sum() == pytest.approx(75 * 2.8, abs=5)
    assert batch["ranges"] == pytest.approx([4 * 9.80665] * 3 + [np.radians(500)] * 3 + [0.0] + [130.0] * 3)


def test_an_uno_sends_200_a_second(uno):
    (batch,) = decoded(uno.run(2.0)).take()
    steps = np.diff(batch["stamps"]) * batch["tick"]
    np.testing.assert_array_equal(np.diff(np.rint(batch["values"][:, 0] * 16384 / 9.80665)), 1)
    assert steps.mean() == pytest.approx(0.005, rel=1e-3)
    assert abs(steps - 0.005).max() < 3e-4


@pytest.mark.parametrize(("name", "rate"), [("uno_mpu6050", 11520), ("stm32f4_gy86", 46080)])
def test_the_line_carries_what_is_sent(folder, name, rate):
    program = Program(folder / f"{name}.so")
    program.run(3.0)
    times, sizes = np.array([(t, len(frame)) for t, frame in program.sent]).T
    for begin in np.arange(0.5, 2.5, 0.1):
        assert sizes[(times >= begin) & (times < begin + 0.1)].sum() < 0.1 * rate * 0.75


def test_it_announces_itself_at_the_start_and_once_a_second(gy86):
    gy86.run(4.5)
    times = [t for t, frame in gy86.sent if b"STM32F4 GY-86" in frame]
    assert times[0] < 0.001
    np.testing.assert_allclose(np.diff(times), 1.0, atol=0.002)
    assert len(times) == 5


@pytest.mark.parametrize("name", ["uno_mpu6050", "stm32f4_gy86"])
def test_it_announces_itself_when_it_is_asked(folder, name):
    program = Program(folder / f"{name}.so")
    program.ask(0.4)
    program.run(1.3)
    times = [t for t, frame in program.sent if b" MPU6050" in frame or b" GY-86" in frame]
    np.testing.assert_allclose(times, [0.0, 0.4], atol=0.005, err_msg="the next one is due at 1.4 s")


def test_whoever_asks_without_a_pause_takes_no_sample_away(gy86):
    gy86.ask(0.5, every=0.001, count=2500)
    decoder = decoded(gy86.run(3.0))
    (batch,) = decoder.take()
    assert len(batch["stamps"]) > 2800
    assert decoder.counts()["lost"] == 0
    times, sizes = np.array([(t, len(frame)) for t, frame in gy86.sent]).T
    assert sizes[times > 0.5].sum() < 2.5 * 46080 * 0.75
    assert sum(b"STM32F4 GY-86" in frame for _, frame in gy86.sent) == pytest.approx(2.5 / 0.05, abs=2)


@pytest.mark.parametrize(
    ("fault", "said"), [(NO_ANSWER, "MPU6050: no answer"), (STUCK, "MPU6050: the bus does not go on")]
)
def test_a_bus_that_fails_is_told_and_tried_again(gy86, fault, said):
    gy86.fault = lambda t: fault if 1.0 <= t < 2.5 else OK
    decoder = decoded(gy86.run(5.0))
    texts = decoder.take_texts()
    assert [text[: len(said)] for text in texts] == [said] * 2
    (batch,) = decoder.take()
    seconds = batch["stamps"] * batch["tick"]
    assert seconds[seconds < 1].size > 800
    assert not ((seconds > 1) & (seconds < 2.5)).any()
    assert (seconds > 3.3).sum() > 1600
    assert np.isfinite(batch["values"][seconds > 3.3, 7]).sum() > 110, "the magnetometer comes back with it"


def test_a_sensor_that_lost_its_settings_is_set_up_anew(gy86):
    def blink(t):
        if 1.0 <= t < 1.0001:
            gy86.sensors.power_up()
        return OK

    gy86.fault = blink
    decoder = decoded(gy86.run(4.0))
    assert any("no sample for 0.2 s" in text for text in decoder.take_texts())
    assert any(batch["stamps"][-1] * batch["tick"] > 3.9 for batch in decoder.take())


def test_another_chip_is_told_and_nothing_of_it_sent(uno):
    uno.sensors.identity = 0x70
    uno.sensors.power_up()
    decoder = decoded(uno.run(2.5))
    assert decoder.take() == []
    assert [text.split(":")[1] for text in decoder.take_texts()] == [" WHO_AM_I is not 0x68"] * 3


def test_without_a_magnetometer_the_rest_is_sent(gy86):
    gy86.sensors.has_magnetometer = False
    decoder = decoded(gy86.run(2.0))
    (batch,) = decoder.take()
    assert len(batch["stamps"]) > 1800
    assert np.isnan(batch["values"][:, 7:]).all()
    assert {text.split(";")[0] for text in decoder.take_texts()} == {"HMC5883L: no answer"}


def test_frames_that_have_no_room_on_the_line_are_missed_by_the_receiver(uno):
    uno.takes = lambda t: not 1.0 <= t < 1.2
    decoder = decoded(uno.run(3.0))
    assert uno.refused > 35
    assert decoder.counts()["lost"] == uno.refused


def test_a_reset_is_seen(uno):
    wire = uno.run(1.0, start=255) + uno.run(1.0, start=0, begin=5.0)
    decoder = decoded(wire)
    assert [batch["start"] for batch in decoder.take()] == [255, 0]
    assert (decoder.counts()["restarts"], decoder.counts()["lost"]) == (1, 0)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.floats(0, 2), st.floats(0.0001, 0.5), st.sampled_from([NO_ANSWER, STUCK])), max_size=6))
def test_whatever_the_bus_does_frames_are_whole_and_it_recovers(folder, faults):
    program = Program(folder / "stm32f4_gy86.so")
    program.fault = lambda t: next((kind for begin, n, kind in faults if begin <= t < begin + n), OK)
    decoder = decoded(program.run(4.5))
    batches = decoder.take()
    assert decoder.counts()["lost"] == 0
    stamps = np.concatenate([batch["stamps"] for batch in batches])
    assert (np.diff(stamps.astype(np.int64)) > 0).all()
    assert stamps[-1] > 4.49e6, "a fault costs a second or so after its end, not the device"
