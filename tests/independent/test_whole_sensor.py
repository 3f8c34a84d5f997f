"""Checks of the simulators themselves: derivatives, signs, sizes of what is injected, and the draws."""

import numpy as np
import outside
import pytest
import whole_sensor as ws

RNG = 7


def bench(motion=ws.hand_held, **more) -> ws.Bench:
    """Returns a small bench."""
    settings = {"motions": (motion,), "seconds": (60.0, 60.0), "rates": (50.0,), "magnetometer": (1,)} | more
    return ws.draw_bench(np.random.default_rng(RNG), **settings)


def near(found: np.ndarray, stated: np.ndarray, part: float = 1e-4) -> bool:
    """Tells whether two arrays agree to a part of the larger one's size."""
    return float(np.abs(found - stated).max()) <= part * float(np.abs(stated).max())


@pytest.mark.parametrize("make", ws.MOTIONS)
def test_rates_and_accelerations_are_derivatives(make):
    """Compares every exact derivative of a motion with a central difference."""
    motion = make(np.random.default_rng(RNG), 70.0)
    t, h = np.sort(np.random.default_rng(1).uniform(0.0, 70.0, 500)), 1e-4
    here, after, before = motion.at(t), motion.at(t + h), motion.at(t - h)
    spin = np.einsum("nji,njk->nik", here.rotation, (after.rotation - before.rotation) / (2 * h))
    assert near(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1), here.rate)
    assert near((after.rate - before.rate) / (2 * h), here.turn)
    assert np.abs(here.rate).max(axis=0).min() > 0.5, "every axis turns"
    assert np.abs(here.rate).max() < 600.0 * ws.DEGREE
    assert np.abs(here.force()).max() < 4.0 * ws.GRAVITY
    if motion.travels:
        assert near((after.position - before.position) / (2 * h), here.velocity)
        assert near((after.velocity - before.velocity) / (2 * h), here.acceleration)


@pytest.mark.parametrize("make", ws.MOTIONS)
def test_force_at_a_lever_is_that_of_the_point(make):
    """Compares the force at a lever with the second difference of that point's own path."""
    motion, lever = make(np.random.default_rng(RNG), 70.0), np.array([0.09, -0.05, 0.07])
    t, h = np.sort(np.random.default_rng(2).uniform(0.0, 70.0, 500)), 1e-3
    path = [s.position + s.rotation @ lever for s in (motion.at(t - h), motion.at(t), motion.at(t + h))]
    here = motion.at(t)
    stated = here.into_body((path[0] - 2.0 * path[1] + path[2]) / h**2 - ws.DOWN)
    assert near(here.force(lever), stated)


def test_force_points_up_at_rest_and_quaternions_turn_into_the_reference():
    """Compares the force at rest with the upward direction that the quaternion gives."""
    b = bench()
    state = b.motion.at(np.array([0.1, 0.2]))
    assert np.allclose(state.rotation @ state.force()[0], [0.0, 0.0, -ws.GRAVITY])
    rotation = b.motion.at(b.t).rotation
    w, x, y, z = ws.quaternions(rotation).T
    first = np.stack([w**2 + x**2 - y**2 - z**2, 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    last = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), w**2 - x**2 - y**2 + z**2], axis=1)
    assert np.allclose(first, rotation[:, :, 0])
    assert np.allclose(last, rotation[:, :, 2])


@pytest.mark.parametrize("effect", [e for e in ws.POOL if not e.startswith("ref.")])
def test_injected_error_has_the_stated_size(effect):
    """Compares what an effect does to clean readings with the contract's formula."""
    b = bench()
    effects = {effect: ws.amounts(np.random.default_rng(3), effect)}
    if "tau" in effects[effect]:
        effects[effect]["tau"] = 1e-3
    bare, made = ws.clean(b, {}), ws.clean(b, effects)
    sensor = effect.split(".")[0]
    form = next(ws.Catalogue.of(b).forms(effect, (1e-3,)))
    stated = form[sensor] @ ws.vector(effects, effect)
    assert near(made[sensor] - bare[sensor], stated, 0.02 if "tau" in effects[effect] else 1e-9)
    assert all(np.array_equal(made[s], bare[s]) for s in b.sensors if s != sensor)


def test_order_is_lever_then_gain_then_offset():
    """Compares readings under several effects with the chain written out."""
    b = bench()
    lever, scale, bias = {"x": 0.05, "y": 0.02, "z": -0.03}, {"x": 0.03, "y": -0.02, "z": 0.01}, {"x": 0.4}
    y = ws.clean(b, {"acc.lever_arm": lever, "acc.scale": scale, "acc.bias": bias})["acc"]
    force = b.motion.at(b.t).force(np.array(list(lever.values())))
    assert np.allclose(y, force * (1.0 + np.array(list(scale.values()))) + [0.4, 0.0, 0.0])


