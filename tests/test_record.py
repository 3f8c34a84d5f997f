"""A device is recorded, whatever happens to it and to the line."""

import os
import stat
import threading
import time

import imufit
import numpy as np
import pytest
from imufit.devices.monitor import Monitor
from imufit.devices.record import LiveRows, record
from imufit.errors import InputError
from recording_device import NINE, Pty, Sender, Socket, values_of

PATIENCE = 20.0


@pytest.fixture
def pty():
    line = Pty()
    yield line
    line.close()


@pytest.fixture
def plug():
    line = Socket()
    yield line
    line.close()


class Recorder:
    """Records in a thread until `stop`."""

    def __init__(self, port, path, **options):
        self._over = threading.Event()
        self.seen = 0
        self.openings = 0
        self.lost = False
        self.texts = []
        self._outcome = []
        self._open = False
        options = {"stopped": self._over.is_set, "watch": self._watch, **options}
        self._thread = threading.Thread(target=self._run, args=(port, path, options), daemon=True)
        self._thread.start()
        self.until(lambda: self._open or self._outcome)  # opening a port discards what was sent before

    def _run(self, port, path, options):
        try:
            self._outcome.append(record(port, path, **options))
        except Exception as error:
            self._outcome.append(error)

    def _watch(self, reception, rows, texts):
        self._open = True
        self.seen += sum(part.n for part in rows)
        self.openings = reception.line.opening
        self.lost = reception.line.lost_since is not None
        self.texts += texts

    @property
    def over(self):
        return not self._thread.is_alive()

    def until(self, holds):
        end = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < end, "it did not come to that"
            assert self._thread.is_alive() or holds(), "the recorder ended"
            time.sleep(0.005)

    def result(self, stop=True):
        if stop:
            self._over.set()
        self._thread.join(PATIENCE)
        (outcome,) = self._outcome
        if isinstance(outcome, Exception):
            raise outcome
        return outcome


def readings(log):
    return np.concatenate([log.acc, log.gyr, log.mag], axis=1)


def test_what_a_device_sends_is_in_the_log_exactly(pty, tmp_path):
    path, device = tmp_path / "walk.parquet", Sender()
    recorder = Recorder(pty.port, path)
    pty.send(device.announce() + device.samples(range(100)) + device.text("half way") + device.samples(range(100, 400)))
    recorder.until(lambda: recorder.seen == 400)
    result = recorder.result()
    log = imufit.read(path)
    np.testing.assert_array_equal(readings(log), values_of(range(400)))
    np.testing.assert_allclose(log.t, np.arange(400) / 1000.0, atol=1e-9)
    assert (result.n, result.lost, result.damaged, result.gaps, result.ended) == (400, 0, 0, (), "stopped")
    assert recorder.texts == ["half way"]
    described = log.metadata.extra["recording"]
    assert described["messages"][0]["text"] == "half way"
    assert described["clock"]["source"] == "device"
    assert log.metadata.sensor == result.device == "nine axes"
    assert result.to_dict()["cpu_share"] > 0.0
    assert [file.name for file in tmp_path.iterdir()] == ["walk.parquet"]


def test_samples_sent_before_the_device_said_what_they_are_are_kept(pty, tmp_path):
    device = Sender()
    head = device.announce()
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    pty.send(b"garbage\0" + device.samples(range(50)) + head + device.samples(range(50, 60)))
    recorder.until(lambda: recorder.seen == 60)
    recorder.result()
    np.testing.assert_array_equal(readings(imufit.read(tmp_path / "a.parquet")), values_of(range(60)))


def test_lost_and_damaged_frames_leave_marked_gaps(pty, tmp_path):
    device = Sender()
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    wire = device.announce() + device.samples(range(100))
    device.samples(range(100, 130))  # never arrive
    wire += device.samples(range(130, 200))
    broken = bytearray(device.samples([200]))
    broken[10] ^= 1
    wire += bytes(broken) + device.samples(range(201, 300))
    pty.send(wire)
    recorder.until(lambda: recorder.seen == 269)
    result = recorder.result()
    kept = [*range(100), *range(130, 200), *range(201, 300)]
    log = imufit.read(tmp_path / "a.parquet")
    np.testing.assert_array_equal(readings(log), values_of(kept))
    np.testing.assert_allclose(log.t, np.array(kept) / 1000.0, atol=1e-9)
    assert [(g.reason, g.frames) for g in result.gaps] == [("lost frames", 30), ("lost frames", 1)]
    assert result.gaps[0].t_start == pytest.approx(0.099)
    assert result.gaps[0].t_end == pytest.approx(0.130)
    assert (result.lost, result.damaged) == (31, 1)


