"""Clocks, units and signs of foreign files in other dress than tests/foreign_files.py writes them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, read
from imufit.log.units import lookup
from pasted import python_mappings

N = 400
T = np.arange(N) / 100
ROWS = [f"0.1,{0.2 + 0.001 * k:.3f},9.8" for k in range(N)]
HEADER = "acc_x (m/s^2),acc_y (m/s^2),acc_z (m/s^2)"


def file(folder: Path, columns: dict[str, list[str]], name: str = "a.csv") -> Path:
    head = ",".join([*columns, HEADER])
    lines = [",".join([*cells, rest]) for *cells, rest in zip(*columns.values(), ROWS, strict=True)]
    path = folder / name
    path.write_text("\n".join([head, *lines]) + "\n")
    return path


def stamps(form: str, *start: int) -> list[str]:
    begin = datetime(*start, tzinfo=UTC)  # type: ignore[arg-type]
    return [(begin + timedelta(seconds=float(t))).strftime(form) for t in T]


def steady(log: Log) -> bool:
    return log.n == N and bool(np.allclose(log.t - log.t[0], T, atol=2e-5))


@pytest.mark.parametrize(
    ("form", "start", "seconds"),
    [
        ("%m/%d/%Y %H:%M:%S.%f", (2024, 6, 25, 8), 1_719_302_400),
        ("%d/%m/%Y %H:%M:%S.%f", (2024, 6, 25, 8), 1_719_302_400),
        ("%m/%d/%Y %I:%M:%S.%f %p", (2024, 6, 25, 20), 1_719_345_600),
        ("%H:%M:%S.%f", (2024, 6, 25, 23, 59, 58), 86_398),
    ],
)
def test_written_clocks(tmp_path: Path, form: str, start: tuple[int, ...], seconds: int) -> None:
    log = read(file(tmp_path, {"Time": stamps(form, *start)}))
    assert steady(log)
    assert log.t[0] == pytest.approx(seconds)


def test_order_of_day_and_month_is_asked_where_no_day_shows_it(tmp_path: Path) -> None:
    path = file(tmp_path, {"Time": stamps("%m/%d/%Y %H:%M:%S.%f", 2024, 6, 5, 23, 59, 58)})
    with pytest.raises(InputError, match=r"mm/dd/yyyy") as asked:
        read(path)
    (found,) = python_mappings(str(asked.value))
    assert steady(read(path, found))


def test_date_and_time_of_day_in_two_columns(tmp_path: Path) -> None:
    start = (2024, 6, 25, 23, 59, 58)
    log = read(file(tmp_path, {"Time": stamps("%H:%M:%S.%f", *start), "Date": stamps("%Y-%m-%d", *start)}))
    assert steady(log)
    assert log.t[0] > 1e9


@pytest.mark.parametrize(("name", "per_s", "size"), [("micros", 1e6, 2**32), ("t_ms", 1e3, 2**16)])
def test_counter_that_begins_again(tmp_path: Path, name: str, per_s: float, size: int) -> None:
    counts = (np.round(T * per_s).astype(int) + size - round(per_s)) % size
    log = read(file(tmp_path, {name: [str(count) for count in counts]}))
    assert steady(log)
    assert any("began anew" in note for note in log.notes)


def test_second_recording_in_one_file_is_no_counter_that_begins_again(tmp_path: Path) -> None:
    counts = np.concatenate([60_000 + 10 * np.arange(200), 10 * np.arange(200)])
    with pytest.raises(InputError, match="is before"):
        read(file(tmp_path, {"t_ms": [str(count) for count in counts]}))


@pytest.mark.parametrize(("factor", "sign"), [(1.0, 1.0), (1 / 9.80665, -1.0)])
def test_sign_of_sensor_logger_follows_from_the_unit(tmp_path: Path, factor: float, sign: float) -> None:
    values = np.tile([0.1, 0.2, 9.8], (N, 1)) * factor * sign
    lines = [f"{t:.3f},{z:.9f},{y:.9f},{x:.9f}" for t, (x, y, z) in zip(T, values, strict=True)]
    path = tmp_path / "AccelerometerUncalibrated.csv"
    path.write_text("\n".join(["seconds_elapsed,z,y,x", *lines]) + "\n")
    log = read(path)
    assert log.acc is not None
    np.testing.assert_allclose(log.acc, np.tile([0.1, 0.2, 9.8], (N, 1)), rtol=1e-5)


def test_units_of_two_sensors_are_asked_with_the_time_at_once(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    gyr = 90 * np.sin(T[:, None] * [1.0, 1.3, 1.7]) + 60
    acc = np.array([0.0, 0.0, 1.0]) + rng.normal(0, 0.002, (N, 3))
    rows = [",".join(f"{v:.5f}" for v in row) for row in np.column_stack([acc, gyr])]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z", *rows]) + "\n")
    with pytest.raises(InputError, match="column t is missing") as asked:
        read(path)
    (found,) = python_mappings(str(asked.value))
    log = read(path, found)
    assert log.acc is not None
    assert log.acc[:, 2].mean() == pytest.approx(9.80665, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "quantity", "si"),
    [
        *[(text, "specific force", 1.0) for text in ("m/s^2", "m·s⁻²", "ms-2", "mps2", "m/(s**2)", "m/s/s", "m s^-2")],
        *[(text, "angular rate", 1.0) for text in ("rad·s⁻¹", "rads-1", "rad/sec", "rad per s", "radps")],
        *[(text, "angular rate", np.pi / 180) for text in ("°/s", "º/s", "DEG/S", "dps", "degrees per second")],
        *[(text, "magnetic flux density", 1.0) for text in ("µT", "μT", "uT", "UT", "micro tesla")],
        ("milli-g", "specific force", 9.80665e-3),
        ("mG", "magnetic flux density", 0.1),
        ("mg", "magnetic flux density", 0.1),
        ("G", "specific force", 9.80665),
    ],
)
def test_spellings_of_units(text: str, quantity: str, si: float) -> None:
    known = lookup(text, quantity)
    assert known is not None
    assert known[:2] == (quantity, pytest.approx(si))


@pytest.mark.parametrize("text", ["a.u.", "local_flux", "no_units", "kg", "V", "%", "1/s", "m/s", "", "s/", "m" * 40])
def test_what_is_not_a_unit_of_a_sensor(text: str) -> None:
    assert lookup(text) is None
