"""A device followed for the studio: rolling rows, rests, recordings of a running stream, the guide."""

import asyncio
import time

import numpy as np
import pytest
from imufit.calibrating import calibrate
from imufit.devices.emulate import Emulator
from imufit.devices.emulate.data_sheet import data_sheet_errors
from imufit.devices.record import LiveRows, Recorder, recover
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from imufit.log import read
from imufit.studio.live.device import Device
from imufit.studio.live.guided import held_side, how_to_lay
from imufit.studio.live.listening import SENSOR, Listening, Source, free_name, in_sentences, shown_state
from imufit.studio.live.panels import groups, panel
from imufit.studio.live.rolling import Rolling

PATIENCE = 30.0


def until(holds):
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, "it did not come to that"
        time.sleep(0.02)


@pytest.fixture
def followed():
    made = []

    def follow(source):
        listening = Listening(source)
        made.append(listening)
        listening.open()
        return listening

    yield follow
    for listening in made:
        listening.close()


# --- rolling rows


def test_rolling_keeps_the_last_rows_in_constant_memory_and_their_extremes():
    rolling = Rolling(("a", "b"), rows=1000)
    size = rolling.bytes
    rng, t, kept = np.random.default_rng(0), 0.0, []
    for _ in range(200):
        n = int(rng.integers(1, 90))
        times = t + 0.01 * np.arange(1, n + 1)
        values = rng.normal(size=n)
        rolling.add({"t": times, "a": values})
        kept.append(np.column_stack([times, values]))
        t = times[-1]
    rows = np.concatenate(kept)[-1000:]
    assert rolling.bytes == size
    assert rolling.span == (rows[0, 0], rows[-1, 0])
    points = rolling.window(["a", "b"], 1e9, 50)
    assert points["a"].t.size <= 100
    assert (points["a"].low.min(), points["a"].high.max()) == (rows[:, 1].min(), rows[:, 1].max())
    assert points["b"].t.size == 0
    few = rolling.window(["a"], 0.1, 50)["a"]
    np.testing.assert_array_equal(few.low, rows[rows[:, 0] >= rows[-1, 0] - 0.1][:, 1])


def test_batch_of_more_rows_than_are_kept_leaves_its_end():
    rolling = Rolling(("a",), rows=10)
    rolling.add({"t": np.arange(3.0), "a": np.arange(3.0)})
    rolling.add({"t": np.arange(3.0, 100.0), "a": np.arange(3.0, 100.0)})
    assert rolling.span == (90.0, 99.0)
    assert rolling.window(["a"], 100.0, 50)["a"].low.tolist() == list(range(90, 100))


def test_panel_has_units_and_degrees_and_every_sensor_one_panel():
    columns = ("acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z", "temp", "<b>speed</b>", "ref_qw")
    assert [title for title, _ in groups(columns)] == ["accelerometer", "gyroscope", "temperature", "<b>speed</b>"]
    rolling = Rolling(columns)
    rolling.add({"t": np.arange(3.0), "gyr_x": np.full(3, np.pi)})
    figure = panel(rolling, "<b>speed</b>", ("gyr_x", "gyr_y", "gyr_z"), 10.0, [])
    assert figure["layout"]["yaxis"]["title"]["text"] == "deg/s"
    assert figure["data"][0]["y"] == [180.0, 180.0, 180.0]
    assert "<b>" not in figure["layout"]["title"]["text"]


# --- the device


def test_device_is_followed_and_recorded_while_the_stream_runs_on(followed, tmp_path):
    listening = followed(Source(scenario="six_sides", speed=5.0))
    until(lambda: listening.state is not None and listening.state.n > 300)
    assert listening.rest is not None
    before = listening.state.n
    path = tmp_path / "one.parquet"
    listening.record(path)
    until(lambda: listening.recorded.rows > 200)
    assert path.with_name("one.parquet.part").exists()
    listening.stop()
    until(lambda: not listening.recorded.running)
    log = read(path)
    assert listening.recorded.rows == log.n > 200
    assert str(log.n) in listening.recorded.message
    assert not list(tmp_path.glob("*.part*"))
    assert log.metadata.to_mapping()["recording"]["gaps"] == []
    until(lambda: listening.state.n > before + log.n)
    # a second one begins where a person says so, and the first one is not overwritten
    listening.record(path)
    until(lambda: not listening.recorded.running)
    assert "exists already" in listening.recorded.message
    assert free_name(tmp_path, "one-2").name == "one-2-1.parquet"
    figures = shown_state(listening.state)
    assert figures["rate"].endswith("Hz")
    assert figures["lost"] == "0"
    until(lambda: len(listening.rests) >= 2)
    assert all(rest.end - rest.begin > 1.0 for rest in listening.rests if rest.good)


def test_recording_stopped_before_its_first_row_has_ended(followed, tmp_path):
    listening = followed(Source(scenario="six_sides", speed=5.0))
    path = tmp_path / "none.parquet"
    listening.record(path)
    listening.stop()
    until(lambda: not listening.recorded.running)
    until(lambda: listening.state is not None and listening.state.n > 100)
    assert not listening.recorded.running
    assert not path.exists() or listening.recorded.made


