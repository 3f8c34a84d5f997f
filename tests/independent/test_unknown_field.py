"""Checks of the logs of an unknown field against themselves: formulas, frames, what cannot be told apart, the draws."""

from dataclasses import replace

import numpy as np
import pytest
import unknown_field as uf
from motion_and_reference import gravity_vector, to_matrix
from whole_sensor import GRAVITY, SEEN, SENSORS, Bench, State, clean, small_turns, vector

RNG = np.random.default_rng(1)
ONES = range(len(uf.KINDS))
NAMES = [kind.name for kind in uf.KINDS]
MOTIONS = (uf.phone, uf.boat, uf.vehicle, uf.level_table, uf.tilted_table, uf.rig)


def bench(make: uf.Make, seed: int = 3) -> Bench:
    """Returns the bench of a motion."""
    return uf.draw_bench(np.random.default_rng(seed), uf.Kind("", (make,), uf.nothing))


def tilt_of(state: State) -> np.ndarray:
    """Returns the angle between the body's z axis and the vertical in degrees."""
    return np.degrees(np.arccos(np.clip(state.rotation[:, 2, 2], -1.0, 1.0)))


@pytest.mark.parametrize("make", MOTIONS)
def test_rates_and_accelerations_are_derivatives(make):
    motion = make(np.random.default_rng(1), 60.0)
    t, h = np.sort(np.random.default_rng(2).uniform(0.0, 60.0, 400)), 1e-4
    here, after, before = motion.at(t), motion.at(t + h), motion.at(t - h)
    spin = np.einsum("nji,njk->nik", here.rotation, (after.rotation - before.rotation) / (2 * h))
    assert np.allclose(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1), here.rate, atol=1e-5)
    assert np.allclose((after.rate - before.rate) / (2 * h), here.turn, atol=1e-3)
    assert np.allclose((after.velocity - before.velocity) / (2 * h), here.acceleration, atol=1e-4)
    assert np.abs(here.force()).max() < 2.5 * GRAVITY


@pytest.mark.parametrize(
    ("make", "least", "most"), [(uf.phone, 10, 60), (uf.boat, 5, 30), (uf.vehicle, 1, 8), (uf.level_table, 0, 0)]
)
def test_limited_motions_tilt_as_they_say_and_turn_far(make, least, most):
    for seed in range(5):
        b = bench(make, seed)
        tilt = tilt_of(b.motion.at(b.t))
        assert least <= tilt.max() + 1e-6
        assert tilt.max() <= most + 1e-5
        heading = b.motion.joints[0].angle(b.t)[0]
        assert np.ptp(heading) > np.pi / 2


@pytest.mark.parametrize("make", [uf.level_table, uf.tilted_table, uf.rig])
def test_one_axis_stays_one_axis(make):
    b = bench(make)
    rate = b.motion.at(b.t).rate
    assert np.linalg.matrix_rank(rate, tol=1e-9 * np.abs(rate).max() * len(rate)) == 1


@pytest.mark.parametrize("make", [*uf.TUMBLING, *MOTIONS])
def test_readings_without_errors_are_the_ideal_ones(make):
    b = bench(make)
    here, found = b.motion.at(b.t), uf.readings(b, {})
    assert np.allclose(found["mag"], np.einsum("nji,j->ni", here.rotation, b.earth_field))
    up = np.einsum("nij,nj->ni", here.rotation, found["acc"]) - here.acceleration
    assert np.allclose(up, [0.0, 0.0, -GRAVITY])
    assert np.array_equal(found["gyr"], here.rate)


@pytest.mark.parametrize("kind", [k for k in uf.KINDS if not {"ref.tilt", "ref.alignment"} & k.hide(RNG).keys()])
def test_sensor_errors_are_those_of_the_whole_sensor(kind):
    rng = np.random.default_rng(4)
    b, hidden = uf.draw_bench(rng, kind), kind.hide(rng)
    found, stated = uf.readings(b, hidden), clean(b, hidden)
    assert all(np.allclose(found[sensor], stated[sensor], atol=1e-9) for sensor in found)


def test_frame_and_mount_turn_all_sensors():
    """The true attitude is T R A where the reference says R."""
    b = bench(uf.hand_held)
    hidden = {"ref.tilt": {"x": 0.02, "y": -0.01}, "ref.alignment": {"x": 0.03, "y": 0.05, "z": -0.02}}
    frame, mount = small_turns(np.array([[0.02, -0.01, 0.0], [0.03, 0.05, -0.02]]))
    here, found = b.motion.at(b.t), uf.readings(b, hidden)
    true = frame @ here.rotation @ mount
    assert np.allclose(np.einsum("nij,nj->ni", true, found["mag"]), b.earth_field)
    force = np.einsum("nij,nj->ni", true, found["acc"])
    assert np.allclose(force - here.acceleration @ frame.T, [0.0, 0.0, -GRAVITY])
    assert np.allclose(found["gyr"] @ mount.T, here.rate)


def same(b: Bench, first: uf.Effects, second: uf.Effects, earth_field: np.ndarray, sensors: tuple = SENSORS) -> bool:
    """Tells whether effects in one field give the readings of other effects in another field."""
    one, other = uf.readings(b, first), uf.readings(replace(b, earth_field=earth_field), second)
    return all(np.allclose(one[sensor], other[sensor], atol=1e-9) for sensor in sensors)


