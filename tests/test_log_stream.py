"""A log streamed from disk: the same checks, in memory that does not grow with the log."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, LogSource, LogStream, open_log

MEASURE = """
import resource, sys
from pathlib import Path
from imufit.log import open_log
rows = sum(chunk.end - chunk.begin for chunk in open_log(sys.argv[1], stream=True).chunks(20_000, 500))
# ru_maxrss is handed down from the process that started this one; Linux also counts from the start of the program
status = Path("/proc/self/status")
lines = [line.split() for line in status.read_text().splitlines()] if status.exists() else []
peak = [int(line[1]) for line in lines if line and line[0] == "VmHWM:"]
print(rows, peak[0] if peak else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def long_log(n: int) -> Log:
    rng = np.random.default_rng(2)
    acc = rng.normal([0.0, 0.0, 9.81], 1.0, (n, 3))
    return Log.from_arrays(np.arange(n) * 0.01, acc=acc, gyr=0.1 * rng.standard_normal((n, 3)))


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
def test_a_six_times_longer_log_needs_no_more_memory(tmp_path: Path, suffix: str) -> None:
    peaks = []
    for n in (250_000, 1_500_000):
        path = tmp_path / f"log{n}{suffix}"
        long_log(n).write(path)
        out = subprocess.run(
            [sys.executable, "-c", MEASURE, str(path)], check=True, capture_output=True, text=True
        ).stdout.split()
        assert int(out[0]) == n
        peaks.append(int(out[1]) / 1024)
        path.unlink()
    # the longer log alone is 84 MB of numbers
    assert peaks[1] < peaks[0] + 30.0, peaks


def test_open_log_decides_by_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.parquet"
    long_log(100).write(path)
    assert isinstance(open_log(path), Log)
    monkeypatch.setattr("imufit.log.stream.HELD", 10)
    source: LogSource = open_log(path)
    assert isinstance(source, LogStream)
    assert repr(source) == "LogStream(a.parquet: 100 rows; t, acc_x, acc_y, acc_z, gyr_x, gyr_y, gyr_z; NED)"


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
def test_stream_finds_bad_rows_with_their_global_number(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    df = long_log(300_000).to_dataframe()
    df.loc[290_000, "gyr_z"] = np.inf
    if suffix == ".parquet":
        df.to_parquet(path)
    elif suffix == ".csv":
        df.to_csv(path, index=False)
    else:
        np.savez(path, **{name: df[name].to_numpy() for name in df})
    stream = open_log(path, stream=True)
    missing = [
        chunk.start + k for chunk in stream.chunks(1000, 10) for k in np.flatnonzero(np.isnan(chunk.core.gyr[:, 2]))
    ]
    assert missing == [290_000]
    line = " (line 290002)" if suffix == ".csv" else ""
    assert stream.notes[-1] == f"a{suffix}: row 290000{line}, column gyr_z: inf rad/s cannot be measured; left out"


@pytest.mark.parametrize("row", [65_536, 65_535, 131_072])
def test_order_of_time_is_checked_across_blocks(tmp_path: Path, row: int) -> None:
    df = long_log(150_000).to_dataframe()
    df.loc[row, "t"] = df.loc[row - 1, "t"] - 0.001
    df.to_parquet(tmp_path / "a.parquet")
    with pytest.raises(InputError, match=f"row {row}, column t: .* of row {row - 1}"):
        open_log(tmp_path / "a.parquet", stream=True)


def test_coarse_clock_pair_across_blocks(tmp_path: Path) -> None:
    df = long_log(150_000).to_dataframe()
    t = df["t"].to_numpy().copy()
    rows = np.array([65_536, 131_072, 131_071 + 100, *range(1000, 60_000, 5000), *range(70_001, 130_000, 9000)])
    t[rows] = t[rows - 1]
    df.assign(t=t).to_parquet(tmp_path / "a.parquet")
    whole = open_log(tmp_path / "a.parquet", stream=False)
    assert isinstance(whole, Log)
    assert np.all(np.diff(whole.t) > 0.0)
    np.testing.assert_allclose(whole.t[65_536], (whole.t[65_535] + whole.t[65_537]) / 2)
    parts = open_log(tmp_path / "a.parquet", stream=True).chunks(777, 3)
    np.testing.assert_array_equal(np.concatenate([chunk.core.t for chunk in parts]), whole.t)


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
def test_rows_are_those_of_the_whole_log_wherever_they_lie(tmp_path: Path, suffix: str) -> None:
    log = long_log(300_000)
    log.write(tmp_path / f"a{suffix}")
    stream = LogStream(tmp_path / f"a{suffix}")
    assert stream.seeks == (suffix == ".parquet")
    for start, stop in ((0, 10), (131_000, 131_100), (200_000, 262_200), (299_990, 400_000), (5, 5)):
        rows, part = stream.rows(start, stop), log.rows(start, min(stop, log.n))
        np.testing.assert_array_equal(rows.t, part.t)
        np.testing.assert_allclose(rows.gyr, part.gyr, rtol=1e-12)
    some = stream.rows(1000, 1100, ["gyr_x"])
    assert some.acc is None
    np.testing.assert_allclose(some.gyr, log.gyr[1000:1100], rtol=1e-12)


def test_rows_of_a_part_have_the_attitude_that_other_columns_make(tmp_path: Path) -> None:
    log = long_log(1000)
    frame = log.to_dataframe().assign(ref_roll=0.1, ref_pitch=0.0, ref_yaw=np.linspace(0.0, 1.0, 1000))
    frame.to_parquet(tmp_path / "a.parquet", row_group_size=300)
    stream = LogStream(tmp_path / "a.parquet")
    part = stream.rows(500, 700, ["ref_qw"])
    assert part.gyr is None
    np.testing.assert_array_equal(part.ref_q, stream.read().ref_q[500:700])
