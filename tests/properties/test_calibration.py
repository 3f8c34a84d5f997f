"""Calibration for any sensor and any poses; garbage is refused, never worse."""

import json

import numpy as np
import pytest
from calibration_logs import GRAVITY, SIDES, UP, spread
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from imufit import Log, _imufit
from imufit.calibrating import calibrate
from imufit.errors import InputError

few = settings(max_examples=60, deadline=None)
seeds = st.integers(0, 2**31)


def sensor(seed):
    """Gain (condition below about 2) and bias."""
    rng = np.random.default_rng(seed)
    gain = np.diag(rng.uniform(0.8, 1.2, 3) * rng.choice([-1.0, 1.0], 3)) + rng.uniform(-0.1, 0.1, (3, 3))
    return gain, rng.uniform(-3.0, 3.0, 3)


@given(seed=seeds, extra=st.integers(0, 8))
@few
def test_vector_cost_returns_any_correction_from_exact_poses(seed, extra):
    gain, bias = sensor(seed)
    up = np.array([*UP.values(), *(spread(extra, seed) if extra else [])])
    targets = up * GRAVITY
    variances = np.random.default_rng(seed).uniform(1e-8, 1e-4, up.shape)
    found = _imufit.vector_calibration(targets @ gain.T + bias, variances, targets, GRAVITY)
    assert np.allclose(found["matrix"], np.linalg.inv(gain), rtol=0.0, atol=1e-8)
    assert np.allclose(found["bias"], -np.linalg.solve(gain, bias), rtol=0.0, atol=1e-8)
    split = np.array(found["misalignment"]) * found["scale"]
    assert np.allclose(split, found["matrix"], rtol=0.0, atol=1e-12)
    assert np.allclose(found["model_gain"] + np.eye(3), gain, rtol=0.0, atol=1e-8)
    assert np.allclose(found["model_bias"], bias, rtol=0.0, atol=1e-7)


@given(seed=seeds, count=st.integers(12, 30), data=st.data())
@few
def test_magnitude_cost_does_not_mind_the_order_of_the_poses(seed, count, data):
    rng = np.random.default_rng(seed)
    gain, bias = np.eye(3) + rng.normal(0.0, 0.03, (3, 3)), rng.normal(0.0, 0.3, 3)
    readings = np.array(spread(count, seed)) * GRAVITY @ gain.T + bias + rng.normal(0.0, 1e-3, (count, 3))
    groups, variances = np.arange(count, dtype=float), np.full(count, 1e-6)
    order = np.array(data.draw(st.permutations(range(count))))
    one = _imufit.magnitude_calibration(readings, groups, GRAVITY, variances=variances)
    other = _imufit.magnitude_calibration(readings[order], groups, GRAVITY, variances=variances)
    assert np.allclose(one["matrix"], other["matrix"], rtol=0.0, atol=1e-7)
    assert np.allclose(one["bias"], other["bias"], rtol=0.0, atol=1e-6)
    assert np.allclose(one["residuals"][order], other["residuals"], rtol=0.0, atol=1e-6)
    assert np.allclose(one["held_out_length"][order], other["held_out_length"], rtol=0.0, atol=1e-5)


@given(seed=seeds)
@few
def test_magnitude_cost_turns_with_the_axes(seed):
    rng = np.random.default_rng(seed)
    gain, bias = np.eye(3) + rng.normal(0.0, 0.03, (3, 3)), rng.normal(0.0, 0.3, 3)
    readings = np.array(spread(16, seed)) * GRAVITY @ gain.T + bias
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    groups, variances = np.arange(16.0), np.full(16, 1e-6)
    one = _imufit.magnitude_calibration(readings, groups, GRAVITY, variances=variances)
    other = _imufit.magnitude_calibration(readings @ turn.T, groups, GRAVITY, variances=variances)
    assert np.allclose(turn @ one["matrix"] @ turn.T, other["matrix"], rtol=0.0, atol=1e-6)
    assert np.allclose(turn @ one["bias"], other["bias"], rtol=0.0, atol=1e-5)


