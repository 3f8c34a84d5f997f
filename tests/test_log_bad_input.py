"""Every kind of unusable log has its own message, with file, row, column and remedy."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest
from imufit.errors import InputError
from imufit.log import Log, open_log, read


def frame(n: int = 100) -> pd.DataFrame:
    rng = np.random.default_rng(1)
    columns = {"t": np.arange(n) * 0.01}
    columns |= {f"acc_{a}": (9.81 if a == "z" else 0.0) + 0.01 * rng.standard_normal(n) for a in "xyz"}
    columns |= {f"gyr_{a}": 0.01 * rng.standard_normal(n) for a in "xyz"}
    columns |= {f"mag_{a}": m + 0.1 * rng.standard_normal(n) for a, m in zip("xyz", (20, 0, 43), strict=True)}
    return pd.DataFrame(columns)


def with_reference(n: int = 100) -> pd.DataFrame:
    df = frame(n)
    df["ref_qw"], df["ref_qx"], df["ref_qy"], df["ref_qz"] = 1.0, 0.0, 0.0, 0.0
    return df


def save(df: pd.DataFrame, path: Path) -> Path:
    if path.suffix == ".parquet":
        df.to_parquet(path, index=False)
    elif path.suffix == ".npz":
        np.savez(path, **{name: np.array(list(df[name])) for name in df.columns})
    else:
        df.to_csv(path, index=False)
    return path


@pytest.fixture(params=[".parquet", ".npz", ".csv"])
def suffix(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def message(path: Path, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        read(path, **options)  # type: ignore[arg-type]
    text = str(caught.value)
    assert "\n" not in text
    assert pickle.loads(pickle.dumps(caught.value)).args == caught.value.args
    return text


def at(suffix: str, row: int) -> str:
    return f"row {row} (line {row + 2})" if suffix == ".csv" else f"row {row}"


def changed(tmp_path: Path, suffix: str, row: int | slice, column: str, value: object) -> Path:
    df = with_reference()
    df.loc[row, column] = value
    return save(df, tmp_path / f"walk{suffix}")


def test_infinite_reading(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, slice(57, 58), "gyr_y", np.inf)  # of 100 rows one alone would be left out
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 57)}, column gyr_y: inf is not a reading. "
        "Write NaN (or leave the cell empty) for a missing sample."
    )


def test_infinite_covariate(tmp_path: Path, suffix: str) -> None:
    df = frame()
    df["vbat"] = 12.0
    df.loc[3:4, "vbat"] = -np.inf
    assert f"{at(suffix, 3)}, column vbat: -inf is not a reading." in message(save(df, tmp_path / f"a{suffix}"))


def test_error_carries_its_parts(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, slice(57, 58), "gyr_y", np.inf)  # of 100 rows one alone would be left out
    with pytest.raises(InputError) as caught:
        read(path)
    error = caught.value
    assert (error.file, error.row, error.column) == (str(path), 57, "gyr_y")
    assert error.remedy == "Write NaN (or leave the cell empty) for a missing sample."
    assert isinstance(error, ValueError)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_time_that_is_no_number(tmp_path: Path, suffix: str, value: float) -> None:
    path = changed(tmp_path, suffix, 5, "t", value)
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 5)}, column t: {value} is not a time. "
        "Every row needs its time in s: fill it in or delete the row."
    )


def test_time_that_goes_back(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, 40, "t", 0.2)
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 40)}, column t: t = 0.2 is before t = 0.39 of row 39. "
        "Sort the log by t or split it there."
    )


def test_isolated_repeated_time(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, 40, "t", 0.39)
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 40)}, column t: t = 0.39 repeats t = 0.39 of row 39. "
        "Two samples cannot share a time: delete the copied rows or split the log there."
    )


def test_quaternion_that_is_not_unit(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, 7, "ref_qw", 1.01)
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 7)}, column ref_qw: the quaternion has norm 1.01, not 1. "
        "Reference attitudes are unit quaternions, scalar first: normalise them."
    )


def test_quaternion_that_is_zero(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, 7, "ref_qw", 0.0)
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 7)}, column ref_qw: the quaternion is all zero. "
        "Write NaN in all four parts for a missing reference."
    )


def test_quaternion_that_is_half_missing(tmp_path: Path, suffix: str) -> None:
    path = changed(tmp_path, suffix, 7, "ref_qy", np.nan)
    assert message(path) == (
        f"walk{suffix}: {at(suffix, 7)}, column ref_qy: NaN in one part of a quaternion whose other parts are there. "
        "A missing reference needs NaN in all of ref_qw ref_qx ref_qy ref_qz."
    )


def test_slightly_rounded_quaternions_are_normalised(tmp_path: Path, suffix: str) -> None:
    q = read(changed(tmp_path, suffix, 7, "ref_qw", 1.0009)).ref_q
    assert q is not None
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-15)


def test_unknown_pose(tmp_path: Path, suffix: str) -> None:
    df = frame()
    df["pose"] = "+x"
    df.loc[9, "pose"] = "up"
    assert message(save(df, tmp_path / f"p{suffix}")) == (
        f"p{suffix}: {at(suffix, 9)}, column pose: 'up' is not a pose. "
        "Write one of +x -x +y -y +z -z (that body axis points up), or nothing."
    )


def test_text_in_a_number_column(tmp_path: Path, suffix: str) -> None:
    df = frame().astype({"acc_y": object})
    df["acc_y"] = [str(v) for v in df["acc_y"]]
    df.loc[12, "acc_y"] = "err"
    assert message(save(df, tmp_path / f"a{suffix}")) == (
        f"a{suffix}: {at(suffix, 12)}, column acc_y: 'err' is not a number. "
        "Write a number, or leave the cell empty for a missing sample."
    )


def test_text_in_time(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,mag_x,mag_y,mag_z\n0,1,2,3\nxx,1,2,3\n")
    assert message(path).startswith("a.csv: row 1 (line 3), column t: 'xx' is not a number.")


def test_decimal_comma_is_recognised(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;mag_x;mag_y;mag_z\n0;1;2;3\n1;30,5;2;3\n")
    assert read(path).mag.tolist() == [[1.0, 2.0, 3.0], [30.5, 2.0, 3.0]]
    path.write_text("t;mag_x;mag_y;mag_z\n0.5;1;2;3\n1;1,5;2;3\n")
    assert (
        message(path)
        == "a.csv: row 1 (line 3), column mag_x: '1,5' is not a number. Write a decimal point, not a comma."
    )


@pytest.mark.parametrize("old", ["accel", "Acc", "accelerometer"])
def test_misspelt_sensor(tmp_path: Path, suffix: str, old: str) -> None:
    df = frame().rename(columns={"acc_x": f"{old}_x"})
    assert message(save(df, tmp_path / f"a{suffix}")) == (
        f"a{suffix}: column acc_x is missing; did you mean {old}_x? "
        f"Use imufit.read('{tmp_path}/a{suffix}', mapping={{'acc_x': '{old}_x'}})"
    )


def test_slip_of_the_finger(tmp_path: Path) -> None:
    df = frame().rename(columns={f"gyr_{a}": f"gry_{a}" for a in "xyz"})
    assert message(save(df, tmp_path / "a.csv")) == (
        "a.csv: column gyr_x is missing; did you mean gry_x? "
        f"Use imufit.read('{tmp_path}/a.csv', mapping={{'gyr_x': 'gry_x', 'gyr_y': 'gry_y', 'gyr_z': 'gry_z'}})"
    )


def test_second_sensor_is_not_a_slip(tmp_path: Path) -> None:
    df = frame()
    for axis in "xyz":
        df[f"acc2_{axis}"] = df[f"still_acc_{axis}"] = df[f"acc_{axis}"]
    log = read(save(df, tmp_path / "a.parquet"))
    assert {"acc2_x", "still_acc_z"} <= log.covariates.keys()


def test_capital_letters_in_time(tmp_path: Path) -> None:
    log = read(save(frame().rename(columns={"t": "Time"}), tmp_path / "a.csv"))
    assert log.t.tolist() == frame()["t"].tolist()
    assert log.notes == ("a.csv: taken t from 'Time' in s",)


def test_sensor_that_is_partly_there(tmp_path: Path, suffix: str) -> None:
    df = frame()[["t", "acc_x", "acc_y"]]
    assert message(save(df, tmp_path / f"a{suffix}")) == (
        f"a{suffix}: column acc_z is missing although acc_x and acc_y are there. "
        "Add it, or leave out the others of acc_x, acc_y, acc_z."
    )


def test_no_time(tmp_path: Path, suffix: str) -> None:
    df = frame().drop(columns="t")
    assert message(save(df, tmp_path / f"a{suffix}")) == (
        f"a{suffix}: column t is missing. Give time in s, for a fixed rate with "
        f"imufit.read('{tmp_path}/a{suffix}', mapping={{'t': 'row[100Hz]'}})."
    )


def test_no_sensor(tmp_path: Path) -> None:
    df = frame()[["t"]].assign(vbat=1.0)
    assert "the file has no sensor" in message(save(df, tmp_path / "a.parquet"))


def twice(path: Path, name: str, value: object) -> Path:
    """Save a log with two columns of the same name, as pandas does not let one."""
    df = frame().assign(first=value, second=value)
    table = pa.Table.from_pandas(df, preserve_index=False).rename_columns([*df.columns[:-2], name, name])
    if path.suffix == ".parquet":
        pq.write_table(table, path)
    else:
        pa_csv.write_csv(table, path)
    return path


@pytest.mark.parametrize("value", [1.0, True, "text"])
@pytest.mark.parametrize("name", ["acc_z", "note"])
@pytest.mark.parametrize("kind", [".csv", ".parquet"])
def test_column_that_is_there_twice(tmp_path: Path, kind: str, name: str, value: object) -> None:
    path = twice(tmp_path / f"a{kind}", name, value)
    assert message(path) == f"a{kind}: column {name} is there twice. Rename or delete one of them."


def test_empty_file(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.touch()
    assert message(path) == f"a{suffix}: the file is empty (0 bytes). Record or copy it again."


def test_header_without_rows(tmp_path: Path, suffix: str) -> None:
    path = save(frame(0), tmp_path / f"a{suffix}")
    assert message(path) == f"a{suffix}: the file has a header but no rows. Record or copy it again."


@pytest.mark.parametrize("share", [0.2, 0.5, 0.99])
def test_binary_file_that_is_cut_off(tmp_path: Path, share: float) -> None:
    for name in ("a.parquet", "a.npz"):
        path = save(frame(5000), tmp_path / name)
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])
        assert message(path).startswith(f"{name}: the file is cut off or damaged")


def test_damage_in_the_middle(tmp_path: Path) -> None:
    for name in ("a.parquet", "a.npz"):
        path = tmp_path / name
        Log.from_dataframe(frame(5000)).write(path)
        data = bytearray(path.read_bytes())
        data[len(data) // 2 : len(data) // 2 + 200] = b"\xff" * 200
        path.write_bytes(bytes(data))
        assert "damaged" in message(path)


def test_text_file_that_is_cut_off(tmp_path: Path) -> None:
    path = save(frame(50), tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:-1], ",".join(lines[-1].split(",")[:4])]))
    assert message(path) == (
        "a.csv: row 49 (line 51): the last line has 4 of 10 fields: the file was cut off. Delete that line."
    )


def test_line_with_too_many_fields(tmp_path: Path) -> None:
    path = save(frame(50), tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    lines[20] += ",1"
    path.write_text("\n".join(lines))
    assert message(path) == (
        "a.csv: row 19 (line 21): the line has 11 fields, the header has 10. Correct or delete that line."
    )


def test_line_numbers_count_comments(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("# made by hand\nt,mag_x,mag_y,mag_z\n0,1,2,3\n\n# again\n1,inf,2,3\n")
    assert "row 1 (line 6), column mag_x: inf" in message(path)


@pytest.mark.parametrize(("name", "what"), [("a.parquet", "a Parquet file"), ("a.npz", "an NPZ file")])
def test_other_content_than_the_suffix_says(tmp_path: Path, name: str, what: str) -> None:
    (tmp_path / name).write_text("t,acc_x\n0,1\n")
    assert message(tmp_path / name) == f"{name}: this is not {what}. Check the suffix."


def test_binary_content_in_csv(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"\x00\x01\x02" * 100)
    assert message(path) == "a.csv: this is not a text file. Check the suffix."


def test_unknown_suffix_missing_file_directory(tmp_path: Path) -> None:
    (tmp_path / "a.doc").write_bytes(b"\xd0\xcf\x11\xe0\x00\x00\x06\x00")
    assert message(tmp_path / "a.doc") == (
        "a.doc: the suffix .doc is not a log's, and the file is not text. Logs are .parquet, .npz, .csv, .txt, .tsv, "
        ".dat, .log: export it as text, of which imufit.read makes a log."
    )
    assert message(tmp_path / "b.csv") == f"b.csv: the file {tmp_path / 'b.csv'} does not exist. Check the name."
    (tmp_path / "c.csv").mkdir()
    assert message(tmp_path / "c.csv") == (
        "c.csv: the folder of text files does not hold a table. Name a file that holds samples."
    )


def test_arrays_are_checked_too() -> None:
    t = np.arange(5.0)
    with pytest.raises(InputError, match="log: row 2, column acc_y: inf is not a reading"):
        Log.from_arrays(t, acc=np.where(np.arange(15).reshape(5, 3) == 7, np.inf, 1.0))
    with pytest.raises(InputError, match=r"column acc: the array has shape \(3, 5\)"):
        Log.from_arrays(t, acc=np.ones((3, 5)))
    with pytest.raises(InputError, match=r"t = 1.0 is before t = 2.0"):
        Log.from_arrays([0.0, 2.0, 1.0], acc=np.ones((3, 3)))


def coarse(n: int, repeats: np.ndarray) -> pd.DataFrame:
    df = frame(n)
    t = df["t"].to_numpy().copy()
    t[repeats] = t[repeats - 1]
    return df.assign(t=t)


@pytest.mark.parametrize("stream", [False, True])
def test_coarse_clock_is_accepted_with_a_note(tmp_path: Path, suffix: str, stream: bool) -> None:
    repeats = np.arange(50, 2000, 150)
    path = save(coarse(2000, repeats), tmp_path / f"a{suffix}")
    log = open_log(path, stream=stream)
    assert log.notes == (
        f"a{suffix}: 13 repeated time stamps: clock coarser than the sampling; "
        "the second row of each pair was moved halfway to the next stamp",
    )
    t = np.concatenate([chunk.core.t for chunk in log.chunks(37, 3)])
    assert np.all(np.diff(t) > 0.0)
    np.testing.assert_allclose(t[repeats], (t[repeats - 1] + t[repeats + 1]) / 2)


def test_coarse_clock_with_a_pair_at_the_end(tmp_path: Path) -> None:
    log = read(save(coarse(2000, np.array([*range(50, 2000, 150), 1999])), tmp_path / "a.parquet"))
    assert np.all(np.diff(log.t) > 0.0)


@pytest.mark.parametrize(
    "repeats",
    [np.arange(50, 2000, 250), np.arange(500, 520, 2)],
    ids=["too few", "in one place"],
)
def test_other_repeated_times_are_an_error(tmp_path: Path, suffix: str, repeats: np.ndarray) -> None:
    df = coarse(2000, repeats)
    assert f"column t: t = {df['t'][repeats[0]]} repeats" in message(save(df, tmp_path / f"a{suffix}"))


def test_unclosed_quote(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text('t,mag_x,mag_y,mag_z,note\n0,20,0,40,"a\n1,20,0,40,b\n')
    assert message(path) == (
        "a.csv: row 0 (line 2): a quote is not closed in this line. Close it; text must not go on in the next line."
    )


def test_carriage_returns_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"t,mag_x,mag_y,mag_z\r0,20,0,40\r")
    assert message(path) == "a.csv: the lines end in CR alone. Save it with LF or CR LF line ends."


def test_last_line_without_end_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,mag_x,mag_y,mag_z\n0,20,0,40\n1,20,0,4")
    assert read(path).notes == (
        "a.csv: the last line has no line end; if the file was cut off, its last value is wrong",
    )


def test_values_that_are_no_numbers_in_npz(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t=np.arange(3.0), z=np.ones(3) * 1j)
    assert message(tmp_path / "a.npz") == (
        "a.npz: column z: the array holds values of type complex128. Save it as numbers or text."
    )


@pytest.mark.parametrize(
    "prose",
    [
        "Notes on the recording.\n\nThe sensor was mounted, on Tuesday, at the left arm.\nIt moved, and then, it stood."
        "\nDone.\n",
        "All of this was recorded.\nNothing was lost.\n",
    ],
)
def test_prose_is_not_called_a_damaged_table(prose: str, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text(prose, encoding="utf-8")
    with pytest.raises(InputError, match="not a table of numbers"):
        read(tmp_path / "notes.txt")


def test_a_cut_table_of_numbers_still_names_the_line(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,acc_x,acc_y,acc_z\n0,0,0,9.8\n0.01,0,0,9.8\n0.02,0\n", encoding="utf-8")
    with pytest.raises(InputError, match="the file was cut off"):
        read(tmp_path / "a.csv")
