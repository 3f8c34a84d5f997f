"""What a perfect sensor would have read comes from the reference alone, and to a millionth."""

from dataclasses import replace

import numpy as np
import pytest
from engine import residuals, swaying
from imufit import SensorModel
from imufit.lab import simulate
from imufit.lab.simulate import OBSERVABLE, Noise, SensorNoise
from scipy.spatial.transform import Slerp

QUIET = Noise(acc=SensorNoise(0.0), gyr=SensorNoise(0.0), mag=SensorNoise(0.0), temperature=0.0)
TIMING = {
    "even": {},
    "jittered": {"jitter": 1e-3},
    "jittered and with lost rows": {"jitter": 1e-3, "dropped": 0.02},
}


def relative(log, worst: bool = False) -> dict[str, float]:
    """Residual of the ideal sensor over the RMS of the reading, by sensor: its RMS, or its largest value."""
    _, found = residuals(log)
    out = {}
    for name, residual in found.items():
        known = np.isfinite(residual).all(axis=1)
        assert known.mean() > 0.95
        size = np.abs(residual[known]).max() if worst else np.sqrt(np.mean(residual[known] ** 2))
        out[name] = size / np.sqrt(np.mean(getattr(log, name) ** 2))
    return out


@pytest.mark.parametrize("timing", TIMING)
@pytest.mark.parametrize("frame", ["NED", "ENU", "NWU"])
def test_motion_worked_out_on_paper_leaves_no_residual(frame, timing):
    for seed in range(2):
        left = relative(swaying(frame, seed=seed, **TIMING[timing]), worst=True)
        assert left.keys() == {"acc", "gyr", "mag"}
        assert max(left.values()) < 1e-6, left


@pytest.mark.parametrize("timing", TIMING)
@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_exact_simulated_motion_leaves_no_residual(scenario, timing):
    # Steps of the simulated motions jump in the fourth derivative of the angle, which no polynomial follows: where they
    # carry the body along, the acceleration is off by some millionths for a few rows.
    allowed = {"acc": 3e-6, "gyr": 1e-6, "mag": 1e-12}
    for frame in ("NED", "ENU", "NWU"):
        noise = replace(QUIET, **TIMING[timing])
        log = simulate.simulate(scenario, {}, 1, 30.0, frame=frame, noise=noise, noise_in_metadata=False).to_log()
        for sensor, left in relative(log).items():
            assert left < allowed[sensor], (frame, sensor, left)


def test_far_from_the_origin_and_late_in_the_day_as_well():
    log = swaying(seed=4)
    moved = replace(log, t=log.t + 86400.0, ref_p=log.ref_p + np.array([4e3, -5e3, 300.0]))
    assert max(relative(moved, worst=True).values()) < 3e-6


@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_noise_of_the_reference_is_not_taken_for_an_effect(scenario):
    for seed in range(3):
        noise = Noise(attitude_deg=0.02)
        log = simulate.simulate(scenario, {}, seed, 60.0, noise=noise, noise_in_metadata=False).to_log()
        answer = SensorModel().fit(log).diagnose()
        assert (answer.verdict, answer.best, answer.unexplained) == ("adequate", None, ()), seed


def read_at(log, rate: float, interpolated: bool):
    """The log with a reference read at `rate` Hz only: nothing between, or interpolated with the true rows marked."""
    rows = np.unique(np.searchsorted(log.t, np.arange(log.t[0], log.t[-1], 1.0 / rate)))
    exact = np.zeros(log.n)
    exact[rows] = 1.0
    q, p = np.full_like(log.ref_q, np.nan), np.full_like(log.ref_p, np.nan)
    if not interpolated:
        q[rows], p[rows] = log.ref_q[rows], log.ref_p[rows]
        return replace(log, ref_q=q, ref_p=p)
    inside = log.t <= log.t[rows[-1]]
    q[inside] = Slerp(log.t[rows], log.reference[rows])(log.t[inside]).as_quat()[:, [3, 0, 1, 2]]
    p[inside] = np.stack([np.interp(log.t[inside], log.t[rows], log.ref_p[rows, k]) for k in range(3)], axis=1)
    return replace(log, ref_q=q, ref_p=p, covariates={"ref_exact": exact})


@pytest.mark.parametrize("interpolated", [False, True], ids=["missing between", "interpolated between"])
def test_a_reference_of_14_hz_is_enough_for_slow_motion(interpolated):
    slow = read_at(swaying(highest=0.4, seed=1, duration=60.0), 14.0, interpolated)
    assert max(relative(slow, worst=True).values()) < 1e-6
    noisy = read_at(swaying(highest=0.4, seed=1, duration=60.0, noise=1.0), 14.0, interpolated)
    answer = SensorModel().fit(noisy).diagnose()
    assert (answer.verdict, answer.unexplained) == ("adequate", ())


def test_rows_nearest_to_the_samples_of_an_interpolated_reference_are_found_without_marks():
    slow = read_at(swaying(highest=0.4, seed=1, duration=60.0), 14.0, interpolated=True)
    unmarked = replace(slow, covariates={})
    assert relative(unmarked)["gyr"] == pytest.approx(relative(slow)["gyr"], rel=0.1)


def test_nothing_is_invented_where_the_reference_is_lost():
    log = swaying(seed=2)
    log.ref_q[1000:1100] = np.nan
    _, found = residuals(log)
    for residual in found.values():
        assert np.isnan(residual[996:1104]).all()
        known = np.isfinite(residual).all(axis=1)
        assert known[:980].mean() > 0.98
        assert known[1120:].mean() > 0.98
