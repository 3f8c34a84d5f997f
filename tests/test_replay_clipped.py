"""Where a sensor's range ends: found where readings are cut off, and nowhere else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import InputError, Log
from imufit.lab.simulate import simulate
from imufit.replaying import replay
from imufit.replaying.clipped import end_of_range, ranges

G = 9.80665
SEEDS = st.integers(0, 10**6)


def quantised(x: np.ndarray, step: float) -> np.ndarray:
    """To whole steps: those of 250 and 2000 deg/s in 16 bit are 1.33e-4 and 1.07e-3 rad/s."""
    return np.round(x / step) * step


def swing(seed: int, rate: float, amplitude: float, noise: float, seconds: float = 20.0) -> np.ndarray:
    """A smooth motion on three axes, (n, 3)."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    phases, speeds = rng.uniform(0.0, 6.0, (3, 3)), rng.uniform(1.0, 9.0, (3, 3))
    parts = np.sin(t[:, None, None] * speeds + phases).sum(axis=2) / 1.7
    return amplitude * parts + noise * rng.standard_normal((t.size, 3))


class TestFound:
    """Readings that are cut off."""

    @settings(max_examples=40, deadline=None)
    @given(SEEDS, st.sampled_from([100.0, 400.0]), st.sampled_from([1e-12, 1.33e-4, 1.07e-3]), st.floats(0.3, 0.85))
    def test_a_swing_beyond_the_range(self, seed: int, rate: float, step: float, part: float) -> None:
        motion = swing(seed, rate, 5.0, 0.002)
        end = quantised(part * np.abs(motion).max(), step)
        cut = np.clip(quantised(motion, step), -end, end)
        assert end_of_range(cut, 1.0) == pytest.approx(end)

    @pytest.mark.parametrize("scenario", ["handheld", "arm", "poses"])
    def test_a_simulated_gyro_that_saturates(self, scenario: str) -> None:
        made = simulate(scenario, {"gyr.saturation": None}, seed=0, duration=60.0)
        found = ranges(Log.from_arrays(made.t, acc=made.acc, gyr=made.gyr))
        assert found == {"gyr_range": pytest.approx(made.truth.effects["gyr.saturation"]["range"])}

    def test_the_asymmetric_ends_of_two_s_complement_are_one_range(self) -> None:
        counts = np.clip(np.round(swing(2, 200.0, 6.0, 0.01) * 131.0 * 57.3), -32768, 32767)
        rates = counts / 131.0 / 57.3
        end = end_of_range(rates, 1.0)
        assert end is not None
        log = Log.from_arrays(np.arange(len(rates)) / 200.0, acc=np.tile([0.0, 0.0, G], (len(rates), 1)), gyr=rates)
        clipped = ((counts == 32767) | (counts == -32768)).any(axis=1)
        assert replay(log, ["kalman"]).skipped["gyr_clipped"] == pytest.approx(clipped.sum(), abs=2)

    def test_blows_on_a_resting_sensor(self) -> None:
        rng = np.random.default_rng(0)
        acc = rng.normal([0.0, 0.0, G], 0.03, (4000, 3))
        for row in range(500, 4000, 700):
            ring = 60.0 * np.exp(-np.arange(40) / 15.0) * np.cos(0.4 * np.arange(40))
            acc[row : row + 40] += np.outer(ring, [1.0, -0.4, 0.7])
        acc = np.clip(quantised(acc, G / 16384), -2 * G, 32767 / 16384 * G)
        assert end_of_range(acc, 1.5 * G) == pytest.approx(2 * G, rel=1e-4)
        log = Log.from_arrays(np.arange(4000) * 0.005, acc=acc, gyr=rng.normal(0.0, 1e-3, (4000, 3)), frame="ENU")
        used, not_known = replay(log, ["complementary"]), replay(log, ["complementary"], {"replay": {"acc_range": 0.0}})
        assert used.skipped["acc_clipped"] == np.count_nonzero(np.abs(acc).max(axis=1) > 1.9999 * G)
        assert "acc_clipped" not in not_known.skipped
        swings = [np.ptp(result.euler("complementary")[400:, 1]) for result in (used, not_known)]
        assert swings[0] < 0.8 * swings[1]

    @settings(max_examples=20, deadline=None)
    @given(SEEDS)
    def test_blows_of_a_single_row_at_coarse_resolution(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        acc = rng.normal([0.0, 0.0, G], 0.1, (20_000, 3))
        blows = rng.choice(20_000, 300, replace=False)
        acc[blows, 1] += rng.uniform(8.0, 24.0, 300)
        assert end_of_range(np.minimum(quantised(acc, 0.01 * G), 2 * G), 1.5 * G) == pytest.approx(2 * G)
        assert end_of_range(quantised(acc, 0.01 * G), 1.5 * G) is None


class TestNoFalseAlarm:
    """Readings that stand still for other reasons."""

    @settings(max_examples=40, deadline=None)
    @given(SEEDS, st.floats(0.05, 3.0), st.sampled_from([2.0, 20.0, 40.0]))
    def test_a_resting_or_evenly_turning_sensor_of_coarse_resolution(
        self, seed: int, noise: float, level: float
    ) -> None:
        rng, step = np.random.default_rng(seed), 0.05
        readings = level * rng.permutation([1.0, 0.02, -0.1]) + noise * step * rng.standard_normal((5000, 3))
        assert end_of_range(quantised(readings, step), 1.0) is None

    @settings(max_examples=40, deadline=None)
    @given(SEEDS, st.sampled_from([0.001, 0.01, 0.1]), st.sampled_from([100.0, 1000.0]), st.floats(0.0, 0.5))
    def test_a_swing_of_coarse_resolution(self, seed: int, step: float, rate: float, noise: float) -> None:
        motion = swing(seed, rate, 5.0, noise * step, seconds=10.0)
        assert end_of_range(quantised(motion, step), 1.0) is None

    @settings(max_examples=40, deadline=None)
    @given(SEEDS, st.integers(2, 10), st.sampled_from([0.0, 0.001]))
    def test_a_column_that_is_held_until_the_next_sample(self, seed: int, rows: int, step: float) -> None:
        motion = swing(seed, 50.0, 5.0, 0.0)
        held = np.repeat(quantised(motion, step) if step else motion, rows, axis=0)
        assert end_of_range(held, 1.0) is None

    def test_a_noisy_top_that_happens_to_stand_for_three_rows(self) -> None:
        top = [[7679, -2962, 4927], [7701, -2852, 4604], [7722, -2726, 4274], [7731, -2613, 3974], [7731, -2488, 3647]]
        top += [[7731, -2371, 3352], [7715, -2246, 3017], [7694, -2102, 2676], [7682, -1975, 2359]]
        rest = [[0, 0, 0], [1, 1, 1]]  # shows the resolution
        assert end_of_range(np.array([*rest, *top]) * 2.66e-4, 1.0) is None
        beyond = np.array([*top, *rest])
        beyond[[0, 1, 2, 6, 7, 8], 0] -= [2100, 1500, 900, 1100, 1700, 2300]  # the same rows on the way past the end
        assert end_of_range(beyond * 2.66e-4, 1.0) == pytest.approx(7731 * 2.66e-4)

    @pytest.mark.parametrize("scenario", ["handheld", "arm", "tilt", "poses"])
    def test_simulated_motion_with_realistic_noise(self, scenario: str) -> None:
        for seed in range(4):
            made = simulate(scenario, {}, seed=seed, duration=20.0, realistic=True)
            assert ranges(Log.from_arrays(made.t, acc=made.acc, gyr=made.gyr)) == {}

    def test_steps_from_pose_to_pose_and_rate_to_rate_without_noise(self) -> None:
        levels = np.repeat([[0.0, 0.0, 20.0], [20.0, 0.0, 0.0], [0.0, -20.0, 0.0], [0.0, 0.0, 20.0]], 50, axis=0)
        assert end_of_range(levels, 1.0) is None

    def test_nothing_zeros_a_constant_and_what_is_not_finite(self) -> None:
        for column in (np.zeros((50, 3)), np.full((50, 3), 30.0), np.full((50, 3), np.nan), np.empty((0, 3))):
            assert end_of_range(column, 1.0) is None
        spoiled = swing(0, 100.0, 5.0, 0.01)
        spoiled[10:20, 0] = np.inf
        spoiled[30:40, 1] = np.nan
        assert end_of_range(spoiled, 1.0) is None

    def test_gravity_alone_is_no_end_of_a_range(self) -> None:
        rng = np.random.default_rng(0)
        acc = np.clip(rng.normal([0.0, 0.0, G], 0.5, (2000, 3)), -G, G)
        log = Log.from_arrays(np.arange(2000) * 0.01, acc=acc, gyr=np.zeros((2000, 3)), frame="ENU")
        assert ranges(log) == {}


class TestMetadata:
    """A range that the log states comes first."""

    def test_it_is_used_and_a_setting_comes_before_it(self) -> None:
        acc = np.tile([0.0, 0.0, G], (100, 1))
        acc[50, 0] = 40.0
        log = Log.from_arrays(np.arange(100) * 0.01, acc=acc, gyr=np.zeros((100, 3)), acc_range=39.0, gyr_range=9.0)
        assert ranges(log) == {"acc_range": 39.0, "gyr_range": 9.0}
        assert replay(log, ["kalman"]).skipped == {"acc_clipped": 1}
        assert replay(log, ["kalman"], {"replay": {"acc_range": 50.0}}).skipped == {}

    @pytest.mark.parametrize("wrong", ["16 g", -1.0, 0, True, float("nan"), [2], 1e200])
    def test_what_is_no_range_is_refused_by_name(self, wrong: object) -> None:
        with pytest.raises(InputError, match=r"metadata acc_range is .*, which is not the end of a range"):
            Log.from_arrays(np.arange(3) * 0.01, acc=np.ones((3, 3)), acc_range=wrong)
