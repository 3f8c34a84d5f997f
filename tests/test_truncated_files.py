"""Files cut off anywhere: a log or one sentence, quickly and in little memory, whatever the layout and the packing."""

from __future__ import annotations

import gzip
import io
import resource
import shutil
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from random import Random

import imufit
import numpy as np
import pyarrow as pa
import pytest
from foreign_files import WRITERS, Sound, sound, write
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from pyarrow import feather

SECONDS, BYTES = 10.0, 1 << 30
"""What reading a file may take at most."""
OFFSETS = 100
"""Places at which each packing is cut off."""
LAYOUTS = 3
"""Places at which each layout of `foreign_files` is cut off."""


def check(path: Path) -> None:
    """Read what may be damaged; anything but a log or an `InputError` of one line fails."""
    begin, held = time.monotonic(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    said = ""
    try:
        imufit.read(path)
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 3000
    assert time.monotonic() - begin < SECONDS
    # The peak of this process, other tests included, must not rise by more.
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) * 1024 < BYTES


@pytest.fixture(scope="module")
def text() -> bytes:
    """A log of 300 rows as text."""
    log = simulate("handheld", {}, seed=2, duration=3).to_log()
    return log.to_dataframe().to_csv(index=False).encode()


@pytest.fixture(scope="module")
def packed(text: bytes) -> dict[str, bytes]:
    """The same log in every packing that imufit itself takes apart."""
    log = simulate("handheld", {}, seed=2, duration=3).to_log()
    table = pa.Table.from_pandas(log.to_dataframe(), preserve_index=False)
    zipped, columns = io.BytesIO(), io.BytesIO()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("log.csv", text)
    feather.write_feather(table, columns)
    rows = (f"I ({10 * k}) imu: accel=({k % 7}, -4, 16384) gyro=({k % 5}, 1, -2)\r\n" for k in range(300))
    return {
        "log.csv": text,
        "log.tsv": text.replace(b",", b"\t"),
        "log.csv.gz": gzip.compress(text),
        "log.csv.zst": pa.compress(text, codec="zstd", asbytes=True),
        "log.csv.utf16.csv": text.decode().encode("utf-16"),
        "log.zip": zipped.getvalue(),
        "log.log": "".join(rows).encode(),
        "log.feather": columns.getvalue(),
    }


PACKINGS = ("log.csv", "log.tsv", "log.csv.gz", "log.csv.zst", "log.csv.utf16.csv", "log.zip", "log.log", "log.feather")


@pytest.mark.parametrize("name", PACKINGS)
def test_a_packed_log_cut_off_anywhere(packed: dict[str, bytes], tmp_path: Path, name: str):
    data, rng, path = packed[name], Random(name), tmp_path / name
    path.write_bytes(data)
    if name != "log.log":  # whose counts state no unit
        assert imufit.read(path).n == 300
    for offset in sorted({1, 2, len(data) - 1, *(rng.randrange(1, len(data)) for _ in range(OFFSETS))}):
        path.write_bytes(data[:offset])
        check(path)


@pytest.mark.parametrize("suffix", [".parquet", ".npz"])
def test_a_written_log_cut_off_anywhere(tmp_path: Path, suffix: str):
    path, rng = tmp_path / f"log{suffix}", Random(suffix)
    simulate("handheld", {}, seed=2, duration=3).to_log().write(path)
    data = path.read_bytes()
    for offset in sorted({rng.randrange(1, len(data)) for _ in range(OFFSETS)}):
        path.write_bytes(data[:offset])
        check(path)


def mutations(rng: Random) -> list[Callable[[bytes], bytes]]:
    """Damages of bytes: flipped, a stretch twice, a stretch missing, foreign bytes in between."""

    def flipped(data: bytes) -> bytes:
        found = bytearray(data)
        for _ in range(rng.randrange(1, 8)):
            found[rng.randrange(len(found))] = rng.randrange(256)
        return bytes(found)

    def twice(data: bytes) -> bytes:
        begin, end = sorted(rng.randrange(len(data)) for _ in range(2))
        return data[:end] + data[begin:end] + data[end:]

    def missing(data: bytes) -> bytes:
        begin, end = sorted(rng.randrange(len(data)) for _ in range(2))
        return data[:begin] + data[end:] or data[:1]

    def foreign(data: bytes) -> bytes:
        at = rng.randrange(len(data))
        return data[:at] + rng.randbytes(rng.randrange(1, 64)) + data[at:]

    return [flipped, twice, missing, foreign]


@pytest.mark.parametrize("name", PACKINGS)
def test_a_packed_log_with_damaged_bytes(packed: dict[str, bytes], tmp_path: Path, name: str):
    rng, path = Random(f"{name} damaged"), tmp_path / name
    for change in mutations(rng) * 8:
        path.write_bytes(change(packed[name]))
        check(path)


@pytest.fixture(scope="module")
def readings() -> Sound:
    whole = sound("handheld", 774301)
    rows = slice(0, 600)
    return Sound(whole.kind, *(getattr(whole, name)[rows] for name in ("t", "acc", "gyr", "mag", "q")))


@pytest.mark.parametrize("name", WRITERS)
def test_another_makers_file_cut_off_anywhere(readings: Sound, tmp_path: Path, name: str):
    foreign = write(name, tmp_path, readings)
    rng = Random(name)
    files = [foreign.path] if foreign.path.is_file() else sorted(p for p in foreign.path.rglob("*") if p.is_file())
    for _ in range(LAYOUTS):
        path = rng.choice(files)
        kept = tmp_path / "kept"
        shutil.copyfile(path, kept)
        with path.open("r+b") as file:
            file.truncate(rng.randrange(1, path.stat().st_size))
        check(foreign.path)
        shutil.copyfile(kept, path)


def test_numbers_of_every_size_are_a_log_or_a_sentence(tmp_path: Path):
    rng = np.random.default_rng(5)
    for k in range(40):
        values = rng.standard_normal((300, 6)) * 10.0 ** rng.uniform(-300, 300, (300, 6))
        t = np.sort(rng.uniform(0.0, 10.0 ** rng.uniform(-6, 18), 300))
        path = tmp_path / f"{k}.csv"
        np.savetxt(
            path,
            np.column_stack([t, values]),
            delimiter=",",
            header="t,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z",
            comments="",
        )
        check(path)
