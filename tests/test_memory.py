"""No file takes more than 1 GB of memory, whatever its own size: rows and columns decide, and text is refused."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import imufit
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.part import PartFile, part_path
from imufit.log.excerpt import MOST_ROWS, Excerpt, judged_rows
from imufit.log.size import HELD
from imufit.progress import silent
from numpy.lib import format as npy

LIMIT = 600.0
"""MB that a command may take here. The bound for any file is 1000; a file of seconds leaves most of that unused."""

RUN = """
import resource, sys
from pathlib import Path
from imufit.cli.app import main
try:
    code = main(sys.argv[1:]) or 0
except SystemExit as end:
    code = end.code or 0
# ru_maxrss is handed down from the process that started this one; Linux also counts from the start of the program
status = Path("/proc/self/status")
lines = status.read_text().splitlines() if status.exists() else []
peak = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
print("peak", code, peak[0] if peak else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def run(*words: object) -> tuple[int, float, str]:
    """Run a command in a process of its own; return its code, its peak memory (MB) and what it said."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, *map(str, words)], check=False, capture_output=True, text=True, timeout=300
    )
    *said, last = done.stdout.splitlines()
    _, code, peak = last.split()
    return int(code), int(peak) / 1024, "\n".join([*said, done.stderr])


def write_long(path: Path, n: int, columns: dict[str, float], group: int = 1 << 20, **text: str) -> None:
    """Write a Parquet of n rows at 100 Hz that repeats itself, so that its file is small."""
    names = ["t", *columns, *text]
    kinds = [pa.float64()] * (len(columns) + 1) + [pa.string()] * len(text)
    rng = np.random.default_rng(1)
    cycle = {name: np.round(rng.normal(mean, 0.02, 1000), 3) for name, mean in columns.items()}
    schema = pa.schema(list(zip(names, kinds, strict=True)))
    with pq.ParquetWriter(path, schema, compression="zstd") as out:
        for start in range(0, n, group):
            rows = min(group, n - start)
            arrays = [pa.array(np.arange(start, start + rows) * 0.01)]
            arrays += [pa.array(np.resize(values, rows)) for values in cycle.values()]
            arrays += [pa.repeat(pa.scalar(word), rows) for word in text.values()]
            out.write_table(pa.Table.from_arrays(arrays, schema=schema))


ACC = {"acc_x": 0.0, "acc_y": 0.0, "acc_z": -9.8}


def test_a_long_log_of_a_small_file_is_converted_row_group_by_row_group(tmp_path: Path) -> None:
    n = 10_000_000
    write_long(tmp_path / "a.parquet", n, ACC)
    assert (
        tmp_path / "a.parquet"
    ).stat().st_size < 40e6  # which once decided that it is held: 320 MB, and as many more
    code, peak, said = run("convert", tmp_path / "a.parquet", "-o", tmp_path / "b.parquet")
    assert (code, peak < LIMIT) == (0, True), (peak, said)
    assert f"{n} rows" in said
    assert pq.ParquetFile(tmp_path / "b.parquet").metadata.num_rows == n


def test_a_label_of_millions_of_rows_is_one_word_in_memory(tmp_path: Path) -> None:
    n = 3_000_000
    write_long(tmp_path / "a.parquet", n, ACC, note="the left hand, seen from above")
    code, peak, said = run("convert", tmp_path / "a.parquet", "-o", tmp_path / "b.parquet")
    assert (code, peak < LIMIT) == (0, True), (peak, said)
    assert "the left hand" in said


def test_a_part_of_a_log_is_taken_by_its_rows(tmp_path: Path) -> None:
    write_long(tmp_path / "a.parquet", 300_000, ACC, group=70_000)
    code, _, said = run("convert", tmp_path / "a.parquet", "--rows", "65000:200000", "-o", tmp_path / "b.npz")
    assert code == 0, said
    part = imufit.read(tmp_path / "b.npz")
    whole = imufit.read(tmp_path / "a.parquet")
    np.testing.assert_array_equal(part.t, whole.t[65_000:200_000])
    np.testing.assert_array_equal(part.acc, whole.acc[65_000:200_000])
    code, _, said = run("convert", tmp_path / "a.parquet", "--rows", "5:300001", "-o", tmp_path / "c.npz")
    assert (code, "take them out of 0:300000" in said) == (2, True), said
    code, _, said = run("convert", tmp_path / "a.parquet", "--rows", "5-9", "-o", tmp_path / "c.npz")
    assert (code, "write FIRST:STOP" in said) == (2, True), said


def zeros(path: Path, **arrays: tuple[str, tuple[int, ...]]) -> None:
    """Write an archive of arrays of zeros, which are packed to a thousandth."""
    nothing = bytes(1 << 24)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, (kind, shape) in arrays.items():
            dtype = np.dtype(kind)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                npy.write_array_header_1_0(file, {"descr": kind, "fortran_order": False, "shape": shape})
                left = int(np.prod(shape)) * dtype.itemsize
                for _ in range(left // len(nothing)):
                    file.write(nothing)
                file.write(nothing[: left % len(nothing)])


def test_an_archive_of_packed_zeros_is_not_unpacked_at_once(tmp_path: Path) -> None:
    zeros(tmp_path / "a.npz", t=("<f8", (40_000_000,)), acc=("<f8", (40_000_000, 3)))
    code, peak, said = run("compare", tmp_path / "a.npz")
    assert (code, peak < LIMIT) == (2, True), (peak, said)
    assert "row 1, column t: t = 0.0 repeats" in said


def test_text_of_an_archive_is_refused_by_its_header(tmp_path: Path) -> None:
    zeros(tmp_path / "a.npz", t=("<f8", (1000,)), acc=("<f8", (1000, 3)), note=("<U250000", (1000,)))
    code, peak, said = run("compare", tmp_path / "a.npz")
    assert (code, peak < LIMIT) == (2, True), (peak, said)
    assert "column note: the array holds 1 MB of text a value" in said


def test_text_of_a_parquet_file_is_refused_by_its_metadata(tmp_path: Path) -> None:
    names = ["t", "acc_x", "acc_y", "acc_z"]
    schema = pa.schema([(name, pa.float64()) for name in names] + [("note", pa.string())])
    numbers = [pa.array(np.arange(300) * 0.01)] * 4
    long = pa.array([f"{k}{'x' * 1_000_000}" for k in range(300)])
    pq.write_table(pa.Table.from_arrays([*numbers, long], schema=schema), tmp_path / "a.parquet", compression="zstd")
    assert (tmp_path / "a.parquet").stat().st_size < 200_000
    code, peak, said = run("compare", tmp_path / "a.parquet")
    assert (code, peak < LIMIT) == (2, True), (peak, said)
    assert "column note: the column holds 300 MB of text in 300 rows" in said


def test_a_line_without_end_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.csv").open("wb") as file:
        file.write(b"t,acc_x,acc_y,acc_z\n0,1,2,3\n")
        for _ in range(700):
            file.write(b"1" * 1_000_000)
    code, peak, said = run("compare", tmp_path / "a.csv")
    assert (code, peak < LIMIT) == (2, True), (peak, said)
    assert "a line is longer than 1.05 MB" in said


def test_what_needs_every_row_at_once_says_how_to_take_a_part(tmp_path: Path) -> None:
    write_long(tmp_path / "a.parquet", 8_000_000, ACC)
    code, peak, said = run("allan", tmp_path / "a.parquet")
    assert (code, peak < LIMIT) == (2, True), (peak, said)
    assert "8000000 rows take 256 MB of memory" in said
    assert "--rows 0:6553600 -o" in said


def test_a_replay_counts_what_its_filters_make_of_each_row(tmp_path: Path) -> None:
    write_long(tmp_path / "a.parquet", 3_000_000, ACC | dict.fromkeys(("gyr_x", "gyr_y", "gyr_z"), 0.0))
    filters = ("--filter", "accel,gyro,complementary,kalman,mahony,mekf")
    code, peak, said = run("replay", tmp_path / "a.parquet", *filters)
    assert (code, peak < LIMIT) == (2, True), (peak, said)
    assert "3000000 rows take 1.97 GB of memory" in said
    assert "or allow more with --memory 4" in said


def test_a_replay_may_be_allowed_more_memory(tmp_path: Path) -> None:
    write_long(tmp_path / "a.parquet", 4_000_000, {"gyr_x": 0.0, "gyr_y": 0.0, "gyr_z": 0.01})
    line = ("replay", tmp_path / "a.parquet", "--filter", "gyro")
    code, _, said = run(*line)
    assert code == 2
    allowed = said.split("--memory ")[1].split(".")[0]
    assert run(*line, "--memory", allowed)[0] == 0


def test_a_long_log_is_judged_by_stretches_from_all_over_it() -> None:
    n = 1_000_000
    rng = np.random.default_rng(3)
    acc = rng.normal([0.0, 0.0, -9.81], 0.02, (n, 3))
    log = imufit.Log.from_arrays(np.arange(n) * 0.01, acc=acc, reference=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)))
    few = Excerpt(log, 96 * 200)
    times = np.concatenate([chunk.core.t for chunk in few.chunks(5000)])
    assert (few.n, times[0], times[-1]) == (19_200, log.t[0], log.t[-1])
    each, _ = np.histogram(times, np.linspace(log.t[0], log.t[-1], 49))
    assert set(each) == {400}, "as many rows in each of the 48 blocks"
    fit = imufit.SensorModel().fit(few)
    assert fit.to_dict()["n"] == few.n
    assert fit.on(log, silent) is fit, "it answers for the log"
    assert "judged by 96 stretches of 200 rows each, evenly spread over its 1000000 rows" in str(fit.diagnose().notes)


def test_how_many_rows_are_judged_follows_from_rows_and_columns() -> None:
    n = MOST_ROWS + 1
    log = imufit.Log.from_arrays(np.arange(n) * 0.01, acc=np.zeros((n, 3)))
    assert isinstance(judged_rows(log), Excerpt)
    assert judged_rows(log.rows(0, MOST_ROWS)).n == MOST_ROWS
    assert judged_rows(judged_rows(log)).n < n
    wide = dict.fromkeys([f"c{k}" for k in range(60)], np.zeros(n // 4))
    many = imufit.Log.from_arrays(np.arange(n // 4) * 0.01, acc=np.zeros((n // 4, 3)), covariates=wide)
    assert judged_rows(many).n * 64 * 8 <= HELD


def test_the_log_of_a_recording_is_made_block_by_block(tmp_path: Path) -> None:
    n, rows = 2_000_000, 20_000
    names = ("acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z", "mag_x", "mag_y", "mag_z", "temp")
    announced = Announced("binary", "device", 1e-6, names)
    part = PartFile(part_path(tmp_path / "a.parquet"))
    part.begin(announced, Circumstances("p", "2026-01-01T00:00:00+00:00", 0.0))
    for first in range(0, n, rows):
        k = np.arange(first, first + rows)
        values = np.tile([0.0, 0.0, 9.81, 0.0, 0.0, 0.0, 20.0, 0.0, 44.0, 25.0], (rows, 1))
        values[:, 0] = k % 1000
        zeros = np.zeros(rows, np.uint32)
        stamps = (k * 125 % 2**32).astype(np.uint32)
        arrival = 5.0 + (k // 40 + 1) * 0.005
        sequence = (k % 65536).astype(np.uint16)
        part.write(Arrived(announced, arrival, zeros, zeros.astype(np.uint8), stamps, sequence, zeros, values), {})
    part.settle()
    part.close()
    code, peak, said = run("recover", tmp_path / "a.parquet")
    # whole, the rows alone are 200 MB, and once took five times as much
    assert (code, peak < 400.0) == (0, True), (peak, said)
    log = pq.ParquetFile(tmp_path / "a.parquet")
    assert log.metadata.num_rows == n
    last = log.read_row_group(log.num_row_groups - 1, columns=["t", "acc_x"])
    assert last["acc_x"][-1].as_py() == (n - 1) % 1000
    assert abs(last["t"][-1].as_py() - (n - 1) * 125e-6) < 1e-6