def test_what_cannot_be_told_apart():
    b, any_attitude = bench(uf.level_table), bench(uf.gimbal)
    field = b.earth_field
    gain = {"mag.soft_iron": {"xx": 0.2, "yy": 0.2, "zz": 0.2}}
    assert same(any_attitude, gain, {}, 1.2 * any_attitude.earth_field)
    assert same(b, {"mag.hard_iron": {"z": 50.0}}, {}, field + np.array([0.0, 0.0, 50.0]))
    mount = {"ref.alignment": {"z": 0.2}}
    assert same(b, mount, {}, small_turns(np.array([[0.0, 0.0, -0.2]]))[0] @ field)
    iron = {"mag.hard_iron": {"x": 30.0, "y": -9.0}}
    assert same(b, iron, {"mag.soft_iron": {"xz": 30.0 / field[2], "yz": -9.0 / field[2]}}, field)
    assert not same(any_attitude, iron, {}, any_attitude.earth_field)
    tilt = {"ref.tilt": {"x": 0.02, "y": 0.01}}
    turned = small_turns(np.array([[0.02, 0.01, 0.0]]))[0].T @ any_attitude.earth_field
    assert same(any_attitude, tilt, {}, turned, ("gyr", "mag"))
    assert not same(any_attitude, tilt, {}, turned, ("acc",))


def test_rivals_are_found_and_what_cannot_be_seen_is_not():
    """Soft iron stands for hard iron where only the heading changes, and nothing does in a gimbal."""
    iron = {"mag.hard_iron": {"x": 30.0, "y": -9.0, "z": 4.0}}
    assert uf.rivals(bench(uf.level_table), iron)[1] == {"mag.soft_iron"}
    assert uf.rivals(bench(uf.gimbal), iron)[1] == frozenset()
    for kind in uf.KINDS:
        if not kind.seen:
            rng = np.random.default_rng(5)
            assert uf.rivals(uf.draw_bench(rng, kind), kind.hide(rng))[0] < 1e-3 * SEEN


@pytest.mark.parametrize("seed", [*ONES, *(s + len(uf.KINDS) for s in (0, 3, 13, 14))])
def test_drawn_log_obeys_what_it_states(seed):
    """Turns what the log itself holds back into the reference frame, less what is hidden."""
    case, kind = uf.draw(seed), uf.KINDS[seed % len(uf.KINDS)]
    assert "mag_reference" not in case.metadata
    assert set(case.effects) <= case.may_name
    assert uf.FIELD not in case.may_name
    assert (not case.effects) == (not kind.seen or kind.name.startswith("nothing"))
    assert "adequate" in case.verdicts
    assert 40.0 <= case.seconds <= 120.0
    rows = case.frame.dropna()
    assert len(rows) >= len(case.frame) / 4
    t = case.frame["t"].to_numpy()
    assert np.all(np.diff(t) > 0.0)
    assert 49.0 < 1.0 / np.diff(t).mean() < 201.0
    rotation = to_matrix(rows[[f"ref_q{c}" for c in "wxyz"]].to_numpy())
    soft = "mag.soft_iron" in case.effects
    late = {"mag.delay", "ref.delay"} & case.effects.keys()
    if not soft and not late and case.effects.get("mag.hard_iron", {"x": 0, "y": 0, "z": 0}).keys() == set("xyz"):
        iron = vector(case.effects, "mag.hard_iron")
        warm = np.outer(rows["temp"] - case.frame["temp"].mean(), vector(case.effects, "mag.bias_temperature"))
        back = np.einsum("nij,nj->ni", rotation, rows[[f"mag_{c}" for c in "xyz"]].to_numpy() - iron - warm)
        mounted = 4.0 if "ref.alignment" in case.effects else 0.0
        assert back.std(axis=0).max() < 1.3 + mounted
    if "ref_px" not in rows and "ref.tilt" not in case.effects and "acc.bias" not in case.effects:
        up = np.einsum("nij,nj->ni", rotation, rows[[f"acc_{c}" for c in "xyz"]].to_numpy()).mean(axis=0)
        turned = late or "ref.alignment" in case.effects
        assert np.allclose(up, -gravity_vector(case.metadata["frame"]), atol=0.4 if turned else 0.02)


def test_frames_agree():
    """The attitude of an east-north-up log turns the specific force at rest to +z, and gravity is against it."""
    b = bench(uf.level_table)
    ned = uf.log(b, uf.readings(b, {}), np.random.default_rng(1))
    enu = uf.into_enu(ned)
    into = to_matrix(uf.INTO_ENU[None])[0]
    assert np.allclose(into, [[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    rotations = [to_matrix(frame[[f"ref_q{c}" for c in "wxyz"]].to_numpy()) for frame in (ned, enu)]
    assert np.allclose(into @ rotations[0], rotations[1])
    moving = bench(uf.boat)
    ned = uf.log(moving, uf.readings(moving, {}), np.random.default_rng(1))
    p = [f"ref_p{c}" for c in "xyz"]
    assert np.allclose(ned[p].to_numpy() @ into.T, uf.into_enu(ned)[p])


def test_draws_are_repeatable_and_kinds_are_many():
    assert len(set(NAMES)) == len(NAMES) >= 12
    first, again = uf.draw(19), uf.draw(19)
    assert first.frame.equals(again.frame)
    assert first.effects == again.effects