def test_a_line_that_is_unplugged_in_a_frame_goes_on_when_it_is_back(plug, tmp_path):
    device, path = Sender(), tmp_path / "a.parquet"
    recorder = Recorder(plug.port, path)
    plug.plug()
    plug.send(device.announce() + device.samples(range(100)) + device.samples([100])[:20])
    recorder.until(lambda: recorder.seen == 100)
    plug.unplug(gone=True)
    recorder.until(lambda: recorder.lost)
    plug.plug()
    plug.send(device.samples([101])[5:] + device.samples(range(102, 200)))
    recorder.until(lambda: recorder.seen == 198)
    result = recorder.result()
    log = imufit.read(path)
    np.testing.assert_array_equal(readings(log), values_of([*range(100), *range(102, 200)]))
    assert np.diff(log.t).min() > 0.0
    (gap,) = result.gaps
    assert (gap.reason, gap.frames, gap.t_start, gap.t_end) == ("unplugged", 2, log.t[99], log.t[100])


def test_a_pseudo_terminal_that_is_gone_is_not_looked_for_in_those_of_others(tmp_path):
    pty, device = Pty(), Sender()
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    pty.send(device.announce() + device.samples(range(10)))
    recorder.until(lambda: recorder.seen == 10)
    pty.close()
    recorder.until(lambda: recorder.lost)
    others = [Pty()]
    while others[-1].port != pty.port and len(others) < 50:  # the system gives free names out again
        others.append(Pty())
    assert others[-1].port == pty.port
    time.sleep(0.5)
    assert recorder.lost
    assert recorder.openings == 0
    recorder.result()
    assert imufit.read(tmp_path / "a.parquet").n == 10
    for other in others:
        other.close()


def test_a_line_is_open_again_at_once_however_long_it_was_away(plug, tmp_path):
    recorder = Recorder(plug.port, tmp_path / "a.parquet")
    plug.plug()
    device = Sender()
    plug.send(device.announce() + device.samples(range(10)))
    recorder.until(lambda: recorder.seen == 10)
    plug.unplug(gone=True)
    time.sleep(3.3)
    back = time.monotonic()
    plug.plug()
    assert time.monotonic() - back < 0.3
    plug.send(device.samples(range(10, 20)))
    recorder.until(lambda: recorder.seen == 20)
    assert recorder.result().gaps[0].reason == "unplugged"


def test_a_device_is_asked_what_its_samples_hold_until_it_says_so(pty, tmp_path):
    device = Sender()
    head, early = device.announce(), device.samples(range(50))
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    pty.send(early)
    assert pty.heard(0.25) in (b"\0" * 2, b"\0" * 3)
    pty.send(head)
    recorder.until(lambda: recorder.seen == 50)
    pty.heard(0.05)
    assert pty.heard(0.25) == b""
    recorder.result()


def test_a_device_that_is_said_to_send_text_is_not_asked(pty, tmp_path):
    recorder = Recorder(pty.port, tmp_path / "a.parquet", form="text")
    assert pty.heard(0.25) == b""
    pty.send(TEXT.encode() + text_rows(range(10)))
    recorder.until(lambda: recorder.seen >= 9)
    recorder.result()


def test_what_arrived_before_a_line_broke_is_not_lost_with_it(plug, tmp_path):
    """The device sends its last rows and is gone at once: they are read all the same."""
    device = Sender()
    recorder = Recorder(plug.port, tmp_path / "a.parquet", give_up=0.3)
    plug.plug()
    plug.send(device.announce() + device.samples(range(2000)))
    plug.unplug(gone=True)
    result = recorder.result(stop=False)
    assert result.ended == "line lost"
    np.testing.assert_array_equal(readings(imufit.read(tmp_path / "a.parquet")), values_of(range(2000)))
    assert result.gaps == (), "it ends there"


def test_a_line_that_was_away_when_a_recording_was_stopped_is_told(plug, tmp_path):
    device = Sender()
    recorder = Recorder(plug.port, tmp_path / "a.parquet")
    plug.plug()
    plug.send(device.announce() + device.samples(range(20)))
    recorder.until(lambda: recorder.seen == 20)
    plug.unplug(gone=True)
    recorder.until(lambda: recorder.lost)
    result = recorder.result()
    (gap,) = result.gaps
    assert (gap.reason, gap.t_start) == ("unplugged", result.duration_s)
    assert gap.t_end > gap.t_start


