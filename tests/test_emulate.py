"""An emulated device sends what its source holds, at its rate, with the faults that were asked for, and says so."""

import os
import threading
import time

import numpy as np
import pyarrow.parquet as pq
import pytest
import serial
from emulated import intact, keys, read
from imufit import InputError, Log
from imufit.devices.emulate import Clock, Emulator, open_source, parse_fault
from imufit.devices.emulate.clock import Clock as DeviceClock
from imufit.devices.emulate.course import Course
from imufit.devices.emulate.faults import FAULTS, Fault, Schedule

ENDS = ["pty", "socket://127.0.0.1:0"]
FAST = {"speed": "max", "sent": True, "duration": 4.0}


def walk(n=400, rate=100.0, **more):
    t = 5.0 + np.arange(n) / rate
    acc = np.column_stack([np.sin(t), np.cos(t), np.full(n, 9.8)])
    return Log.from_arrays(t, acc=acc, gyr=0.1 * acc, **more)


@pytest.mark.parametrize("on", ENDS)
def test_every_sample_arrives_once_and_holds_what_the_scenario_measures(on):
    with Emulator("handheld", on=on, rate=500.0, **FAST) as device:
        decoder, batches = read(device)
        np.testing.assert_array_equal(keys(batches), intact(device))
        source = open_source("handheld", rate=500.0, duration=4.0)
    assert decoder.counts()["samples"] == 2000
    assert decoder.counts()["damaged"] == 0
    (batch, *rest) = batches
    assert not rest or batch["columns"] == rest[0]["columns"]
    values = np.concatenate([b["values"] for b in batches])
    sent = np.column_stack([v for group in source.groups.values() for v in group.values()])
    np.testing.assert_allclose(values, sent, rtol=1e-6)
    assert batch["rates"][0] == 500.0


@pytest.mark.parametrize("on", ENDS)
@pytest.mark.parametrize(("form", "answers"), [("binary", 1), ("text", 0)])
def test_a_device_that_is_asked_announces_itself_at_once(on, form, answers):
    def count_of(line, seconds):
        data, end = b"", time.monotonic() + seconds
        while time.monotonic() < end:
            data += line.read(65536)
            time.sleep(0.005)
        return data.count(b"acc_x")

    with (
        Emulator(walk(), on=on, form=form, rate=100.0, wait=True) as device,
        serial.serial_for_url(device.port, timeout=0) as line,
    ):
        assert count_of(line, 0.4) == 1
        line.write(b"\0")
        assert count_of(line, 0.2) == answers


@pytest.mark.parametrize(
    ("device", "columns", "counts"),
    [
        ("mpu6050", 7, [9.80665 / 8192, np.radians(1 / 65.5), 1 / 340]),
        ("gy86", 10, [9.80665 / 8192, np.radians(1 / 65.5), 1 / 340]),
    ],
)
def test_chips_send_their_registers_and_the_compass_is_slower(device, columns, counts):
    with Emulator("handheld", device=device, rate=400.0, **FAST) as emulated:
        _, batches = read(emulated)
        sent = emulated.sent.to_pandas()
    values = np.concatenate([b["values"] for b in batches])
    assert values.shape == (1600, columns)
    wanted = sent.iloc[:, 6:].to_numpy()
    for group, count in zip((slice(0, 3), slice(3, 6), slice(6, 7)), counts, strict=True):
        assert np.abs(values[:, group] - wanted[:, group]).max() < 0.51 * count
    if device == "gy86":
        there = np.isfinite(values[:, 7])
        assert there.sum() == pytest.approx(300, abs=2)  # 75 Hz over 4 s
        assert np.abs(values[there, 7:] - wanted[there, 7:]).max() < 0.05
        assert batches[0]["rates"][7] == pytest.approx(75.0, rel=0.01)


def test_log_is_sent_with_its_covariates_but_not_its_reference(tmp_path):
    reference = np.tile([1.0, 0.0, 0.0, 0.0], (400, 1))
    log = walk(reference=reference, covariates={"vbat": np.linspace(12.0, 11.0, 400)})
    log.write(tmp_path / "walk.parquet")
    with Emulator(tmp_path / "walk.parquet", speed="max", sent=True) as device:
        _, batches = read(device)
    assert batches[0]["columns"] == ["acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z", "vbat"]
    values = np.concatenate([b["values"] for b in batches])
    np.testing.assert_allclose(values[:, 6], log.covariates["vbat"], rtol=1e-6)
    stamps = np.concatenate([b["stamps"] for b in batches])
    np.testing.assert_allclose(1e-6 * stamps, log.t - log.t[0], atol=2e-6)


def test_another_rate_goes_straight_between_rows_and_leaves_a_slow_sensor_its_own():
    log = walk(mag=np.where(np.arange(400)[:, None] % 10 == 0, 40.0, np.nan) * np.ones(3))
    source = open_source(log, rate=250.0)
    assert source.rate == pytest.approx(250.0)
    x = source.groups["acc"]["acc_x"]
    np.testing.assert_allclose(x, np.sin(5.0 + source.t), atol=2e-5)
    assert np.isfinite(source.groups["mag"]["mag_x"]).sum() == 40


