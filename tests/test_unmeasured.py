"""A single reading that cannot be is told and left out; many of them make the log one that cannot be used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit import Log
from imufit.cli.app import main
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from imufit.log import LogStream, read
from imufit.report import page

ROW = 1234


@pytest.fixture(scope="module")
def sound() -> Log:
    return simulate("poses", {"gyr.bias": {"x": 0.02}}, seed=7, duration=120).to_log()


def spoilt(sound: Log, folder: Path, changes: dict[tuple[int, str], float], suffix: str = ".csv") -> Path:
    table = sound.to_dataframe()
    for (row, column), value in changes.items():
        table.loc[row, column] = value
    path = folder / f"log{suffix}"
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path)
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize(
    ("column", "value", "unit"),
    [("acc_x", 1e12, " m/s^2"), ("gyr_z", -np.inf, " rad/s"), ("mag_y", 3e38, " uT"), ("temp", 1e9, " degC")],
)
def test_one_reading_is_left_out_and_told(
    sound: Log, tmp_path: Path, suffix: str, column: str, value: float, unit: str
):
    log = imufit.read(spoilt(sound, tmp_path, {(ROW, column): value}, suffix))
    line = f" (line {ROW + 2})" if suffix == ".csv" else ""
    told = f"log{suffix}: row {ROW}{line}, column {column}: {value:.6g}{unit} cannot be measured; left out"
    assert told in log.notes
    field = column.split("_", maxsplit=1)[0]
    expected = np.array(getattr(sound, field))
    expected[ROW] = np.nan  # the whole sample of a sensor
    np.testing.assert_array_equal(getattr(log, field), expected)


def test_a_log_on_disk_tells_once_it_has_been_read(sound: Log, tmp_path: Path):
    stream = LogStream(spoilt(sound, tmp_path, {(ROW, "acc_x"): 1e12, (9999, "acc_x"): -1e12}))
    for _ in range(2):
        assert sum(np.isnan(chunk.core.acc).any(axis=1).sum() for chunk in stream.chunks(1000, 10)) == 2
        assert sum("cannot be measured" in note for note in stream.notes) == 2


def test_many_are_refused_with_the_first(sound: Log, tmp_path: Path):
    rows = range(100, 100 + sound.n // 100)
    few = {(row, "acc_x"): 1e12 for row in rows}
    notes = imufit.read(spoilt(sound, tmp_path, few)).notes
    assert notes[-1].endswith(f"{len(few) - 5} more readings cannot be measured; left out")
    many = {**few, (50, "acc_x"): np.inf}
    with pytest.raises(InputError, match=r"row 50 \(line 52\), column acc_x: inf is not a reading"):
        imufit.read(spoilt(sound, tmp_path, many))


def test_of_a_slow_sensor_its_own_samples_count(sound: Log, tmp_path: Path):
    """Two of a hundred samples of a magnetometer are many, however many rows the log has."""
    table = sound.to_dataframe()
    mag = ["mag_x", "mag_y", "mag_z"]
    table.loc[table.index % 120 != 0, mag] = np.nan
    table.loc[[1200, 2400], "mag_x"] = 1e12
    table.to_csv(tmp_path / "slow.csv", index=False)
    with pytest.raises(InputError, match="row 1200"):
        imufit.read(tmp_path / "slow.csv")


@pytest.mark.parametrize(
    "command",
    [
        ("compare",),
        ("diagnose",),
        ("replay", "--filter", "mahony,kalman"),
        ("calibrate", "--sensor", "acc"),
        ("info", "--quick"),
    ],
)
def test_commands_go_on_and_print_the_note(
    sound: Log, tmp_path: Path, command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
):
    path = spoilt(sound, tmp_path, {(ROW, "acc_x"): 1e12, (ROW + 500, "gyr_y"): np.inf})
    assert main([command[0], str(path), *command[1:]]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"row {ROW} (line {ROW + 2}), column acc_x: 1e+12 m/s^2 cannot be measured; left out" in said


def test_tables_and_arrays_are_held_to_the_same(sound: Log):
    acc = np.array(sound.acc)
    acc[ROW, 1] = 1e12
    log = Log.from_arrays(sound.t, acc=acc)
    assert np.isnan(log.acc[ROW]).all()
    assert "row 1234, column acc_y: 1e+12 m/s^2 cannot be measured; left out" in log.notes[0]
    table = sound.to_dataframe()
    table.loc[ROW, "ref_qw"] = 1e30
    read = Log.from_dataframe(table)
    assert np.isnan(read.ref_q[ROW]).all()
    assert np.isfinite(np.delete(read.ref_q, ROW, axis=0)).all()


def test_an_empty_cell_beside_readings_of_the_other_axes_is_counted_and_said(tmp_path: Path) -> None:
    rows = ["t,acc_x,acc_y,acc_z", *(f"{0.01 * k:.2f},0,{'NaN' if k in (3, 7) else 0.1},9.8" for k in range(20))]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    found = [note for note in read(tmp_path / "a.csv").notes if "acc_y" in note]
    assert len(found) == 1
    assert "row 3 (line 5), column acc_y: the cell is empty" in found[0]
    assert "has 2 such cells" in found[0]


def test_a_sample_that_is_missing_as_a_whole_is_not_an_empty_cell(tmp_path: Path) -> None:
    rows = ["t,acc_x,acc_y,acc_z", *(f"{0.01 * k:.2f},{',,' if k % 2 else '0,0,9.8'}" for k in range(20))]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert not any("empty" in note for note in read(tmp_path / "a.csv").notes)


def test_a_sensor_with_too_few_samples_has_no_spectrum() -> None:
    log = simulate("handheld", {}, 3, 30.0).to_log()
    assert log.acc is not None
    acc, odd = log.acc.copy(), np.full(log.n, np.nan)
    acc[36:, 2], acc[1081:, 1], acc[700:710, 0], odd[700] = np.nan, np.nan, np.nan, 1.0
    fit = imufit.fit(replace(log, acc=acc, covariates={"odd": odd}))
    compared, answer = fit.compare(), fit.diagnose()
    assert set(compared.sensors) == {"gyr", "mag"} == {spectrum.channel[:3] for spectrum in compared.spectra}
    (judged,) = (item for item in answer.judged if item.sensor == "acc")
    assert not judged.judged
    assert "<html" in page(compared, answer)