def test_a_device_that_starts_anew_goes_on_in_the_same_log(pty, tmp_path):
    device = Sender()
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    pty.send(device.announce() + device.samples(range(5000, 5200)))
    recorder.until(lambda: recorder.seen == 200)
    time.sleep(0.3)
    device.reset()
    pty.send(device.announce() + device.samples(range(100)))
    recorder.until(lambda: recorder.seen == 300)
    result = recorder.result()
    log = imufit.read(tmp_path / "a.parquet")
    np.testing.assert_array_equal(readings(log), values_of([*range(5000, 5200), *range(100)]))
    (gap,) = result.gaps
    assert gap.reason == "reset"
    assert gap.t_end - gap.t_start > 0.2, "as long as it was by the clock of the host"
    assert result.clock.runs == 2


def test_a_device_that_comes_back_with_fewer_columns_goes_on_too(pty, tmp_path):
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    device = Sender()
    pty.send(device.announce() + device.samples(range(50)))
    recorder.until(lambda: recorder.seen == 50)
    six = Sender(start=2, columns=NINE[:6], name="six axes")
    pty.send(six.announce() + six.samples(range(50)))
    recorder.until(lambda: recorder.seen == 100)
    assert recorder.result().n == 100
    log = imufit.read(tmp_path / "a.parquet")
    np.testing.assert_array_equal(log.acc, values_of([*range(50), *range(50)])[:, :3])
    assert np.isnan(log.mag[50:]).all()


def test_columns_that_make_no_log_are_refused_at_once(pty, tmp_path):
    device = Sender(columns=[("acc_x", 1.0, 0.0, 0.0), ("acc_y", 1.0, 0.0, 0.0)])
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    pty.send(device.announce() + device.samples(range(5)))
    with pytest.raises(InputError, match="no log can be made of what the device nine axes sends: column acc_z"):
        recorder.result(stop=False)
    assert list(tmp_path.iterdir()) == []


def test_columns_that_make_no_log_do_not_cost_what_came_before(pty, tmp_path):
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    device = Sender()
    pty.send(device.announce() + device.samples(range(50)))
    recorder.until(lambda: recorder.seen == 50)
    other = Sender(start=2, columns=NINE[:2])
    pty.send(other.announce() + other.samples(range(5)))
    with pytest.raises(InputError, match=r"column acc_z.*the 50 rows before that are in .*a\.parquet"):
        recorder.result(stop=False)
    assert imufit.read(tmp_path / "a.parquet").n == 50


def test_columns_are_mapped_as_those_of_a_file_are(pty, tmp_path):
    device = Sender(columns=[("AccX", 1.0, 0.0, 0.0), ("AccY", 1.0, 0.0, 0.0), ("AccZ", 1.0, 0.0, 0.0)])
    mapping = {"acc_x": "-AccY[g]", "acc_y": "AccX[g]", "acc_z": "AccZ[g]"}
    recorder = Recorder(pty.port, tmp_path / "a.csv", mapping=mapping)
    pty.send(device.announce() + device.samples(range(5)))
    recorder.until(lambda: recorder.seen == 5)
    recorder.result()
    log = imufit.read(tmp_path / "a.csv")
    sent = np.round(values_of(range(5)))
    np.testing.assert_allclose(log.acc, 9.80665 * np.stack([-sent[:, 1], sent[:, 0], sent[:, 2]], axis=1))


TEXT = "t_ms,acc_x,acc_y,acc_z,motor_current\n"


def text_rows(numbers):
    return "".join(f"{10 * k},{0.1 * k:.1f},0,9.81,{k}\n" for k in numbers).encode()


def test_lines_of_text_are_recorded_with_the_time_they_name(pty, tmp_path):
    recorder = Recorder(pty.port, tmp_path / "a.parquet")
    pty.send(b"MPU6050 found\n" + TEXT.encode() + text_rows(range(100)) + b"10,0.1,0\n" + text_rows(range(100, 150)))
    recorder.until(lambda: recorder.seen == 150)
    result = recorder.result()
    log = imufit.read(tmp_path / "a.parquet")
    np.testing.assert_allclose(log.t, np.arange(150) * 0.01, atol=1e-9)
    np.testing.assert_allclose(log.acc[:, 0], 0.1 * np.arange(150), atol=1e-9)
    np.testing.assert_array_equal(log.covariates["motor_current"], np.arange(150))
    assert (result.form, result.damaged) == ("text", 1)
    assert [(g.reason, g.frames) for g in result.gaps] == [("lost frames", 1)]
    assert recorder.texts == ["MPU6050 found"]


