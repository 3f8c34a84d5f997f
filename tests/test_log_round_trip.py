"""What is written is read back to the last bit, and chunks put together are the log."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.log import Log, LogSource, Metadata, concatenate, gaps, open_log, read
from imufit.log.columns import LARGEST, LARGEST_COVARIATE, SMALLEST
from imufit.log.metadata import SMALLEST_NOISE
from scipy.spatial.transform import Rotation


def readings(column: str) -> st.SearchStrategy[float]:
    """Any number that the column may hold."""
    largest = LARGEST.get(column, LARGEST_COVARIATE)
    numbers = st.floats(-largest, largest)
    if column[:3] in ("acc", "gyr", "mag"):
        numbers = numbers.map(lambda value: 0.0 if abs(value) < SMALLEST else value)
    return st.one_of(numbers, st.just(float("nan")))


words = st.text(st.characters(codec="utf-8", exclude_characters="\0\r\n"), max_size=6).map(lambda s: s and f"w {s}")


def same(a: Log, b: Log) -> None:
    """Equal to the bit, apart from path and notes."""
    for field in dataclasses.fields(Log):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if field.name in ("path", "notes"):
            continue
        if isinstance(x, dict):
            assert x.keys() == y.keys()
            for name in x:
                identical(x[name], y[name])
        elif isinstance(x, np.ndarray):
            identical(x, y)
        else:
            assert x == y, field.name


def identical(x: np.ndarray, y: np.ndarray) -> None:
    assert x.shape == y.shape
    if x.dtype == object:
        assert list(x) == list(y)
    else:
        x, y = np.where(np.isnan(x), np.nan, x), np.where(np.isnan(y), np.nan, y)
        assert x.tobytes() == np.ascontiguousarray(y).tobytes()


@st.composite
def logs(draw: st.DrawFn, least: int = 1) -> Log:
    n = draw(st.integers(least, 40))
    t = sorted(draw(st.lists(st.floats(-1e9, 1e9), min_size=n, max_size=n, unique=True)))
    t[0] -= 0.3  # whole numbers alone would be taken for ticks
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))

    def columns(k: int, column: str) -> Any:
        some = draw(st.lists(readings(column), min_size=1, max_size=20))
        return rng.choice(np.array(some), size=(n, k) if k else n)

    kinds = (("mag", 3, "mag_x"), ("temp", 0, "temp"), ("ref_p", 3, "ref_px"))
    optional = {name: columns(k, first) for name, k, first in kinds if draw(st.booleans())}
    if draw(st.booleans()):
        q = Rotation.random(n, rng=rng).as_quat(scalar_first=True)
        q[rng.random(n) < 0.2] = np.nan
        optional["reference"] = q
    labels = {"state": draw(st.lists(words, min_size=n, max_size=n))}
    pose = draw(st.lists(st.sampled_from(["+x", "-x", "+z", None, ""]), min_size=n, max_size=n))
    metadata = draw(
        st.fixed_dictionaries(
            {"frame": st.sampled_from(["NED", "ENU", "NWU"]), "gravity": st.floats(0.1, 30.0)},
            optional={
                "mag_reference": st.lists(st.floats(-1e8, 1e8), min_size=3, max_size=3),
                "sensor": st.text(st.characters(codec="utf-8", exclude_categories=["Cc"]), max_size=8),
                "noise": st.dictionaries(st.sampled_from(["acc", "gyr"]), st.floats(SMALLEST_NOISE, 1e3)),
                "licence": st.text("abc \"'\\", max_size=5),
                "depth": st.integers(-1000, 1000),
            },
        )
    )
    metadata["mag_reference"] = metadata.get("mag_reference", [20.0, 0.0, 40.0])
    acc = columns(3, "acc_x")
    return Log.from_arrays(
        t,
        acc=acc,
        pose=pose,
        covariates={"motor_current": columns(0, "motor_current")},
        labels=labels if any(labels["state"]) else {},
        **optional,
        **metadata,
    )


def tame(log: Log) -> Log:
    """Readings whose unit nobody would doubt."""
    mag = None if log.mag is None else np.where(np.isnan(log.mag), np.nan, 20.0 + np.arctan(log.mag))
    assert log.acc is not None
    return dataclasses.replace(log, acc=np.where(np.isnan(log.acc), np.nan, 6.0 + np.arctan(log.acc)), mag=mag)


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
@settings(max_examples=60, deadline=None)
@given(log=logs().map(tame))
def test_written_log_is_read_back_to_the_bit(suffix: str, log: Log) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        log.write(path)
        back = read(path)
        # an unlabelled pose column stands for itself in every format
        same(log, back)
        assert back.path == path


@settings(max_examples=60, deadline=None)
@given(log=logs(), rows=st.integers(1, 50), margin=st.integers(0, 60))
def test_chunks_put_together_are_the_log(log: Log, rows: int, margin: int) -> None:
    check_chunks(log, log, rows, margin)


def check_chunks(source: LogSource, log: Log, rows: int, margin: int) -> None:
    chunks = list(source.chunks(rows, margin))
    same(concatenate([chunk.core for chunk in chunks]), log)
    for chunk in chunks:
        core = chunk.end - chunk.begin
        assert core == min(rows, log.n - chunk.start)
        assert chunk.begin == min(margin, chunk.start)
        assert chunk.log.n - chunk.end == min(margin, log.n - chunk.start - core)
        same(chunk.log, log.rows(chunk.start - chunk.begin, chunk.start - chunk.begin + chunk.log.n))


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
@settings(max_examples=20, deadline=None)
@given(log=logs().map(tame), rows=st.integers(1, 50), margin=st.integers(0, 60))
def test_streamed_chunks_are_those_of_the_log(suffix: str, log: Log, rows: int, margin: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        log.write(path)
        stream = open_log(path, stream=True)
        assert (stream.n, stream.metadata, stream.columns) == (log.n, log.metadata, log.columns)
        check_chunks(stream, log, rows, margin)


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
@pytest.mark.parametrize(("rows", "margin"), [(10_000, 500), (65_536, 0), (100_000, 70_000), (1_000_000, 5)])
def test_chunks_across_the_blocks_of_the_file(tmp_path: Path, suffix: str, rows: int, margin: int) -> None:
    n = 150_000
    acc = np.random.default_rng(5).normal([0.0, 0.0, 9.81], 1.0, (n, 3))
    log = Log.from_arrays(np.arange(n) * 0.01, acc=acc, labels={"state": ["on", None, "off"] * (n // 3)})
    log.write(tmp_path / f"a{suffix}")
    check_chunks(open_log(tmp_path / f"a{suffix}", stream=True), log, rows, margin)


def test_rows_are_views_and_selections_are_copies() -> None:
    log = Log.from_arrays(np.arange(10.0), acc=np.ones((10, 3)), covariates={"v": np.arange(10.0)})
    part = log.rows(2, 5)
    assert part.n == 3
    assert np.shares_memory(part.acc, log.acc)  # type: ignore[arg-type]
    chosen = log.select(log.t > 6.5)
    assert list(chosen.covariates["v"]) == [7.0, 8.0, 9.0]
    assert not np.shares_memory(chosen.t, log.t)
    with pytest.raises(ValueError, match="mask has shape"):
        log.select(np.array([1, 2]))
    with pytest.raises(ValueError, match="chunks need rows >= 1"):
        list(log.chunks(0, 1))


def test_reference_is_scalar_first_in_the_log_and_masked_where_missing() -> None:
    rotation = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2]])
    log = Log.from_arrays([0.0, 1.0], reference=rotation)
    assert log.ref_q is not None
    np.testing.assert_allclose(log.ref_q[1], [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    assert log.reference is not None
    np.testing.assert_allclose(log.reference.apply([1.0, 0.0, 0.0])[1], [0.0, 1.0, 0.0], atol=1e-15)
    q = log.ref_q.copy()
    q[0] = np.nan
    gap = Log.from_arrays([0.0, 1.0], reference=q)
    assert list(gap.has_reference) == [False, True]
    np.testing.assert_allclose(gap.reference.magnitude(), [0.0, np.pi / 2])  # type: ignore[union-attr]
    other = log.with_reference(rotation.inv())
    np.testing.assert_allclose((other.reference * rotation).magnitude(), 0.0, atol=1e-15)  # type: ignore[operator]


def test_commanded_angle_becomes_the_reference() -> None:
    angle = np.array([0.0, 0.5, np.nan])
    log = Log.from_arrays(np.arange(3.0), ref_angle=angle, rig_axis="y")
    assert log.reference is not None
    np.testing.assert_allclose(log.reference.as_rotvec()[:2], [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]], atol=1e-15)
    assert list(log.has_reference) == [True, True, False]
    assert np.isnan(log.ref_q[2]).all()  # type: ignore[index]
    assert Log.from_arrays(np.arange(3.0), ref_angle=angle).ref_q is None


def test_repr_and_columns() -> None:
    log = Log.from_arrays(np.arange(101) * 0.01, gyr=np.zeros((101, 3)), covariates={"vbat": np.ones(101)})
    assert repr(log) == "Log(101 rows, 1 s at 100 Hz; gyr; and vbat; NED)"
    assert log.columns == ("t", "gyr_x", "gyr_y", "gyr_z")
    assert list(log.to_dataframe().columns) == [*log.columns, "vbat"]


def test_booleans_and_integers_are_covariates(tmp_path: Path) -> None:
    df = Log.from_arrays(np.arange(4.0), mag=np.full((4, 3), 30.0)).to_dataframe()
    df["armed"] = [True, False, True, True]
    df["count"] = [1, 2, 3, 4]
    for suffix, write in ((".csv", df.to_csv), (".parquet", df.to_parquet)):
        write(tmp_path / f"a{suffix}", index=False)  # type: ignore[operator]
        log = read(tmp_path / f"a{suffix}")
        assert list(log.covariates["armed"]) == [1.0, 0.0, 1.0, 1.0]
        assert list(log.covariates["count"]) == [1.0, 2.0, 3.0, 4.0]
    same(Log.from_dataframe(df), log)


def test_groups_in_npz(tmp_path: Path) -> None:
    acc = np.random.default_rng(0).standard_normal((50, 3)) + 6.0
    np.savez_compressed(tmp_path / "a.npz", t=np.arange(50.0), acc=acc, metadata='{"frame": "ENU"}')
    log = read(tmp_path / "a.npz")
    identical(log.acc, acc)  # type: ignore[arg-type]
    assert log.metadata.frame == "ENU"


def test_csv_refuses_line_breaks_in_text(tmp_path: Path) -> None:
    log = Log.from_arrays(np.arange(2.0), mag=np.ones((2, 3)), labels={"note": ["a\nb", None]})
    with pytest.raises(ValueError, match="column note: CSV cannot hold line breaks"):
        log.write(tmp_path / "a.csv")
    with pytest.raises(ValueError, match=r"logs are not written as \.xls"):
        log.write(tmp_path / "a.xls")


def test_gaps_cut_a_log_into_segments() -> None:
    t = np.array([0.0, 1.0, 2.0, 6.0, 7.0, 20.0])
    assert gaps(t) == [(0, 3), (3, 5), (5, 6)]
    assert gaps(t, factor=5.0) == [(0, 5), (5, 6)]
    assert gaps(t[:1]) == [(0, 1)]
    assert gaps(t[:0]) == []


def test_metadata_defaults() -> None:
    assert Log.from_arrays([0.0]).metadata == Metadata(frame="NED", gravity=9.80665)