finite = st.floats(allow_nan=False, allow_infinity=False)
"""Any number there is, up to 1e308."""
readable = st.one_of(st.floats(-30.0, 30.0), st.sampled_from([0.0, GRAVITY, -GRAVITY, 1.0, 16384.0, np.nan]), finite)


@given(
    readings=arrays.arrays(np.float64, st.tuples(st.integers(0, 20), st.just(3)), elements=finite),
    variance=st.sampled_from([0.0, 1e-300, 1e-6, 1e300]),
    sides=st.booleans(),
    misalignment=st.booleans(),
)
@settings(max_examples=150, deadline=None)
def test_costs_answer_any_finite_numbers_with_a_result_or_a_refusal(readings, variance, sides, misalignment):
    n = len(readings)
    variances = np.full((n, 3), variance)
    targets = (
        np.array([UP[SIDES[k % 6]] * GRAVITY for k in range(n)]).reshape(-1, 3) if sides else readings[::-1].copy()
    )
    for call in (
        lambda: _imufit.vector_calibration(readings, variances, targets, GRAVITY),
        lambda: _imufit.magnitude_calibration(
            readings, np.arange(float(n)), GRAVITY, variances=variances[:, 0], misalignment=misalignment
        ),
        lambda: _imufit.magnitude_calibration(readings, np.zeros(n), GRAVITY, up=targets),
        lambda: _imufit.sphere(readings),
    ):
        try:
            found = call()
        except (InputError, ValueError):
            continue
        assert found is None or isinstance(found, dict | tuple)


@given(
    rows=arrays.arrays(np.float64, st.tuples(st.integers(1, 60), st.just(6)), elements=readable),
    repeat=st.integers(1, 40),
    labels=st.lists(st.sampled_from([None, *SIDES]), min_size=1, max_size=6),
    rate=st.sampled_from([0.5, 5.0, 100.0, 4000.0]),
    cost=st.sampled_from([None, "vector", "magnitude"]),
)
@settings(max_examples=150, deadline=None)
def test_log_of_garbage_gives_a_calibration_or_a_refusal(rows, repeat, labels, rate, cost):
    rows = np.repeat(rows, repeat, axis=0)
    n = len(rows)
    pose = [labels[k * len(labels) // n] for k in range(n)]
    try:
        log = Log.from_arrays(np.arange(n) / rate, acc=rows[:, :3], gyr=rows[:, 3:], mag=rows[:, 2:5], pose=pose)
        result = calibrate(log, cost)
    except (InputError, ValueError):
        return
    json.dumps(result.to_dict(), allow_nan=False)
    assert result.verdict


@given(
    rows=arrays.arrays(np.float64, st.tuples(st.integers(1, 200), st.just(7)), elements=readable),
    hold=st.sampled_from([1e-9, 0.1, 1e9]),
    fewest=st.sampled_from([1.0, 5.0, 1e18]),
)
@settings(max_examples=100, deadline=None)
def test_judge_bears_any_sample(rows, hold, fewest):
    judge = _imufit.PoseJudge({"hold": hold, "fewest": fewest})
    for t, *six in rows.tolist():
        judged = judge.step(t, six[:3], six[3:])
        assert judged["state"] in ("moving", "settling", "held")
        assert 0.0 <= judged["progress"] <= 1.0
    judge.finish()


def test_group_numbers_may_be_any():
    readings = np.array(spread(12)) * GRAVITY
    groups = np.array([1e18, 1e6, *range(10)], dtype=float)
    plain = _imufit.magnitude_calibration(readings, np.arange(12.0), GRAVITY, variances=np.full(12, 1e-6))
    found = _imufit.magnitude_calibration(readings, groups, GRAVITY, variances=np.full(12, 1e-6))
    assert found["matrix"] == pytest.approx(np.array(plain["matrix"]), abs=1e-9)
