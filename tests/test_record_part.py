"""What a recording leaves on the disk: whole batches come back from whatever a crash made of the file."""

import concurrent.futures
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import imufit.devices.record.part
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.devices.record import recover
from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.part import PartFile, part_path, parts_of, read_part
from imufit.errors import InputError

COLUMNS = ("acc_x", "acc_y", "acc_z", "temp")
DEVICE = Announced("binary", "d", 1e-6, COLUMNS, (20.0, 20.0, 20.0, 0.0), (100.0,) * 4)
ABOUT = Circumstances("/dev/x", "2026-01-02T03:04:05+00:00", 100.0)


def rows(first, n, announced=DEVICE, start=1):
    k = np.arange(first, first + n)
    return Arrived(
        announced,
        100.0 + k * 0.01,
        np.zeros(n, np.uint32),
        np.full(n, start, np.uint8),
        (k * 10_000).astype(np.uint32),
        k.astype(np.uint16),
        np.zeros(n, np.uint32),
        np.stack([0.5 * k, -k, np.full(n, 9.5), np.full(n, np.nan)], axis=1)[:, : len(announced.columns)],
    )


def told(n):
    return {"counts": {"samples": n, "damaged": 3}, "now": 100.0, "lost_since": None}


def written(path, sizes, announced=DEVICE, first=0, start=1):
    """Write batches; return where each ends."""
    file, ends = PartFile(path), []
    file.begin(announced, ABOUT)
    for n in sizes:
        file.write(rows(first, n, announced, start), told(first + n))
        first += n
        ends.append(path.stat().st_size)
    file.close()
    return ends


WHOLE = [30, 1, 250, 7, 40]
with tempfile.TemporaryDirectory() as folder:
    ENDS = written(Path(folder) / "a.parquet.part", WHOLE)
    BYTES = (Path(folder) / "a.parquet.part").read_bytes()


def test_rows_come_back_bit_by_bit(tmp_path):
    path = tmp_path / "a.part"
    path.write_bytes(BYTES)
    part = read_part(path)
    want = rows(0, sum(WHOLE))
    for name in ("arrival", "opening", "start", "stamps", "sequence", "lost", "values"):
        np.testing.assert_array_equal(getattr(part.rows, name), getattr(want, name))
        assert getattr(part.rows, name).dtype == getattr(want, name).dtype
    assert part.announced == DEVICE
    assert part.about == ABOUT
    assert (part.told[-1], part.dropped) == (told(sum(WHOLE)), 0)


CUTS = st.one_of(
    st.integers(0, len(BYTES)),
    st.builds(lambda end, by: min(max(end + by, 0), len(BYTES)), st.sampled_from([0, *ENDS]), st.integers(-20, 20)),
)


@settings(max_examples=150, deadline=None)
@given(cut=CUTS, tail=st.sampled_from(["nothing", "zeros", "noise"]), seed=st.integers(0, 99))
def test_every_whole_batch_comes_back_wherever_the_file_ends(cut, tail, seed):
    # a power cut may leave zeros, or anything, where the length had been written but the data had not
    more = {"nothing": b"", "zeros": bytes(4096), "noise": np.random.default_rng(seed).bytes(500)}[tail]
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "a.parquet.part"
        path.write_bytes(BYTES[:cut] + more)
        batches = sum(end <= cut for end in ENDS)
        try:
            part = read_part(path)
        except InputError:
            part = None
            assert batches == 0
            assert tail != "nothing", "a cut alone is no reason"
        if batches == 0:
            assert part is None or part.rows is None
            return
        assert part.rows.n == sum(WHOLE[:batches])
        np.testing.assert_array_equal(part.rows.values, rows(0, part.rows.n).values)
        assert part.dropped == cut + len(more) - ENDS[batches - 1]


@settings(max_examples=100, deadline=None)
@given(st.integers(0, len(BYTES) - 1), st.integers(1, 255))
def test_a_wrong_byte_never_makes_wrong_rows(at, bits):
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "a.parquet.part"
        data = bytearray(BYTES)
        data[at] ^= bits
        path.write_bytes(data)
        try:
            part = read_part(path)
        except InputError:
            assert at < ENDS[0]
            return
        n = 0 if part is None or part.rows is None else part.rows.n
        assert n >= sum(WHOLE[: sum(end <= at for end in ENDS)]) if part is not None else at < ENDS[0]
        if n:
            np.testing.assert_array_equal(part.rows.values, rows(0, n).values)
            np.testing.assert_array_equal(part.rows.stamps, rows(0, n).stamps)


