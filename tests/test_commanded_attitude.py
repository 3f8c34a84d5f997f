"""A rig's commanded angle stands in for a measured attitude that is the same but for its noise, and for no other."""

from __future__ import annotations

from dataclasses import replace

import imufit
import numpy as np
import pytest
from imufit.fitting.commanded import CommandedAttitude
from imufit.lab.simulate import simulate
from imufit.log import Log
from scipy.spatial.transform import Rotation

NOISE = np.radians(0.03)


def rig_log(attitude_error: np.ndarray | None = None, seed: int = 1) -> tuple[Log, np.ndarray]:
    """Return a log of a tilting rig whose measured attitude has an error (n, 3), rad, and the true attitude."""
    simulation = simulate("tilt", {"rig.backlash": {"width": 3e-4}}, seed, rig_axis="y", duration=60.0)
    error = np.random.default_rng(seed).normal(0.0, NOISE, (simulation.t.size, 3))
    error = error if attitude_error is None else error + attitude_error
    clean = simulation.ref_q
    noisy = Rotation.from_quat(clean, scalar_first=True) * Rotation.from_rotvec(error)
    return replace(simulation, ref_q=noisy.as_quat(scalar_first=True)).to_log(), clean


def commanded(log: Log) -> CommandedAttitude | None:
    return CommandedAttitude.of([log.rows(0, 1000), log.rows(1000, log.n)], 1)


def test_an_attitude_that_differs_by_noise_alone_is_taken_from_the_commanded_angle() -> None:
    log, clean = rig_log()
    found = commanded(log)
    assert found is not None
    assert log.ref_angle is not None
    apart = Rotation.from_quat(clean, scalar_first=True).inv() * Rotation.from_quat(
        found.attitude(log.ref_angle), scalar_first=True
    )
    assert np.max(apart.magnitude()) < 6.0 * NOISE / np.sqrt(log.n)


@pytest.mark.parametrize("kind", ["drifts", "bends", "plays"])
def test_an_attitude_that_tells_more_than_the_command_stays(kind: str) -> None:
    log, _ = rig_log()
    angle = log.ref_angle
    assert angle is not None
    course = {
        "drifts": np.linspace(-1.0, 1.0, log.n),
        "bends": np.sin(angle) - np.mean(np.sin(angle)),
        "plays": np.where(np.gradient(angle) > 0.0, 0.5, -0.5),
    }[kind]
    error = np.zeros((log.n, 3))
    error[:, 1] = NOISE * course
    assert commanded(rig_log(error)[0]) is None


def test_a_command_that_is_as_noisy_as_the_attitude_is_not_taken() -> None:
    log, _ = rig_log()
    assert log.ref_angle is not None
    noisy = replace(log, ref_angle=log.ref_angle + np.random.default_rng(2).normal(0.0, NOISE, log.n))
    assert commanded(noisy) is None


def test_play_is_found_beside_a_noisy_attitude() -> None:
    log, _ = rig_log()
    fit = imufit.SensorModel(["rig.backlash"]).fit(log)
    (width,) = fit.parameters
    assert width.standard_error < 0.05 * 3e-4
    assert abs(width.value - 3e-4) < 3.0 * width.standard_error
    assert any("ref_angle" in note for note in fit.diagnose().notes)
