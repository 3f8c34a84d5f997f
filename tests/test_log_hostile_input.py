"""What no log can mean is refused where it is read, with the place and the remedy."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from imufit.errors import InputError
from imufit.log import Log, read

N = 40
COLUMNS = {
    "t": np.arange(N) / 100.0,
    "acc_x": np.linspace(0.1, 0.2, N),
    "acc_y": np.zeros(N),
    "acc_z": np.full(N, -9.8),
    "gyr_x": np.zeros(N),
    "gyr_y": np.zeros(N),
    "gyr_z": np.linspace(-0.1, 0.1, N),
}


def message(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read(path)
    return str(caught.value)


def npz(path: Path, *arrays: tuple[str, np.ndarray]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in arrays:
            data = io.BytesIO()
            np.lib.format.write_array(data, values)
            archive.writestr(f"{name}.npy", data.getvalue())
    return path


@pytest.mark.parametrize(
    ("column", "value"),
    [("acc_x", 1e308), ("gyr_z", -1e308), ("mag_x", 1e200), ("temp", 1e12), ("ref_px", 1e12), ("vbat", 1e300)],
)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_values_that_nothing_can_have_measured_are_refused_with_the_first_row(
    tmp_path: Path, column: str, value: float, suffix: str
) -> None:
    group = {"mag_x": ("mag_y", "mag_z"), "ref_px": ("ref_py", "ref_pz")}.get(column, ())
    table = pd.DataFrame({**COLUMNS, **{name: np.full(N, 20.0) for name in (column, *group) if name not in COLUMNS}})
    table.loc[17::20, column] = value
    path = tmp_path / f"a{suffix}"
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path)
    said = message(path)
    assert f"row 17{' (line 19)' if suffix == '.csv' else ''}, column {column}: " in said
    assert "Write NaN" in said
    table.loc[17::20, column] = np.nan
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path)
    assert read(path).n == N


def test_raw_counts_of_24_bits_come_as_far_as_the_check_of_units(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    pd.DataFrame({**COLUMNS, "gyr_x": np.full(N, 8e6)}).to_csv(path, index=False)
    assert "looks like raw counts" in message(path)


@pytest.mark.parametrize("column", ["t", "acc_x"])
def test_truth_value_is_no_measurement(tmp_path: Path, column: str) -> None:
    table = pd.DataFrame(COLUMNS).astype({column: object})
    table.loc[7, column] = "True"
    table.to_csv(tmp_path / "a.csv", index=False)
    assert f"a.csv: row 7 (line 9), column {column}: 'True' is a truth value" in message(tmp_path / "a.csv")
    truths = {**COLUMNS, column: np.arange(N) > 7}
    for path in (tmp_path / "a.parquet", npz(tmp_path / "a.npz", *truths.items())):
        if path.suffix == ".parquet":
            pd.DataFrame(truths).to_parquet(path)
        assert f"{path.name}: column {column}: the column holds truth values" in message(path)
    with pytest.raises(InputError, match="truth values"):
        Log.from_dataframe(pd.DataFrame(truths))


def test_truth_value_of_a_transcript_is_no_measurement(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    lines = [f"t={k / 100:.2f} acc_x={'true' if k == 5 else '0.1'} acc_y=0.0 acc_z=9.8\n" for k in range(12)]
    path.write_text("".join(lines))
    assert "a.log: row 5 (line 6), column acc_x: 'true' is a truth value" in message(path)


def test_switch_is_a_covariate_of_ones_and_zeros(tmp_path: Path) -> None:
    on = np.arange(N) % 2 == 0
    table = pd.DataFrame({**COLUMNS, "on": on})
    table.to_csv(tmp_path / "a.csv", index=False)
    table.to_parquet(tmp_path / "a.parquet")
    npz(tmp_path / "a.npz", *COLUMNS.items(), ("on", on))
    for suffix in (".csv", ".parquet", ".npz"):
        np.testing.assert_array_equal(read(tmp_path / f"a{suffix}").covariates["on"], on.astype(float))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_array_that_an_archive_holds_twice_is_not_chosen_in_silence(tmp_path: Path) -> None:
    path = npz(tmp_path / "a.npz", *COLUMNS.items(), ("acc_x", COLUMNS["acc_y"]))
    assert message(path) == "a.npz: column acc_x: the array is stored twice. Save each array once."


@pytest.mark.parametrize("first", [True, False])
def test_group_beside_its_own_column_is_not_chosen_in_silence(tmp_path: Path, first: bool) -> None:
    group = ("acc", np.zeros((N, 3)))
    arrays = [group, *COLUMNS.items()] if first else [*COLUMNS.items(), group]
    assert "column acc_x: the column stands in the array acc and in the array acc_x" in message(
        npz(tmp_path / "a.npz", *arrays)
    )


@pytest.mark.parametrize(("local", "central", "value"), [(8, 10, 99), (4, 6, 200), (6, 8, 1)])
def test_archive_of_an_unknown_kind_is_told_from_a_damaged_one(
    tmp_path: Path, local: int, central: int, value: int
) -> None:
    """Compression method, version and encryption of the first array."""
    path = npz(tmp_path / "a.npz", *COLUMNS.items())
    data = bytearray(path.read_bytes())
    directory = data.find(b"PK\x01\x02")
    for place in (local, directory + central):
        data[place : place + 2] = struct.pack("<H", value)
    path.write_bytes(data)
    said = message(path)
    assert "encrypted, or of an unknown kind" in said
    assert "numpy.savez" in said


@pytest.mark.parametrize(
    ("metadata", "words"),
    [
        (b'{"a": ' + b"[" * 100_000 + b"]" * 100_000 + b"}", "stand within one another"),
        (b'{"a": ' + b"[" * 40 + b"]" * 40 + b"}", "stand within one another"),
        (b'{"gravity": 1' + b"0" * 400 + b"}", "gravity is an integer of more than 64 bits"),
        (b'{"gyr_range": 1' + b"0" * 5000 + b"}", "not valid JSON"),
        (b'{"mag_reference": [1' + b"0" * 400 + b", 2, 3]}", "mag_reference is an integer of more than 64 bits"),
        (b'{"mag_reference": [1e300, 2, 3]}', "not three numbers"),
        (b'{"gravity": 1e-300}', "is not a gravity"),
        (b'{"noise": {"acc": 1e300}}', "no sensor has such a standard deviation"),
        (b'{"sensor": "\xff\xfe"}', "not valid JSON"),
    ],
)
def test_metadata_that_cannot_be_meant_are_refused(tmp_path: Path, metadata: bytes, words: str) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(COLUMNS).replace_schema_metadata({b"imufit": metadata}), path)
    said = message(path)
    assert said.startswith("a.parquet: column ")
    assert words in said


def test_deep_sidecar_is_refused(tmp_path: Path) -> None:
    pd.DataFrame(COLUMNS).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "a.toml").write_text(f"x = {'[' * 5000}{']' * 5000}\n")
    assert message(tmp_path / "a.csv").startswith("a.toml: more than 32 lists or tables stand within one another.")


def test_schema_that_is_no_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(COLUMNS), path)
    path.write_bytes(path.read_bytes().replace(b"gyr_y", b"gy\xff\xfey"))
    assert "not UTF-8" in message(path)


def test_clock_of_a_transcript_counts_on_past_midnight(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    times = [f"23:59:59.{k}" for k in range(10)] + [f"00:00:00.{k}" for k in range(10)]
    path.write_text("".join(f"{time} -> acc_x=0.1 acc_y=0.2 acc_z=9.8\n" for time in times))
    log = read(path, {"t": "clock"})
    np.testing.assert_allclose(np.diff(log.t), 0.1, atol=1e-6)
    assert log.t[0] == pytest.approx(86399.0)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("array", ["pose", "metadata"])
def test_text_of_an_archive_beyond_unicode_is_refused(tmp_path: Path, array: str, order: str) -> None:
    damaged = np.full(N, 0x110000, f"{order}u4").view(f"{order}U1")
    path = npz(tmp_path / "a.npz", *COLUMNS.items(), (array, damaged if array == "pose" else damaged[0:1].reshape(())))
    assert "a.npz" in message(path)


def test_text_of_a_structured_array_beyond_unicode_is_refused(tmp_path: Path) -> None:
    rows = np.zeros(N, [("t", "f8"), ("acc_x", "f8"), ("label", "<u4")])
    rows["label"] = 0x110000
    np.save(tmp_path / "a.npy", rows.view([("t", "f8"), ("acc_x", "f8"), ("label", "<U1")]))
    assert "a.npy" in message(tmp_path / "a.npy")


def test_time_of_day_of_a_table_is_not_told_to_be_sorted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    pd.DataFrame({**COLUMNS, "t": (86399.8 + COLUMNS["t"]) % 86400.0}).to_csv(path, index=False)
    said = message(path)
    assert "row 20 (line 22), column t" in said
    assert "add 86400 s to t from this row on" in said


@pytest.mark.parametrize("at", [1, 10, 19])
def test_a_pause_does_not_hide_a_time_in_another_unit(at: int, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    t = np.arange(N) * 1e-8 + np.where(np.arange(N) < at, 0.0, 60.0)
    pd.DataFrame({**COLUMNS, "t": t}).to_csv(path, index=False)
    assert "faster than any such sensor samples" in message(path)


def test_rows_that_arrive_in_packets_are_not_taken_for_a_time_in_another_unit(tmp_path: Path) -> None:
    path, rows = tmp_path / "a.csv", np.arange(100 * N)
    log = {name: np.tile(values, 100) for name, values in COLUMNS.items()}
    pd.DataFrame({**log, "t": 0.08 * (rows // 8) + 1e-5 * (rows % 8)}).to_csv(path, index=False)
    assert read(path).n == rows.size


def test_time_in_which_no_sensor_could_sample_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    pd.DataFrame({**COLUMNS, "t": np.arange(N) * 1e-9}).to_csv(path, index=False)
    assert "faster than any such sensor samples" in message(path)
    pd.DataFrame({**COLUMNS, "t": np.arange(N) * 1e-5}).to_csv(path, index=False)
    assert "faster than any such sensor samples (32000 Hz)" in message(path)
    pd.DataFrame({**COLUMNS, "t": np.arange(N) * 4e-5}).to_csv(path, index=False)
    assert read(path).n == N
    # A converter reads an analog accelerometer at any rate.
    alone = {name: values for name, values in COLUMNS.items() if not name.startswith("gyr")}
    pd.DataFrame({**alone, "t": np.arange(N) * 1e-5}).to_csv(path, index=False)
    assert read(path).n == N


def test_readings_that_no_instrument_resolves_are_zero_and_the_rest_is_as_it_was() -> None:
    rows = np.array([[9.8, 1e-29, -1e-31], [1e-308, np.nan, -9.8]])
    log = Log.from_arrays([0.0, 0.5], acc=rows, covariates={"vbat": [1e-308, 3.7]})
    np.testing.assert_array_equal(log.acc, [[9.8, 1e-29, 0.0], [0.0, np.nan, -9.8]])
    np.testing.assert_array_equal(log.covariates["vbat"], [1e-308, 3.7])


def test_a_file_that_lost_its_line_ends_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(",".join(["t", "acc_x", "acc_y", "acc_z", *["0.01"] * 6000]))
    assert "6004 columns, more than 1024: this is not a table of rows" in message(path)


def test_parquet_text_that_is_not_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    words = pa.array([b"still \xdf"] * N).view(pa.string())
    pq.write_table(pa.table({**COLUMNS, "note": words}), path)
    assert "the file is damaged" in message(path)
