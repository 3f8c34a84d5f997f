"""The bytes that a recording begins with: rows come out of them although no part has any yet."""

import imufit
import numpy as np
import pytest
from imufit.devices.record import record, recover
from imufit.devices.record.arrived import Chunk
from imufit.devices.record.beginning import BeginningFile, beginning_path, read_beginning
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.part import part_path
from imufit.devices.record.reception import Listening
from imufit.devices.record.transport import Line
from imufit.errors import InputError
from recording_device import Sender, values_of

ABOUT = Circumstances("/dev/x", "2026-01-01T00:00:00+00:00", 99.0, None, "ENU")
HOW = Listening("auto", None, 115200)


def chunks():
    """Ten samples a chunk, every 10 ms; the announcement stands in the fourth."""
    device, data = Sender(), []
    for k in range(8):
        head = device.announce() if k == 3 else b""
        data.append(head + device.samples(range(10 * k, 10 * k + 10)))
    return [Chunk(100.0 + 0.01 * k, 0, piece) for k, piece in enumerate(data)]


def written(log, pieces):
    part_path(log).touch()
    file = BeginningFile(beginning_path(log), ABOUT, HOW)
    for piece in pieces:
        file.keep(piece)
    file.close()
    return beginning_path(log)


def test_what_came_is_read_as_it_was_written_and_a_cut_costs_the_last_chunk(tmp_path):
    path = written(tmp_path / "a.parquet", chunks())
    whole = path.read_bytes()
    begun = read_beginning(path)
    assert (begun.about, begun.how, list(begun.chunks)) == (ABOUT, HOW, chunks())
    for cut in range(0, len(whole), 37):
        path.write_bytes(whole[:cut])
        begun = read_beginning(path)
        got = [] if begun is None else list(begun.chunks)
        assert got == chunks()[: len(got)]
        missing = chunks()[len(got) :]
        assert len(whole) - cut <= sum(len(c.data) + 20 for c in missing) + (begun is None) * 400


def test_samples_before_and_after_the_announcement_become_a_log(tmp_path):
    log = tmp_path / "a.parquet"
    written(log, chunks())
    result = recover(log)
    made = imufit.read(log)
    np.testing.assert_array_equal(made.acc, values_of(range(80))[:, :3])
    np.testing.assert_allclose(made.t, 0.001 * np.arange(80), atol=1e-9)
    assert (result.n, result.gaps, result.ended, made.metadata.frame) == (80, (), "crash", "ENU")
    assert list(tmp_path.iterdir()) == [log]


def test_what_is_kept_is_recovered_again_without_doubles(tmp_path):
    log = tmp_path / "a.parquet"
    written(log, chunks())
    assert recover(log, keep=True).n == 80
    assert recover(log, force=True).n == 80
    assert list(tmp_path.iterdir()) == [log]


def test_without_an_announcement_the_remedy_names_the_device(tmp_path):
    log = tmp_path / "a.parquet"
    path = written(log, chunks()[:3])
    with pytest.raises(InputError, match=r"30 samples are in it.*Plug the device in.*port='PORT'"):
        recover(log)
    assert path.exists()


def test_a_file_of_another_kind_is_refused_and_stays(tmp_path):
    path = beginning_path(tmp_path / "a.parquet")
    path.write_bytes(b"PAR1 and so on")
    with pytest.raises(InputError, match="does not hold the first bytes of a recording"):
        recover(path)
    assert path.read_bytes() == b"PAR1 and so on"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('"port": "/dev/x"', '"Port": "/dev/x"'),
        ('"port": "/dev/x"', '"port": 7'),
        ('"monotonic": 99.0', '"monotonic": NaN'),
        ('"monotonic": 99.0', '"monotonic": 1e300'),
        ('"monotonic": 99.0', f'"monotonic": {10**400}'),
        ('"mapping": null', '"mapping": [1]'),
        ('"mapping": null', '"mapping": 0'),
        ("+00:00", ""),
        ("115200", "115200.5"),
        ("115200", "1e999"),
        ('"frame": "ENU"', '"frame": "ENX"'),
        ('"baud": 115200', '"baud": "x"'),
        ('"how": {', '"who": {'),
        ("2026-01", "2026-31"),
    ],
)
def test_a_damaged_beginning_is_refused_and_stays(tmp_path, before, after):
    path = written(tmp_path / "a.parquet", chunks())
    damaged = path.read_bytes().replace(before.encode(), after.encode())
    assert damaged != path.read_bytes()
    path.write_bytes(damaged)
    with pytest.raises(InputError, match="is damaged"):
        recover(path)
    assert path.read_bytes() == damaged


def test_the_speed_of_a_line_is_a_whole_number():
    assert Line("loop://", 1e6).baud == 1_000_000
    for wrong in (0, -9600, 9600.5, float("inf"), "fast", None):
        with pytest.raises(InputError, match="not the speed of a line"):
            Line("loop://", wrong)


def test_an_unknown_frame_is_refused_before_anything_is_recorded(tmp_path):
    with pytest.raises(InputError, match="not a frame"):
        record("loop://", tmp_path / "a.parquet", frame="ned", duration=0.1)
    assert list(tmp_path.iterdir()) == []
