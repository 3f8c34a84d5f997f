"""A clock coarser than the rows is spread evenly and told; copied rows and spliced logs are refused."""

from __future__ import annotations

from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit.errors import InputError
from imufit.lab.simulate import simulate


@pytest.fixture(scope="module")
def table():
    """Readings in motion at 2 kHz."""
    return simulate("handheld", {}, seed=4, rate=2000, duration=5).to_log().to_dataframe()


def saved(table, t: np.ndarray, folder: Path) -> Path:
    path = folder / "log.csv"
    table.assign(t=t).to_csv(path, index=False)
    return path


@pytest.mark.parametrize("step", [0.001, 0.0013, 0.004, 0.01, 0.0007])
def test_rows_between_two_stamps_are_spread_evenly(table, tmp_path: Path, step: float):
    true = table["t"].to_numpy()
    stamps = np.round(np.floor(true / step + 1e-9) * step, 9)
    log = imufit.read(saved(table, stamps, tmp_path))
    assert np.all(np.diff(log.t) > 0.0)
    assert np.abs(log.t - true).max() <= step
    assert np.std(log.t - true) < 0.5 * step
    assert any(f"steps of {step:.3g} s" in note for note in log.notes)


def test_bursts_are_spread_over_the_time_to_the_next(table, tmp_path: Path):
    true = table["t"].to_numpy()
    rng = np.random.default_rng(1)
    firsts = np.arange(0, true.size, 20)
    arrival = true[firsts] + rng.uniform(0.0, 4e-4, firsts.size)
    log = imufit.read(saved(table, np.repeat(arrival, 20)[: true.size], tmp_path))
    assert np.all(np.diff(log.t) > 0.0)
    assert np.abs(log.t - true).max() < 1e-3


def test_over_a_pause_the_rows_stay_close(table, tmp_path: Path):
    true = table["t"].to_numpy()
    stamps = np.floor(true * 1000.0 + 1e-6) / 1000.0 + np.where(true > 2.5, 60.0, 0.0)
    log = imufit.read(saved(table, stamps, tmp_path))
    assert np.diff(log.t).max() > 59.9
    assert np.sum(np.diff(log.t) > 0.01) == 1


def test_rows_that_are_copies_of_one_another_are_refused(table, tmp_path: Path):
    twice = table.iloc[::4].loc[lambda rows: rows.index.repeat(2)].reset_index(drop=True)
    with pytest.raises(InputError, match=r"repeats t = .* of row 0"):
        imufit.read(saved(twice, twice["t"].to_numpy(), tmp_path))


@pytest.mark.parametrize("where", [slice(100, 160), slice(100, 108)])
def test_a_stretch_at_one_time_is_refused(table, tmp_path: Path, where: slice):
    t = table["t"].to_numpy().copy()
    t[where] = t[where.start]
    with pytest.raises(InputError, match="repeats"):
        imufit.read(saved(table, t, tmp_path))


def test_stretches_of_any_length_at_one_time_are_refused(table, tmp_path: Path):
    """Steps that have no say in how many rows they have are not those of a clock."""
    steps = np.full(len(table), 5e-4)
    rng = np.random.default_rng(3)
    for first in range(50, len(table) - 400, 400):
        steps[first : first + rng.integers(2, 300)] = 0.0
    t = np.round(np.cumsum(steps), 9)
    with pytest.raises(InputError, match="repeats"):
        imufit.read(saved(table, t, tmp_path))