def test_text_without_a_header_takes_the_one_that_is_given(pty, tmp_path):
    recorder = Recorder(pty.port, tmp_path / "a.parquet", header=TEXT.strip())
    pty.send(text_rows(range(50)))
    recorder.until(lambda: recorder.seen == 49)  # the first line may lack its beginning
    recorder.result()
    assert imufit.read(tmp_path / "a.parquet").n == 49


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (b"", "nothing came from the device"),
        (b"\x99" * 3000, "3000 bytes came, but no whole frame and no rows under a header: check baud"),
        (text_rows(range(9)), "no header that names them: give one, header='t_ms"),
        (b"no sensor on the bus\n" * 3, "the device reports 'no sensor on the bus'"),
        (Sender().samples(range(7)), "7 samples came, but no announcement"),
        (Sender().announce(), "announced itself, but sent no sample"),
    ],
)
def test_why_nothing_was_recorded_is_said(pty, tmp_path, sent, said):
    recorder = Recorder(pty.port, tmp_path / "a.parquet", duration=0.4)
    pty.send(sent)
    with pytest.raises(InputError, match=said):
        recorder.result(stop=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("port", "said"),
    [
        (
            "/dev/no_such_port",
            "the port /dev/no_such_port does not exist. (Ports here|This machine has no serial port)",
        ),
        ("/dev/null", "cannot be opened"),
        ("socket://127.0.0.1:9", "Start what is to listen there first"),
        ("sockets://127.0.0.1:9", "Write socket://HOST:PORT"),
    ],
)
def test_a_port_that_cannot_be_opened_is_said(tmp_path, port, said):
    with pytest.raises(InputError, match=said):
        record(port, tmp_path / "a.parquet")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(pty, tmp_path):
    log, part = tmp_path / "a.parquet", tmp_path / "a.parquet.part"
    log.write_text("precious")
    with pytest.raises(InputError, match="exists already"):
        record(pty.port, log, duration=0.1)
    log.unlink()
    part.write_text("precious")
    with pytest.raises(InputError, match=r"Run imufit.devices.record.recover\('.*a\.parquet\.part'\) first"):
        record(pty.port, log, duration=0.1, force=True)
    assert part.read_text() == "precious"
    (tmp_path / "b.toml").write_text("effects = []")
    with pytest.raises(InputError, match="in the way"):
        record(pty.port, tmp_path / "b.csv", duration=0.1)


def test_a_port_in_use_is_said(pty, tmp_path):
    with LiveRows(pty.port), pytest.raises(InputError, match="is in use"):
        record(pty.port, tmp_path / "a.parquet")


def test_force_replaces_the_log(pty, tmp_path):
    (tmp_path / "a.parquet").write_text("old")
    device = Sender()
    recorder = Recorder(pty.port, tmp_path / "a.parquet", force=True)
    pty.send(device.announce() + device.samples(range(5)))
    recorder.until(lambda: recorder.seen == 5)
    recorder.result()
    assert imufit.read(tmp_path / "a.parquet").n == 5


def test_a_disk_that_is_full_ends_the_recording_and_keeps_what_is_written(pty, tmp_path, monkeypatch):
    room = [60_000]
    write = imufit.devices.record.part.os.write

    def write_some(file, data):
        if not stat.S_ISREG(os.fstat(file).st_mode):  # the line of the device is not on the disk
            return write(file, data)
        if len(data) > room[0]:
            if room[0] > 0:  # as a disk does: what fits is written, then nothing
                room[0] -= (done := write(file, data[: room[0]]))
                return done
            raise OSError(28, "No space left on device")
        room[0] -= (done := write(file, data))
        return done

    monkeypatch.setattr(imufit.devices.record.part.os, "write", write_some)
    monkeypatch.setattr(imufit.devices.record.journal, "EVERY", 0.0)
    recorder, device = Recorder(pty.port, tmp_path / "a.parquet"), Sender()
    pty.send(device.announce())
    for k in range(100):
        if recorder.over:
            break
        pty.send(device.samples(range(20 * k, 20 * k + 20)))
        recorder.until(lambda k=k: recorder.over or recorder.seen >= 20 * k + 20)
    with pytest.raises(InputError, match=r"No space left on device.*rows before that are in .*a\.parquet"):
        recorder.result(stop=False)
    log = imufit.read(tmp_path / "a.parquet")
    assert log.n > 100
    np.testing.assert_array_equal(readings(log), values_of(range(log.n)))
    assert log.metadata.extra["recording"]["ended"] == "disk full"