def test_source_that_is_looped_goes_on_with_its_clock():
    with Emulator(walk(100), speed="max", loop=True, duration=3.5, sent=True) as device:
        decoder, batches = read(device)
    assert decoder.counts()["samples"] == 350
    stamps = np.concatenate([b["stamps"] for b in batches])
    np.testing.assert_allclose(np.diff(1e-6 * stamps), 0.01, atol=2e-6)


def test_clock_drifts_scatters_and_runs_over():
    rng, t = np.random.default_rng(0), np.arange(2000) * 0.01
    even = DeviceClock(start=2**32 - 5_000_000).ticks(t, 0.01, rng)
    assert np.diff(even.astype(np.int64)).min() < -4e9
    np.testing.assert_allclose(np.unwrap(even.astype(float), period=2.0**32)[-1], 2**32 - 5_000_000 + 19_990_000)
    assert DeviceClock(drift=100.0).ticks(t, 0.01, rng)[-1] == 19_991_999
    scattered = DeviceClock(jitter=1e-3, tick=1_000_000).ticks(t, 0.01, rng).astype(float)
    off = scattered - np.floor(1000.0 * t + 1e-6)
    assert 0.8 < off.std() < 1.3
    assert np.all(np.diff(scattered) > 0)


@pytest.mark.parametrize("on", ENDS)
def test_whatever_happens_to_frames_the_rest_arrives_and_is_told(on, tmp_path):
    faults = ["crc@0.5:3", "drop@1:10", "garbage@1.5:200", "unplug@2:0.4", "reset@3:0.2"]
    link = {"link": tmp_path / "imu"} if on == "pty" else {}
    with Emulator(
        "handheld", on=on, rate=500.0, faults=faults, fault_rates={"garbage": 4.0, "crc": 4.0}, seed=3, **link, **FAST
    ) as device:
        decoder, batches = read(device)
        found, told = intact(device), device.summary()
    np.testing.assert_array_equal(keys(batches), found)
    assert {"crc", "drop", "garbage", "unplug", "reset"} <= {fault["kind"] for fault in told["faults"]}
    assert told["starts"] == 2
    assert told["unread"] == pytest.approx(0.4 * 500, abs=2)
    assert told["samples"] == pytest.approx(2000 - 0.2 * 500, abs=2)
    assert told["intact"] == len(found) == decoder.counts()["samples"]
    assert decoder.counts()["restarts"] == 1
    # Numbers begin anew at the reset: all that is missing there was counted.
    lost = sum(int(batch["lost"].sum()) for batch in batches)
    assert lost >= told["samples"] - told["intact"] - 2
    assert not (tmp_path / "imu").exists()


def test_text_is_what_a_sketch_prints(tmp_path):
    log = walk(300, mag=np.where(np.arange(300)[:, None] % 2 == 0, 40.0, np.nan) * np.ones(3))
    with Emulator(log, form="text", speed="max", on=ENDS[1], sent=True, faults=["reset@1"]) as device:
        decoder, batches = read(device, text=True)
    assert decoder.counts()["samples"] == 300
    assert batches[0]["columns"] == [
        "t_us",
        *(f"{sensor}_{axis}" for sensor in ("acc", "gyr", "mag") for axis in "xyz"),
    ]
    values = np.concatenate([b["values"] for b in batches])
    np.testing.assert_allclose(values[:, 1:4], log.acc, rtol=1e-6)
    assert np.isnan(values[1, 7])
    assert (np.diff(values[:, 0]) < 0).sum() == 1


def test_in_real_time_samples_without_a_reader_are_lost_and_counted():
    with Emulator(walk(30), sent=True) as device:
        assert device.join(10.0)
        told = device.summary()
    assert (told["samples"], told["intact"], told["unread"]) == (30, 0, 30)


def test_device_that_waits_begins_with_its_reader():
    with Emulator(walk(40), wait=True, speed=4.0, sent=True) as device:
        assert not device.join(0.3)
        assert device.summary()["samples"] == 0
        _, batches = read(device)
        np.testing.assert_array_equal(keys(batches), intact(device))
    assert len(keys(batches)) == 40


def test_truth_is_written_to_a_file(tmp_path):
    path = tmp_path / "sent.parquet"
    with Emulator(walk(200), speed="max", sent=path, faults=["drop@1:5"]) as device:
        _, batches = read(device)
    table = pq.read_table(path).to_pandas()
    assert list(table.columns[:7]) == ["start", "sequence", "stamp", "t", "t_host", "intact", "acc_x"]
    assert (~table.intact).sum() == 5
    np.testing.assert_array_equal(keys(batches), table[table.intact][["start", "sequence", "stamp"]].to_numpy())
    np.testing.assert_allclose(table.acc_x, walk(200).acc[:, 0])


