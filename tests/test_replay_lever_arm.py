"""The specific force of a swinging arm: a known lever arm leaves gravity alone."""

import numpy as np
import pytest
from imufit.log import Log
from imufit.replaying import Stream, replay
from scipy.spatial.transform import Rotation

ARM = np.array([0.05, -0.02, -0.30])
LEVER = {"lever_x": 0.05, "lever_y": -0.02, "lever_z": -0.30}
FIELD = np.array([20.0, 0.0, 44.0])


def swinging_arm(dt: float = 0.005, noise: float = 1.0) -> tuple[Log, Rotation]:
    """An arm that swings about the joint at the origin, NED; specific force from differences of the position."""
    rng = np.random.default_rng(11)
    t = dt * np.arange(round(30 / dt))

    def attitude(at: np.ndarray) -> Rotation:
        begun = np.clip((at - 3.0) / 2.0, 0.0, 1.0)[:, None]
        envelope = begun**3 * (10.0 - 15.0 * begun + 6.0 * begun**2)
        angles = np.stack([0.2 * np.sin(2.1 * at), 0.9 * np.sin(4.0 * at), 0.3 * np.sin(1.3 * at)], 1)
        return Rotation.from_euler("xyz", envelope * angles)

    truth, h = attitude(t), 1e-4
    before, after = attitude(t - h), attitude(t + h)
    acceleration = (after.apply(ARM) + before.apply(ARM) - 2.0 * truth.apply(ARM)) / h**2
    gyr = (before.inv() * after).as_rotvec() / (2.0 * h)
    acc = truth.inv().apply(acceleration - [0.0, 0.0, 9.80665])
    log = Log.from_arrays(
        t,
        acc=acc + noise * rng.normal(0, 0.04, acc.shape),
        gyr=gyr + noise * rng.normal(0, 0.001, gyr.shape),
        mag=truth.inv().apply(FIELD) + noise * rng.normal(0, 0.2, acc.shape),
        reference=truth,
        frame="NED",
    )
    return log, truth


def inclination(log: Log, name: str, rules: dict[str, float]) -> float:
    errors = replay(log, [name], {"replay": rules}).errors[name]
    assert errors is not None
    return errors["inclination_deg"]


@pytest.mark.parametrize("name", ["accel", "triad", "quest", "complementary", "mahony", "hybrid", "kalman"])
def test_a_known_lever_arm_takes_the_swing_out_of_every_filter(name: str) -> None:
    log, _ = swinging_arm()
    assert inclination(log, name, LEVER) < 0.15 * inclination(log, name, {})


def test_what_is_left_is_the_delay_of_half_a_row_and_of_the_low_pass() -> None:
    """With accelerations of the arm of 5 m/s^2."""
    log, _ = swinging_arm(noise=0.0)
    assert inclination(log, "triad", {}) > 10.0
    at_once, usual = (inclination(log, "triad", {**LEVER, "lever_time": time}) for time in (0.0, 0.005))
    assert at_once < 0.2
    assert at_once < usual < 0.4


def test_live_rows_give_the_same_bits_and_rows_without_a_rate_take_the_last() -> None:
    log, _ = swinging_arm(0.01)
    assert log.acc is not None
    assert log.gyr is not None
    gyr = log.gyr.copy()
    gyr[1::3] = np.nan
    thinned = Log.from_arrays(log.t, acc=log.acc, gyr=gyr, mag=log.mag, frame="NED")
    whole = replay(thinned, ["mahony"], {"replay": {**LEVER, "max_gap": 1.0}})
    stream = Stream(["mahony"], ["acc", "gyr", "mag"], frame="NED", settings={"replay": LEVER})
    pieces = [
        stream.extend(log.t[k : k + 7], acc=log.acc[k : k + 7], gyr=gyr[k : k + 7], mag=log.mag[k : k + 7])["mahony"]
        for k in range(0, len(log.t), 7)
    ]
    assert np.concatenate(pieces).tobytes() == whole.attitude["mahony"].tobytes()


def test_nothing_of_an_arm_beyond_numbers_reaches_a_filter() -> None:
    log, _ = swinging_arm(0.01)
    result = replay(log, ["triad"], {"replay": {"lever_x": 1e50}})
    assert np.isfinite(result.attitude["triad"]).all()
    with pytest.raises(ValueError, match="lever_x"):
        replay(log, ["triad"], {"replay": {"lever_x": 1e60}})
