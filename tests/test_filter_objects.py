"""Filters on bare arrays: one call, parts and single rows agree to the bit, and other packages' filters are met."""

import copy
import pickle
from itertools import pairwise

import ahrs
import imufit
import numpy as np
import pytest
from imufit import InputError, Log, filters
from scipy.spatial.transform import Rotation

DT = 0.01


@pytest.fixture(scope="module")
def log() -> Log:
    return imufit.simulate("handheld", {}, seed=611, duration=12.0).to_log()


@pytest.mark.parametrize("name", filters.ALL)
def test_rows_parts_and_all_at_once_agree_to_the_bit(log: Log, name: str) -> None:
    kind = filters.ALL[name]
    whole = kind().run(log.gyr, log.acc, log.mag, DT)
    running = kind()
    cuts = [0, 1, 7, 100, 433, len(log)]
    parts = [running.run(log.gyr[a:b], log.acc[a:b], log.mag[a:b], DT) for a, b in pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    single = kind()
    rows = [single.update(*row, DT) for row in zip(log.gyr, log.acc, log.mag, strict=True)]
    np.testing.assert_array_equal(rows, whole)
    np.testing.assert_allclose(np.linalg.norm(whole[-1]), 1.0, atol=1e-12)


@pytest.mark.parametrize("name", filters.ALL)
def test_a_copy_a_pickle_and_a_state_go_on_where_the_filter_stands(log: Log, name: str) -> None:
    kind = filters.ALL[name]
    running = kind()
    running.run(log.gyr[:500], log.acc[:500], log.mag[:500], DT)
    restored = kind()
    restored.state = running.state
    others = [copy.deepcopy(running), running.copy(), pickle.loads(pickle.dumps(running)), restored]
    due = running.run(log.gyr[500:], log.acc[500:], log.mag[500:], DT)
    for other in others:
        np.testing.assert_array_equal(other.run(log.gyr[500:], log.acc[500:], log.mag[500:], DT), due)
    running.reset()
    np.testing.assert_array_equal(
        running.run(log.gyr[:50], log.acc[:50], log.mag[:50], DT),
        kind().run(log.gyr[:50], log.acc[:50], log.mag[:50], DT),
    )


@pytest.mark.parametrize("name", [*filters.ALL, "smoother"])
def test_replay_gives_what_the_filter_gives(log: Log, name: str) -> None:
    replayed = imufit.replay(log, [name], initial=[1.0, 0.0, 0.0, 0.0])
    kind = filters.Smoother if name == "smoother" else filters.ALL[name]
    running = kind(initial=[1.0, 0.0, 0.0, 0.0], mag_reference=replayed.mag_reference)
    np.testing.assert_allclose(
        running.run(log.gyr, log.acc, log.mag, log.t), replayed.attitude[name], atol=1e-9, equal_nan=True
    )


def test_any_stride_and_type_of_array_is_taken(log: Log) -> None:
    due = filters.Mahony().run(log.gyr, log.acc, log.mag, DT)
    wide = np.zeros((len(log), 12))
    wide[:, 0:9:4], wide[:, 1:10:4], wide[:, 2:11:4] = log.gyr, log.acc, log.mag
    np.testing.assert_array_equal(filters.Mahony().run(wide[:, 0:9:4], wide[:, 1:10:4], wide[:, 2:11:4], DT), due)
    fortran = (np.asfortranarray(x) for x in (log.gyr, log.acc, log.mag))
    np.testing.assert_array_equal(filters.Mahony().run(*fortran, DT), due)
    np.testing.assert_array_equal(filters.Mahony().run(log.gyr.tolist(), log.acc.tolist(), log.mag.tolist(), DT), due)
    single = filters.Mahony().run(*(x.astype(np.float32) for x in (log.gyr, log.acc, log.mag)), DT)
    assert single.dtype == np.float64
    np.testing.assert_allclose(single, due, atol=1e-4)


def test_a_constant_rate_is_integrated_exactly_as_scipy_does() -> None:
    rate = np.tile([0.3, -0.2, 0.5], (200, 1))
    found = filters.Gyro(initial=Rotation.identity()).run(rate, dt_or_t=DT)
    due = Rotation.from_rotvec(rate[0] * DT * np.arange(200)[:, None]).as_quat()[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(np.abs((found * due).sum(axis=1)), 1.0, atol=1e-14)


def test_a_constant_rate_is_integrated_as_by_ahrs() -> None:
    rate, first = np.tile([0.3, -0.2, 0.5], (200, 1)), [1.0, 0.0, 0.0, 0.0]
    theirs = ahrs.filters.AngularRate(gyr=rate, frequency=100.0, q0=np.array(first), method="closed").Q
    np.testing.assert_allclose(filters.Gyro(initial=first).run(rate, dt_or_t=DT), theirs, atol=1e-12)


def test_a_step_is_the_time_of_every_row(log: Log) -> None:
    by_step = filters.Mekf().run(log.gyr, log.acc, log.mag, DT)
    by_time = filters.Mekf().run(log.gyr, log.acc, log.mag, np.arange(len(log)) * DT)
    np.testing.assert_array_equal(by_step, by_time)
    changed = filters.Gyro()
    changed.run(log.gyr[:100], dt_or_t=DT)
    changed.run(log.gyr[100:200], dt_or_t=2 * DT)
    whole = filters.Gyro()
    t = np.concatenate([np.arange(100) * DT, 99 * DT + 2 * DT * np.arange(1, 101)])
    np.testing.assert_allclose(
        changed.update(log.gyr[200], dt=DT), whole.run(log.gyr[:201], dt_or_t=[*t, t[-1] + DT])[-1], atol=1e-14
    )


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda log: filters.Mahony(kp=1.0), "mahony has no setting kp. Did you mean k_p"),
        (lambda log: filters.Mahony(frame="NEU"), "the frame 'NEU' is unknown"),
        (lambda log: filters.Mahony(k_p=-1.0), "k_p"),
        (lambda log: filters.Mahony().run(log.gyr, dt_or_t=DT), "mahony needs acc"),
        (lambda log: filters.Mahony().run(log.gyr, log.acc), "the time is missing"),
        (lambda log: filters.Mahony().run(log.gyr, log.acc, dt_or_t=0.0), "the step is 0 s"),
        (lambda log: filters.Mahony().run(log.gyr, log.acc[:5], dt_or_t=DT), "rows, but another sensor has"),
        (lambda log: filters.Mahony().run(log.gyr[:, :2], log.acc, dt_or_t=DT), "shape .*, but \\(n, 3\\) is required"),
        (lambda log: filters.Mahony().run(log.gyr, log.acc, dt_or_t=log.t[:5]), "the time has shape"),
        (lambda log: filters.Mahony().update(log.gyr, log.acc, dt=DT), "but \\(3,\\) is required"),
        (lambda log: filters.Mahony(initial=[1.0, 0.0, 0.0]), "initial attitude has shape"),
        (lambda log: setattr(filters.Mahony(), "state", [1.0]), "the state has shape"),
    ],
)
def test_what_cannot_be_is_refused(log: Log, call, says: str) -> None:
    with pytest.raises(InputError, match=says):
        call(log)


def test_help_names_every_setting() -> None:
    for kind in filters.ALL.values():
        for name, entry in kind.settings.items():
            assert f"{name} : float, {entry['unit']}" in kind.__doc__
            assert name in kind.__signature__.parameters
