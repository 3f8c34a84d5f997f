"""Figures of merit of a tilt, against signals whose figures are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.replaying.figures_of_merit import figures_of_merit, noise_band
from imufit.replaying.stretches import Rest, Stretches
from scipy.signal import welch

DT = 0.01


def time(seconds: float) -> np.ndarray:
    return np.arange(0.0, seconds, DT)


def one_rest(t: np.ndarray, vibrations=()) -> Stretches:
    return Stretches((Rest(0, t.size, 0.0, False, False),), np.zeros(t.size, bool), tuple(vibrations))


def after_a_move(t: np.ndarray, end: float, begin: float, vibrations=()) -> Stretches:
    """At rest until `begin`, moving until `end`, at rest again."""
    first, second = round(begin / DT), round(end / DT)
    moving = np.zeros(t.size, bool)
    moving[first:second] = True
    rests = (Rest(0, first, 0.0, False, True), Rest(second, t.size, 0.1, True, False))
    return Stretches(rests, moving, tuple(vibrations))


def column(degrees: np.ndarray) -> np.ndarray:
    return np.radians(degrees)[:, None]


def test_white_noise_has_its_offset_deviation_and_density() -> None:
    t = time(100.0)
    error = 0.3 + 0.12 * np.random.default_rng(1).normal(size=t.size)
    found = figures_of_merit(t, column(error), one_rest(t))
    assert found is not None
    assert found.offset_deg == pytest.approx(0.3, abs=0.005)
    assert found.sd_deg == pytest.approx(0.12, rel=0.03)
    assert found.rmse_deg == pytest.approx(np.hypot(0.3, 0.12), rel=0.01)
    assert found.noise_density_deg == pytest.approx(0.12 * np.sqrt(2 * DT), rel=0.03)
    assert abs(found.drift_deg_per_min) < 0.03
    assert found.sd_moving_deg is None
    assert (found.settling_s, found.settling_moves) == (None, 0)
    assert (found.vibration_deg, found.vibration_gain) == (None, None)


def test_the_density_of_filtered_noise_is_that_of_the_band() -> None:
    """y_k = a y_{k-1} + b x_k: its density is that of x times |H(f)|, root mean square over the band."""
    t = time(200.0)
    a, b = 0.97, 0.03
    white = np.random.default_rng(2).normal(size=t.size)
    filtered = np.empty_like(white)
    value = 0.0
    for k, x in enumerate(white):
        filtered[k] = value = a * value + b * x
    low, high = noise_band(t)
    assert (low, high) == pytest.approx((5.0, 50.0))
    frequency = np.linspace(low, high, 2000)
    gain = b / np.abs(1.0 - a * np.exp(-2j * np.pi * frequency * DT))
    expected = np.sqrt(2 * DT * np.mean(gain**2))
    found = figures_of_merit(t, column(filtered), one_rest(t))
    assert found is not None
    assert found.noise_density_deg == pytest.approx(expected, rel=0.05)


def test_the_density_is_that_of_welch() -> None:
    """scipy.signal.welch on the part that counts: the second half of the rest."""
    t = time(40.0)
    error = np.cumsum(np.random.default_rng(8).normal(0.0, 0.01, t.size))
    part = np.radians(error[t >= 0.5 * t[-1]])
    frequency, power = welch(part, 1.0 / DT, nperseg=128, detrend="linear")
    inside = (frequency >= 5.0) & (frequency < 50.0)
    found = figures_of_merit(t, column(error), one_rest(t))
    assert found is not None
    assert found.noise_density_deg == pytest.approx(np.degrees(np.sqrt(power[inside].mean())), rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(slope=st.floats(-6.0, 6.0), start=st.floats(-2.0, 2.0))
def test_drift_is_the_slope_and_no_noise(slope: float, start: float) -> None:
    t = time(20.0)
    found = figures_of_merit(t, column(start + slope / 60.0 * t), one_rest(t), bounded=False)
    assert found is not None
    assert found.drift_deg_per_min == pytest.approx(slope, abs=1e-9)
    assert found.offset_deg == pytest.approx(start + slope / 60.0 * t.mean(), abs=1e-9)
    assert found.noise_density_deg == pytest.approx(0.0, abs=1e-9)


def test_drift_is_that_of_the_rests_and_not_the_step_between_them() -> None:
    t = time(60.0)
    error = 0.5 / 60.0 * t + np.where(t > 21.0, 0.4, 0.0)
    found = figures_of_merit(t, column(error), after_a_move(t, 22.0, 20.0))
    assert found is not None
    assert found.drift_deg_per_min == pytest.approx(0.5, rel=1e-6)


def test_drift_over_many_short_rests_comes_from_their_means() -> None:
    t = time(120.0)
    rng = np.random.default_rng(3)
    rests = tuple(Rest(k * 400, k * 400 + 200, 0.1, k > 0, True) for k in range(30))
    error = 0.2 / 60.0 * t + 0.12 * rng.normal(size=t.size)
    found = figures_of_merit(t, column(error), Stretches(rests, np.zeros(t.size, bool), ()))
    assert found is not None
    assert found.drift_deg_per_min == pytest.approx(0.2, abs=0.05)


@pytest.mark.parametrize("tau", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("noise", [0.0, 0.12])
def test_an_exponential_settles_after_its_known_time(tau: float, noise: float) -> None:
    t = time(60.0)
    since = np.maximum(t - 12.0, 0.0)
    error = 0.4 + np.where(t < 10.0, 0.0, 2.0 * np.exp(-since / tau))
    error += noise * np.random.default_rng(4).normal(size=t.size)
    found = figures_of_merit(t, column(error), after_a_move(t, 12.0, 10.0), band_deg=0.2)
    assert found is not None
    spread = noise / np.sqrt(25.0)  # of the quarter second
    expected = tau * np.log(2.0 / 0.2)
    tolerance = 0.02 + tau * 3.0 * spread / 0.2
    assert found.settling_s == pytest.approx(expected, abs=tolerance)
    assert (found.settling_moves, found.settling_unfinished) == (1, 0)


def test_a_rest_too_short_to_settle_gives_a_lower_bound() -> None:
    t = time(18.0)
    error = np.where(t < 10.0, 0.0, 2.0 * np.exp(-np.maximum(t - 12.0, 0.0) / 8.0))
    found = figures_of_merit(t, column(error), after_a_move(t, 12.0, 10.0))
    assert found is not None
    assert found.settling_unfinished == 1
    short = figures_of_merit(t[:1350], column(error[:1350]), after_a_move(t[:1350], 12.0, 10.0))
    assert short is not None
    assert short.settling_s is None


def test_a_drifting_method_settles_at_once_on_its_line() -> None:
    t = time(60.0)
    error = column(0.05 * t)
    moved = after_a_move(t, 12.0, 10.0)
    drifting = figures_of_merit(t, error, moved, bounded=False)
    held = figures_of_merit(t, error, moved)
    assert drifting is not None
    assert held is not None
    assert drifting.settling_s == 0.0
    assert held.settling_s is not None
    assert held.settling_s > 10.0


def test_settling_is_judged_before_a_blow() -> None:
    t = time(60.0)
    error = np.where((t > 40.0) & (t < 41.0), 3.0, 0.0)
    found = figures_of_merit(t, column(error), after_a_move(t, 12.0, 10.0, [(4000, 4100)]))
    assert found is not None
    assert found.settling_s == 0.0


def test_swing_and_gain_of_a_vibration() -> None:
    t = time(20.0)
    shaken = (t >= 10.0) & (t < 11.0)
    force = np.where(shaken, 4.0 * np.sin(2 * np.pi * 10.0 * t), 0.0)
    rows = (1000, 1100)
    error = 0.2 + 0.1 * force + np.where(t > 15.0, 5.0, 0.0)
    found = figures_of_merit(t, column(error), one_rest(t, [rows]), by_force=column(force))
    assert found is not None
    assert found.vibration_deg == pytest.approx(0.4 / np.sqrt(2.0), rel=1e-3)
    assert found.vibration_gain == pytest.approx(0.1, rel=1e-3)


def test_the_drift_of_an_integrated_rate_is_no_swing() -> None:
    t = time(20.0)
    error = 0.5 * t + np.where((t >= 10.0) & (t < 11.0), 0.2, 0.0)
    rest = one_rest(t, [(1000, 1100)])
    force = column(np.ones(t.size) * (t >= 10.0))
    found = figures_of_merit(t, column(error), rest, by_force=force, bounded=False)
    assert found is not None
    assert found.vibration_deg == pytest.approx(0.2, abs=1e-9)
    assert found.vibration_gain == pytest.approx(0.2, abs=1e-9)


def test_a_vibration_is_no_noise() -> None:
    t = time(20.0)
    shaken = (t >= 15.0) & (t < 16.0)
    error = 0.01 * np.random.default_rng(5).normal(size=t.size) + np.where(shaken, 3.0 * np.sin(60.0 * t), 0.0)
    found = figures_of_merit(t, column(error), one_rest(t, [(1500, 1600)]))
    assert found is not None
    assert found.sd_deg == pytest.approx(0.01, rel=0.1)


def test_two_components_count_together() -> None:
    t = time(50.0)
    error = np.array([0.3, -0.4]) + np.random.default_rng(6).normal(0.0, 0.1, (t.size, 2))
    found = figures_of_merit(t, np.radians(error), one_rest(t))
    assert found is not None
    assert found.offset_deg == pytest.approx(0.5, abs=0.01)
    assert found.sd_deg == pytest.approx(0.1 * np.sqrt(2.0), rel=0.05)
    assert found.noise_density_deg == pytest.approx(0.1 * np.sqrt(2.0) * np.sqrt(2 * DT), rel=0.05)
    assert found.drift_deg_per_min >= 0.0


def test_only_counted_rows_make_rmse_and_offset() -> None:
    t = time(20.0)
    error = np.where(t < 10.0, 1.0, 2.0)
    error[100:200] = np.nan
    found = figures_of_merit(t, column(error), one_rest(t), counted=t >= 10.0)
    assert found is not None
    assert (found.offset_deg, found.rmse_deg) == pytest.approx((2.0, 2.0))
    assert figures_of_merit(t, column(error), one_rest(t), counted=t < 0.0) is None
    assert figures_of_merit(t, np.full((t.size, 1), np.nan), one_rest(t)) is None


@settings(max_examples=20, deadline=None)
@given(factor=st.floats(0.01, 100.0), shift=st.floats(-5.0, 5.0))
def test_figures_scale_with_the_error_and_only_offset_and_rmse_see_a_shift(factor: float, shift: float) -> None:
    t = time(15.0)
    base = 0.1 * np.random.default_rng(7).normal(size=t.size) + 0.02 * t
    one, other = (figures_of_merit(t, column(values), one_rest(t)) for values in (base, factor * base + shift))
    assert one is not None
    assert other is not None
    for name in ("sd_deg", "drift_deg_per_min", "noise_density_deg"):
        assert getattr(other, name) == pytest.approx(factor * getattr(one, name), rel=1e-6, abs=1e-12)
    assert other.offset_deg == pytest.approx(factor * one.offset_deg + shift, rel=1e-9, abs=1e-9)