def test_recover_makes_the_log_and_says_what_is_missing(tmp_path):
    path = tmp_path / "a.parquet.part"
    path.write_bytes(BYTES[: ENDS[2] + 100])
    result = recover(path)
    log = imufit.read(tmp_path / "a.parquet")
    assert result.n == log.n == 281
    np.testing.assert_allclose(log.t, np.arange(281) * 0.01, atol=1e-9)
    np.testing.assert_array_equal(log.acc[:, 0], 0.5 * np.arange(281))
    assert "a.parquet.part ends with 100 bytes of a batch that is not whole" in " ".join(result.notes)
    described = log.metadata.extra["recording"]
    assert described["ended"] == result.ended == "crash"
    assert described["began"] == result.began == "2026-01-02T03:04:05.000000+00:00"
    assert described["ranges"] == {"acc_x": 20.0, "acc_y": 20.0, "acc_z": 20.0}
    assert log.metadata.sensor == "d"
    assert result.damaged == 3
    assert list(tmp_path.iterdir()) == [tmp_path / "a.parquet"], "the part is not needed any more"


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".npz"])
def test_other_columns_go_to_another_part_and_all_of_them_to_the_log(tmp_path, suffix):
    log_path = tmp_path / f"a{suffix}"
    written(part_path(log_path), [20])
    more = Announced("binary", "d", 1e-6, COLUMNS[:3], (), ())
    written(part_path(log_path, 2), [30], more, first=50, start=2)
    assert len(parts_of(log_path)) == 2
    result = recover(log_path, keep=True)
    assert len(parts_of(log_path)) == 2
    log = imufit.read(log_path)
    assert (result.n, log.n) == (50, 50)
    np.testing.assert_array_equal(log.acc[:, 0], 0.5 * np.array([*range(20), *range(50, 80)]))
    (gap,) = result.gaps
    assert (gap.reason, gap.t_start, gap.t_end) == ("reset", pytest.approx(0.19), pytest.approx(0.5))
    assert log.metadata.extra["recording"]["gaps"] == [gap.to_dict()]
    with pytest.raises(InputError, match="exists already"):
        recover(log_path)


def test_what_stands_in_a_sidecar_beforehand_is_kept(tmp_path):
    (tmp_path / "a.toml").write_text('frame = "ENU"\n[recording]\nport = "of another one"\n')
    written(part_path(tmp_path / "a.csv"), [20])
    recover(tmp_path / "a.csv")
    metadata = imufit.read(tmp_path / "a.csv").metadata
    assert metadata.frame == "ENU"
    assert metadata.extra["recording"]["port"] == "/dev/x"


def test_a_file_of_another_kind_in_the_place_of_the_sidecar_is_not_overwritten(tmp_path):
    (tmp_path / "a.toml").write_text("effects = []\n")
    written(part_path(tmp_path / "a.csv"), [20])
    with pytest.raises(InputError, match="in the way"):
        recover(tmp_path / "a.csv")
    assert (tmp_path / "a.toml").read_text() == "effects = []\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "no whole batch"),
        (BYTES[:700], "no whole batch"),
        (BYTES[: ENDS[0] - 1], "no whole batch"),
        (b"t,acc_x\n1,2\n", "not a part of a recording"),
        (b"PAR1 and so on", "not a part of a recording"),
    ],
)
def test_what_holds_nothing_is_refused_and_stays(tmp_path, content, said):
    path = tmp_path / "a.parquet.part"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        recover(path)
    assert path.read_bytes() == content


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(InputError, match=r"walk\.parquet\.part does not exist"):
        recover(tmp_path / "walk.parquet")


def test_a_part_that_is_still_written_is_left_alone(tmp_path):
    file = PartFile(part_path(tmp_path / "a.parquet"))
    file.begin(DEVICE, ABOUT)
    file.write(rows(0, 5), told(5))
    with pytest.raises(InputError, match="still running"):
        recover(tmp_path / "a.parquet")
    file.close()
    assert recover(tmp_path / "a.parquet").n == 5