def test_delay_takes_the_motion_at_an_earlier_time():
    """Compares a late sensor and a late reference with the motion before."""
    b = bench()
    earlier = b.motion.at(b.t - 0.015)
    assert np.allclose(ws.clean(b, {"gyr.delay": {"tau": 0.015}})["gyr"], earlier.rate)
    frame = ws.log(b, ws.clean(b, {}), np.random.default_rng(4), late=0.015)
    stated = ws.quaternions(earlier.rotation)
    scatter = 2.0 * np.linalg.norm(frame[["ref_qw", "ref_qx", "ref_qy", "ref_qz"]] - stated, axis=1)
    scatter = np.minimum(scatter, 4.0 - scatter)
    assert np.sqrt(np.mean(scatter**2) / 3.0) == pytest.approx(b.attitude_noise, rel=0.1)


def test_lag_is_first_order():
    """Compares the lag of a sine with its exact gain and phase."""
    t, tau, w = np.arange(0.0, 5.0, 0.01), 0.02, 2.0 * np.pi * 3.0
    found = ws.lagged(lambda x: np.sin(w * x)[:, None], t, tau)[:, 0]
    stated = np.sin(w * t - np.arctan(w * tau)) / np.hypot(1.0, w * tau)
    assert np.abs(found - stated).max() < 1e-4


def test_noise_is_that_of_the_bench():
    """Compares the scatter of a log about its clean readings with the stated noise."""
    b = bench()
    x = ws.clean(b, {})
    frame = ws.log(b, x, np.random.default_rng(5))
    for sensor in ws.SENSORS:
        scatter = frame[[f"{sensor}_{a}" for a in "xyz"]].to_numpy() - x[sensor]
        assert np.sqrt(np.mean(scatter**2)) == pytest.approx(b.white[sensor], rel=0.15)


def test_draw_hides_a_whole_sensor():
    """Looks at the form of a drawn case."""
    case = ws.draw(10)
    assert 5 <= len(case.effects) <= 7
    assert set(case.effects) <= case.may_name
    assert case.verdicts == {"adequate"}
    assert 60.0 <= case.seconds <= 180.0
    assert np.all(np.diff(case.frame["t"]) > 0.0)
    assert np.all(np.isfinite(case.frame.drop(columns=[c for c in case.frame if c.startswith("mag")])))
    for effect, values in case.effects.items():
        assert tuple(values) == ws.parameter_names(effect)
    assert np.allclose(np.linalg.norm(case.frame[[f"ref_q{c}" for c in "wxyz"]], axis=1), 1.0)


def test_alike_effects_are_found():
    """Lets a delay stand for a delay of the other sensor where the reference may be late as well."""
    b = bench(magnetometer=(0,))
    effects = {"acc.delay": {"tau": 0.012}, "ref.delay": {"tau": 0.005}}
    stands, alike = ws.examine(b, effects)
    assert min(stands.values()) > ws.SEEN
    assert "gyr.delay" in alike["acc.delay"]
    assert "gyr.delay" in alike["ref.delay"]
    stands, alike = ws.examine(bench(), {"gyr.bias": {"x": 0.02, "y": 0.0, "z": 0.0}, "acc.bias": {"y": 0.3}})
    assert not alike["gyr.bias"]
    assert not alike["acc.bias"]


def test_kinds_outside_are_many_and_have_their_size():
    """Draws a few disturbances and measures them."""
    names = [k.name for k in outside.KINDS]
    assert len(names) >= 40
    assert len(set(names)) == len(names)
    for name in ("dead_zone", "one_axis_delay", "field_varies_in_space", "slew_rate_limit", "jumps_31"):
        chosen = outside.KINDS[names.index(name)]
        b = bench(outside.PLACES[chosen.place][0])
        world = outside.World(np.random.default_rng(6), b, b.motion.at(b.t), ws.clean(b, {}))
        shape = chosen.make(world)
        error = shape(1.0) if chosen.fixed else outside.sized(b, shape, 1.5)
        level = outside.strength(b, error)
        assert level == pytest.approx(10.0 * np.sqrt(31 / len(b.t)) if chosen.fixed else 1.5, rel=0.02)


def test_draw_outside_is_unknown():
    """Looks at the form of a drawn case."""
    case = outside.draw(1)
    assert case.effects == {}
    assert case.verdicts == {"unknown"}
    assert case.may_name == frozenset()
    assert case.name == f"outside-1-{outside.KINDS[1].name}"
