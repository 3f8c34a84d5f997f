"""One step for live rows, for whole logs and for many logs at once: the same bits."""

from dataclasses import replace as with_fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import InputError, Log
from imufit.replaying import FILTERS, Stream, replay, replay_many
from scipy.spatial.transform import Rotation

G = 9.80665
SETTINGS = {
    "kalman": {"adaptive": 1.0, "vibration_time": 0.2},
    "complementary": {"time_constant": 0.7},
    "replay": {"acc_range": 15.0, "gyr_range": 4.0, "max_gap": 1.0},
}


def spoiled_log(seed: int, n: int = 250) -> Log:
    """Noise on a moving sensor with gaps, NaN, clipped rows and free fall, and a slow magnetometer."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.002, 0.03, n))
    t[rng.integers(1, n) :] += 2.0
    acc, gyr = rng.normal([0.0, 1.0, G], 2.0, (n, 3)), rng.normal(0.0, 1.5, (n, 3))
    mag = rng.normal([20.0, 0.0, -44.0], 2.0, (n, 3))
    mag[np.arange(n) % 4 != 0] = np.nan
    acc[rng.integers(0, n, 9)] = np.nan
    gyr[rng.integers(0, n, 9)] = np.nan
    acc[rng.integers(0, n, 5)] *= 0.01
    acc[rng.integers(0, n, 5), 0] = 15.0
    return Log.from_arrays(t, acc=acc, gyr=gyr, mag=mag, frame="ENU")


def stream_for(log: Log, filters: list[str]) -> Stream:
    return Stream(filters, ("acc", "gyr", "mag"), frame="ENU", gravity=log.metadata.gravity, settings=SETTINGS)


def row(log: Log, k: int) -> dict[str, np.ndarray | None]:
    """Readings of a row, None where the sensor has none."""
    columns = {name: getattr(log, name) for name in ("acc", "gyr", "mag")}
    return {name: None if np.isnan(c[k]).all() else c[k] for name, c in columns.items()}


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.tuples(st.integers(1, 60), st.booleans()), max_size=10))
def test_a_live_stream_is_the_replay_of_its_log(seed: int, pieces: list[tuple[int, bool]]) -> None:
    log = spoiled_log(seed)
    whole = replay(log, list(FILTERS), SETTINGS)
    live, found, at = stream_for(log, list(FILTERS)), {name: [] for name in FILTERS}, 0
    for rows, single in [*pieces, (log.n, True)]:
        part = log.rows(at, min(at + rows, log.n))
        at += part.n
        if single:
            steps = [live.step(part.t[k], **row(part, k)) for k in range(part.n)]
        else:
            steps = [live.extend(part.t, part.acc, part.gyr, part.mag)]
        for name in FILTERS:
            found[name] += [step[name].reshape(-1, 4) for step in steps]
    for name in FILTERS:
        assert np.concatenate(found[name]).tobytes() == whole.attitude[name].tobytes()
    assert live.skipped == whole.skipped
    assert {"acc_clipped", "free_fall", "gap", "mag_missing"} <= set(live.skipped)


def test_a_state_goes_on_in_another_stream_and_a_reset_one_starts_over() -> None:
    log = spoiled_log(1)
    names = ["complementary", "kalman", "mahony"]
    first, second = stream_for(log, names), stream_for(log, names)
    head, tail = log.rows(0, 100), log.rows(100, log.n)
    started = first.extend(head.t, head.acc, head.gyr, head.mag)
    second.state = first.state
    ends = [one.extend(tail.t, tail.acc, tail.gyr, tail.mag) for one in (first, second)]
    for name in names:
        assert ends[0][name].tobytes() == ends[1][name].tobytes()
    first.reset()
    assert first.skipped == {}
    again = first.extend(head.t, head.acc, head.gyr, head.mag)
    assert all(again[name].tobytes() == started[name].tobytes() for name in names)


def test_a_stream_starts_where_it_is_told() -> None:
    start = Rotation.from_euler("ZYX", [0.4, -0.2, 0.1])
    for initial in (start, start.as_quat()[[3, 0, 1, 2]]):
        live = Stream(["gyro"], ["gyr"], initial=initial)
        found = live.step(0.0, gyr=[0.0, 0.0, 0.0])["gyro"]
        np.testing.assert_allclose(found, start.as_quat()[[3, 0, 1, 2]], atol=1e-15)
    assert live.filters == ("gyro",)


def test_what_a_stream_cannot_take_is_refused() -> None:
    with pytest.raises(ValueError, match="'baro' is not a sensor: use acc, gyr, mag"):
        Stream(["gyro"], ["gyr", "baro"])
    with pytest.raises(ValueError, match="settings for 'kalmann'"):
        Stream(["gyro"], settings={"kalmann": {}})
    live = Stream(["gyro"], ["gyr"])
    with pytest.raises(ValueError, match="the stream has no acc: name it among its sensors"):
        live.step(0.0, acc=[0.0, 0.0, G], gyr=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="complementary needs acc"):
        Stream(["complementary"], ["gyr"]).step(0.0, gyr=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="the state is of kalman, but the stream has gyro"):
        live.state = {"kalman": np.zeros(24)}
    with pytest.raises(ValueError, match="gyr has 2 rows but t has 3"):
        live.extend(np.arange(3.0), gyr=np.zeros((2, 3)))


@pytest.mark.parametrize("threads", [None, 1, 2, 5])
def test_many_logs_at_once_are_the_logs_one_by_one(threads: int | None) -> None:
    logs = [spoiled_log(seed, n=400 + 50 * seed) for seed in range(5)]
    told: list[tuple[int, int, str]] = []
    names = ["accel", "gyro", "complementary", "kalman"]
    results = replay_many(logs, names, SETTINGS, threads=threads, progress=lambda *what: told.append(what))
    assert [done for done, _, _ in told] == [1, 2, 3, 4, 5]
    for log, result in zip(logs, results, strict=True):
        alone = replay(log, names, SETTINGS)
        assert result.log is log
        assert result.skipped == alone.skipped
        for name in names:
            assert result.attitude[name].tobytes() == alone.attitude[name].tobytes()
    assert replay_many([]) == []


def test_the_log_that_cannot_be_replayed_is_named() -> None:
    good = spoiled_log(0)
    bad = with_fields(good, mag=None)
    with pytest.raises(InputError, match="log 1: triad needs mag"):
        replay_many([good, bad, good], ["triad"])
    with pytest.raises(InputError, match="threads is 0"):
        replay_many([good], threads=0)