def test_guide_leads_through_six_sides_to_a_saved_model(followed, tmp_path):
    listening = followed(Source(scenario="six_sides", speed=25.0))
    until(lambda: listening.rolling is not None)
    path = tmp_path / "sides.parquet"
    listening.guide(path)
    asked = set()

    def done():
        asked.add(listening.stage.side if listening.stage is not None else None)
        return bool(listening.calibrated)

    until(done)
    assert len(asked - {None}) >= 3
    assert any("accelerometer" in sentence.lower() for sentence in listening.calibrated)
    assert path.exists()
    assert (tmp_path / "sides.toml").exists()
    assert listening.stage is None
    # The values are those of the errors that the emulated device was given.
    given = data_sheet_errors(SENSOR)
    found = [item for item in listening.estimated if item.effect in ("acc.bias", "acc.scale")]
    assert len(found) == 6
    for item in found:
        assert abs(item.value - given[item.effect][item.name]) < 5.0 * item.standard_error


def test_a_calibration_names_the_sensors_that_have_an_error_and_once_the_others():
    result = calibrate(simulate("six_sides", {"acc.bias": None}, 1, duration=60.0, rate=50.0).to_log())
    first, others = in_sentences(result)
    assert first.startswith("accelerometer: |f| at rest less g")
    assert others.startswith("Gyroscope and magnetometer show no error beyond their standard errors")
    assert "need not be used" not in others


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_without_errors_is_said_to_show_none(seed):
    result = calibrate(simulate("six_sides", {}, seed, duration=60.0, rate=50.0).to_log())
    assert in_sentences(result) == (
        "Accelerometer, gyroscope and magnetometer show no error beyond their standard errors: the readings are right "
        "as they are. The model need not be used.",
    )


def test_port_that_cannot_be_opened_is_refused_in_words():
    for source, said in ((Source(port="/dev/nowhere"), "does not exist"), (Source(), "no port is named")):
        listening = Listening(source)
        with pytest.raises(InputError, match=said):
            listening.open()
        listening.close()


def test_closing_ends_a_recording_and_keeps_its_rows(followed, tmp_path):
    listening = followed(Source(scenario="handheld"))
    path = tmp_path / "kept.csv"
    until(lambda: listening.rolling is not None)
    listening.record(path)
    until(lambda: listening.recorded.rows > 20)
    listening.close()
    assert read(path).n >= 20
    assert not listening.running


# --- the recorder of a running stream


def test_recorder_of_a_running_stream_is_as_safe_as_any(tmp_path):
    """A part that is never finished makes the log of its rows, and frames lost before it began do not count."""
    held, path = {}, tmp_path / "crashed.parquet"

    def watch(reception, parts):
        if "recorder" not in held and reception.counts["samples"] > 150:
            assert reception.counts["lost"] == 1
            held["recorder"] = Recorder(path, reception)
        if "recorder" in held:
            held["recorder"].take(parts, [])

    with (
        Emulator("handheld", on="socket://127.0.0.1:0", duration=4.0, speed=4.0, faults=["drop@0.5"]) as device,
        LiveRows(device.port, duration=PATIENCE, give_up=0.2, watch=watch) as rows,
    ):
        for _ in rows:
            pass
    held["recorder"]._journal.close()  # the files as the operating system closes those of a killed process
    n = held["recorder"].n
    assert n > 100
    recording = recover(tmp_path / "crashed.parquet.part")
    assert recording.n == n == read(path).n
    assert recording.lost == 0


def test_a_side_is_ticked_from_the_end_of_its_hold_until_the_device_rests_on_another():
    seen = [
        ("+x", 0.6, False, None),
        ("+x", 1.0, False, "+x"),
        # The device is lifted, and the guide has not judged yet.
        (None, 0.0, True, "+x"),
        ("+x", 0.1, False, "+x"),
        ("-z", 0.1, False, None),
        ("-z", 1.0, False, "-z"),
    ]
    held = None
    for side, progress, moving, expected in seen:
        held = held_side(held, side, progress, moving=moving)
        assert held == expected


def test_a_device_is_seen_from_other_pages_and_ended_there(tmp_path):
    async def follow() -> None:
        device = Device()
        assert device.state == ""
        await device.connect(Source(scenario="six_sides", speed=20.0))
        assert device.state == "Live: listening"
        device.listening.record(tmp_path / "walk.parquet")
        assert device.state == "Live: recording"
        until(lambda: device.recorded.rows > 0)
        # The recording ends first, and the device stays.
        await device.end()
        until(lambda: not device.recorded.running)
        assert device.state == "Live: listening"
        await device.end()
        assert device.state == ""

    asyncio.run(follow())


@pytest.mark.parametrize(("side", "words"), [("+x", "x arrow points up"), ("-z", "z arrow points down")])
def test_the_guide_says_which_arrow_points_where(side, words):
    assert words in how_to_lay(side)