def test_a_part_read_as_a_log_names_the_command(tmp_path):
    path = tmp_path / "a.parquet.part"
    path.write_bytes(BYTES)
    with pytest.raises(InputError, match=r"imufit.devices.record.recover\("):
        imufit.read(path)


def fill(path, limit, sender):
    """Write until the file may not grow any more; tell the rows that are in it."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    file, n = PartFile(path), 0
    file.begin(DEVICE, ABOUT)
    try:
        while True:
            file.write(rows(n, 50), told(n + 50))
            n += 50
    except OSError:
        sender.send((n, path.stat().st_size))


@pytest.mark.parametrize("limit", [20_011])
def test_a_full_disk_leaves_whole_batches(tmp_path, limit):
    path = part_path(tmp_path / "a.parquet")
    receiver, sender = multiprocessing.get_context("spawn").Pipe(duplex=False)
    process = multiprocessing.get_context("spawn").Process(target=fill, args=(path, limit, sender))
    process.start()
    assert receiver.poll(60)
    n, size = receiver.recv()
    process.join()
    assert 0 < size <= limit
    part = read_part(path)
    assert (part.rows.n, part.dropped) == (n, 0)


def test_what_is_written_is_put_on_the_disk_each_second(tmp_path, monkeypatch):
    now, calls = [1000.0], []
    monkeypatch.setattr(imufit.devices.record.part.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(imufit.devices.record.part.os, "fsync", lambda _file: calls.append(now[0]))
    file = PartFile(tmp_path / "a.part")
    file.begin(DEVICE, ABOUT)
    for _ in range(14):
        now[0] += 0.25
        file.write(rows(0, 5), told(5))
        concurrent.futures.wait([file._syncing] if file._syncing else [])
    file.close()
    assert np.diff([1000.0, *calls]).tolist() == [1.25, 1.25]


def test_a_disk_that_stalls_keeps_nobody_waiting_and_loses_nothing(tmp_path, monkeypatch):
    stalled, write = threading.Event(), os.write

    def slow(file, data):
        assert stalled.wait(30.0)
        return write(file, data)

    monkeypatch.setattr(imufit.devices.record.part.os, "write", slow)
    file = PartFile(tmp_path / "a.part")
    file.begin(DEVICE, ABOUT)
    for k in range(10):
        file.write(rows(10 * k, 10), told(10))
    assert file.rows == 0, "they wait in memory"
    stalled.set()
    file.settle()
    assert file.rows == 100
    file.close()
    np.testing.assert_array_equal(read_part(tmp_path / "a.part").rows.values, rows(0, 100).values)


def test_nothing_is_written_behind_a_batch_that_failed(tmp_path, monkeypatch):
    file = PartFile(tmp_path / "a.part")
    file.begin(DEVICE, ABOUT)
    file.write(rows(0, 10), told(10))
    with monkeypatch.context() as disk:
        disk.setattr(imufit.devices.record.part.os, "write", lambda *_: (_ for _ in ()).throw(OSError(28, "full")))
        with pytest.raises(OSError, match="full"):
            file.write(rows(10, 10), told(10))
    with pytest.raises(OSError, match="full"):
        file.write(rows(20, 10), told(10))
    file.close()
    assert read_part(tmp_path / "a.part").rows.n == 10


FIRST_BATCH = """
import sys
from pathlib import Path
import numpy as np
from imufit.devices.record import record
from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.part import PartFile
before = set(sys.modules)
file = PartFile(Path(sys.argv[1]))
device = Announced("binary", "d", 1e-6, ("acc_x",))
file.begin(device, Circumstances("p", "2026-01-01T00:00:00+00:00", 0.0))
whole = (np.zeros(1, kind) for kind in (np.uint32, np.uint8, np.uint32, np.uint16, np.uint32))
file.write(Arrived(device, np.zeros(1), *whole, np.zeros((1, 1))), {})
file.close()
print(*sorted(set(sys.modules) - before))
"""


def test_the_first_batch_waits_for_no_package_to_be_loaded(tmp_path):
    """Loading pandas takes a fifth of a second, and much more on a busy machine: so long nothing would be read."""
    command = [sys.executable, "-c", FIRST_BATCH, str(tmp_path / "a.parquet.part")]
    loaded = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert "pandas" not in loaded
    assert len(loaded) < 5