def test_link_points_to_the_terminal_that_is_there_now(tmp_path):
    link = tmp_path / "ttyIMU"
    with Emulator(walk(), link=link, wait=True) as device:
        assert device.port == str(link)
        assert str(link.readlink()).startswith("/dev/")
    assert not link.is_symlink()
    link.write_text("mine")
    with pytest.raises(InputError, match="is not a link"):
        Emulator(walk(), link=link)
    assert link.read_text() == "mine"


def test_line_carries_a_tenth_of_its_baud_rate_in_bytes():
    with pytest.raises(InputError, match=r"Use rate=213.0, which is the highest that fits") as refused:
        Emulator("handheld", rate=214.0, baud=115200)
    assert "carries 11520" in str(refused.value)
    highest = Emulator("handheld", rate="max", baud=115200, duration=2.0)
    assert highest.source.rate == pytest.approx(213.0)
    Emulator("handheld", rate=214.0, baud=115200, speed="max", duration=2.0)
    with pytest.raises(InputError, match="the highest that fits"):
        Emulator("handheld", rate=213.0, baud=115200, speed=2.0)
    # What is sent in a second fits indeed, and one sample more would not.
    with Emulator("handheld", rate="max", baud=115200, duration=10.0, speed="max", sent=True) as device:
        read(device)
        sent = device.summary()["bytes"] / 10.0
    assert 11520 - 60 < sent <= 11520


def test_faults_by_chance_come_as_often_as_told_and_by_their_seed():
    def times(seed):
        schedule, found, t = Schedule([], {"crc": 5.0}, np.random.default_rng(seed)), [], 0.0
        while schedule.next < 200.0:
            t = schedule.next
            found += [fault.at for fault in schedule.due(t)]
        return found

    assert times(1) == times(1) != times(2)
    assert len(times(1)) == pytest.approx(1000, abs=4 * np.sqrt(1000))


def test_fault_of_several_samples_strikes_so_many_in_a_row():
    schedule = Schedule([Fault(1.0, "drop", 3.0)], {}, np.random.default_rng(0))
    struck = [bool(schedule.due(t)) for t in np.arange(0.9, 1.6, 0.1)]
    assert struck == [False, True, True, True, False, False, False]


@pytest.mark.parametrize(
    ("text", "fault"),
    [("unplug@3:1.5", Fault(3.0, "unplug", 1.5)), ("garbage@0", Fault(0.0, "garbage", FAULTS["garbage"].length))],
)
def test_faults_are_read_from_text(text, fault):
    assert parse_fault(text) == fault


@pytest.mark.parametrize("text", ["unplug", "unplug@", "unplug@-1", "crc@1:-2", "crc@1:x", "crc@inf"])
def test_other_texts_are_no_faults(text):
    with pytest.raises(InputError, match="does not read KIND@SECOND"):
        parse_fault(text)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"device": "lsm6"}, "use one of floats"),
        ({"form": "xml"}, "binary, text"),
        ({"speed": 0.0}, "speed"),
        ({"duration": 0.0}, "duration"),
        ({"rate": "max"}, "Give baud"),
        ({"faults": ["unplug@1"]}, "Give link"),
        ({"fault_rates": {"unplug": 1.0}}, "Give link"),
        ({"fault_rates": {"fire": 1.0}}, "'fire' is not known"),
        ({"on": "socket://10.0.0.1:5"}, "not this machine"),
        ({"on": "/dev/ttyUSB0"}, "Use pty or socket"),
        ({"on": "socket://127.0.0.1:0", "link": "imu"}, "no link"),
        ({"effects": {"acc.bias": None}}, "only be put into a scenario"),
        ({"device": "gy86"}, "has no mag_x"),
    ],
)
def test_what_cannot_be_emulated_is_refused(change, said):
    with pytest.raises(InputError, match=f"(?i){said}"):
        Emulator(walk(), **change)


def test_neither_scenario_nor_file_is_refused():
    with pytest.raises(InputError, match="neither a scenario nor a file"):
        Emulator("nowhere.parquet")
    with pytest.raises(InputError, match=r"acc\.bios"):
        Emulator("handheld", effects={"acc.bios": None})


def test_leaving_the_context_ends_the_thread_and_the_line():
    with Emulator("handheld", duration=60.0, wait=True) as device:
        name = device.port
    assert not [thread for thread in threading.enumerate() if thread.name == "imufit emulator"]
    assert not os.path.exists(name)  # noqa: PTH110


@pytest.mark.parametrize("loop", [True, False])
def test_rows_of_a_course_are_counted_by_their_times(loop):
    t = np.array([0.0, 0.1, 0.2, 0.35])
    course = Course(t, 0.45, 2.0, loop=loop)
    assert course.total == (18 if loop else 4)
    for row in range(int(course.total)):
        assert course.first_at(course.time(row) - 1e-6) == row
        assert course.first_at(course.time(row) + 1e-6) == min(row + 1, course.total)
    place, times = course.piece(2, course.total)
    assert (place, times.tolist()) == (slice(2, 4), [0.2, 0.35])


def test_default_clock_is_the_public_one():
    assert Clock is DeviceClock
