"""A number in a mapping: a column of the log that is the same in every row."""

from __future__ import annotations

from pathlib import Path

import imufit
import numpy as np
import pandas as pd
import pytest
from imufit import Log
from imufit.cli.app import main
from imufit.errors import InputError
from imufit.log import LogStream

HEAD = "t,gyr_x,gyr_y,gyr_z"
ROWS = [f"{0.01 * k:.2f},0.{k % 7},0.2,-0.{k % 3}" for k in range(300)]


def file_with(tmp_path: Path, more_head: str = "", more: str = "") -> Path:
    path = tmp_path / "log.csv"
    path.write_text("\n".join([HEAD + more_head, *(row + more for row in ROWS)]) + "\n")
    return path


@pytest.mark.parametrize(
    ("target", "text", "value"),
    [
        ("temp", "21", 21.0),
        ("temp", "294.15[K]", 21.0),
        ("temp", "-4e1[degC]", -40.0),
        ("temp", "+ .5", 0.5),
        ("temp", "17[340 LSB/degC + 36.53]", 17.0 / 340.0 + 36.53),
        ("ref_angle", "5[deg]", np.deg2rad(5.0)),
        ("ref_angle", "-5[deg]", np.deg2rad(-5.0)),
        ("load", "3", 3.0),
    ],
)
def test_a_number_stands_in_every_row_of_its_column(tmp_path: Path, target: str, text: str, value: float) -> None:
    path = file_with(tmp_path)
    log = imufit.read(path, mapping={target: text})
    column = log.to_dataframe()[target]
    np.testing.assert_allclose(column, np.full(len(ROWS), value), rtol=1e-12)
    for chunk in LogStream(path, mapping={target: text}).chunks(100, 10):
        np.testing.assert_allclose(chunk.log.to_dataframe()[target], value, rtol=1e-12)


def test_a_table_in_memory_takes_numbers_too() -> None:
    table = pd.DataFrame({"t": np.arange(5.0) / 100.0, "gx": np.ones(5)})
    log = Log.from_dataframe(table, mapping={"gyr_x": "gx[deg/s]", "gyr_y": "0", "gyr_z": "180[deg/s]"})
    assert log.gyr is not None
    np.testing.assert_allclose(log.gyr, np.tile([np.pi / 180.0, 0.0, np.pi], (5, 1)), rtol=1e-12)


def test_a_column_of_that_name_comes_first() -> None:
    table = pd.DataFrame({"t": np.arange(5.0) / 100.0, "21": np.full(5, 7.0), "-3": np.full(5, 8.0)})
    table[["gyr_x", "gyr_y", "gyr_z"]] = 0.5
    for text, value in (("21", 7.0), ("-21", -7.0), ("-3", 8.0), ("22", 22.0)):
        assert set(Log.from_dataframe(table, mapping={"temp": text}).to_dataframe()["temp"]) == {value}


def test_a_column_that_gives_way_to_a_number_is_told_of(tmp_path: Path) -> None:
    log = imufit.read(file_with(tmp_path, ",temp", ",30"), mapping={"temp": "21"})
    assert log.temp is not None
    assert set(log.temp) == {21.0}
    assert any("column temp left out" in note for note in log.notes)


@pytest.mark.parametrize(
    ("target", "text", "said"),
    [
        ("t", "5", "t cannot be a number"),
        ("pose", "1", "pose cannot be a number"),
        ("temp", "1e999", "too large"),
        ("temp", "5[rad]", "rad"),
        ("temp", "nan", "column nan is not in the file"),
        ("temp", "0x10", "column 0x10 is not in the file"),
        ("temp", "1_0", "column 1_0 is not in the file"),
    ],
)
def test_what_cannot_be_a_constant_is_refused(tmp_path: Path, target: str, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        imufit.read(file_with(tmp_path), mapping={target: text})


def test_the_command_line_takes_numbers(tmp_path: Path) -> None:
    out = tmp_path / "log.parquet"
    path = file_with(tmp_path)
    arguments = ["--map", "temp=21,ref_angle=5[deg]", "-o", str(out)]
    assert main(["convert", str(path), *arguments]) == 0
    log = imufit.read(out)
    assert log.temp is not None
    assert log.ref_angle is not None
    assert set(log.temp) == {21.0}
    np.testing.assert_allclose(log.ref_angle, np.deg2rad(5.0), rtol=1e-12)