def test_a_log_that_cannot_be_written_leaves_the_part_and_names_the_command(pty, tmp_path, monkeypatch):
    def full(*_arguments):
        raise OSError(28, "No space left on device")

    recorder, device = Recorder(pty.port, tmp_path / "a.parquet"), Sender()
    pty.send(device.announce() + device.samples(range(30)))
    recorder.until(lambda: recorder.seen == 30)
    monkeypatch.setattr(imufit.whole_file.os, "fsync", full)
    with pytest.raises(
        InputError, match=r"30 rows are safe in .*a\.parquet\.part.*Make room, then run imufit.devices.record.recover"
    ):
        recorder.result()
    assert [file.name for file in tmp_path.iterdir()] == ["a.parquet.part"], "nothing half-made is left"
    monkeypatch.undo()
    assert imufit.devices.record.recover(tmp_path / "a.parquet.part").n == 30


def test_live_rows_are_what_a_recording_has(pty):
    device, batches = Sender(), []
    with LiveRows(pty.port, idle=True, stopped=lambda: sum(b["t"].size for b in batches) == 200) as rows:
        pty.send(device.text("hello") + device.announce() + device.samples(range(100)))
        sent = 100
        for batch in rows:
            batches.append(batch)
            if sum(b["t"].size for b in batches) == 100 == sent:
                pty.send(device.samples(range(100, 200)))
                sent = 200
        assert rows.take_texts() == ["hello"]
        assert rows.name == "nine axes"
        assert rows.counts["samples"] == 200
    columns = [name for name, *_ in NINE]
    got = np.stack([np.concatenate([b[name] for b in batches if b["t"].size]) for name in columns], axis=1)
    np.testing.assert_array_equal(got, values_of(range(200)))
    t = np.concatenate([b["t"] for b in batches])
    assert t[0] == 0.0
    np.testing.assert_allclose(np.diff(t), 0.001, rtol=0.01)


def lying(n):
    """Values of a sensor at rest with z up, the field pointing north and down."""
    return np.tile([0.0, 0.0, 9.8125, 0.0, 0.0, 0.0, 20.0, 0.0, 40.0], (n, 1))


def test_the_monitor_shows_several_filters_at_once(pty, monkeypatch):
    monkeypatch.setattr("recording_device.values_of", lambda numbers: lying(len(numbers)))
    device, states = Sender(), []
    monitor = Monitor(pty.port, every=0.02, stopped=lambda: bool(states) and states[-1].n == 60)
    with monitor:
        pty.send(device.announce() + device.samples(range(60)))
        for state in monitor:
            states.append(state)
    last = states[-1]
    assert last.n == 60
    assert list(last.angles) == ["triad", "mahony", "hybrid"]
    for roll, pitch, _ in last.angles.values():
        assert abs(np.cos(roll)) == pytest.approx(1.0, abs=1e-3)
        assert np.sin(pitch) == pytest.approx(0.0, abs=0.03)
    assert last.to_dict()["filters"]["triad"].keys() == {"roll_deg", "pitch_deg", "yaw_deg"}


def test_the_monitor_takes_a_model_out_first(pty, monkeypatch):
    monkeypatch.setattr("recording_device.values_of", lambda numbers: lying(len(numbers)))
    model = imufit.SensorModel(["acc.bias"], {"acc.bias": {"x": 0.0, "y": -9.8125, "z": 9.8125}})
    device, states = Sender(columns=NINE[:6]), []
    with Monitor(pty.port, ["accel"], model=model, stopped=lambda: bool(states) and states[-1].n == 50) as monitor:
        pty.send(device.announce() + device.samples(range(50)))
        for state in monitor:
            states.append(state)
    roll = states[-1].to_dict()["filters"]["accel"]["roll_deg"]
    assert abs(roll) == pytest.approx(90.0, abs=0.1)


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (imufit.SensorModel(["gyr.delay"]), "gyr.delay needs the rows around a row"),
        (imufit.SensorModel(["acc.bias_temperature"]), "needs temperature_mean"),
    ],
)
def test_a_model_that_needs_more_than_the_present_row_is_refused(pty, model, said):
    with pytest.raises(InputError, match=said):
        Monitor(pty.port, model=model)


def test_a_filter_without_its_sensor_is_refused(pty):
    device = Sender(columns=NINE[:3])
    with Monitor(pty.port, ["mahony"]) as monitor:
        pty.send(device.announce() + device.samples(range(50)))
        with pytest.raises(InputError, match="mahony needs gyr"):
            list(monitor)
