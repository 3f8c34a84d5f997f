"""The device's clock on the host's: drift, delays, turns of the counter, resets, clocks of text."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.clock import fit_clock, lower_hull, spread, spread_arrivals
from imufit.devices.record.live_clock import LiveClock
from imufit.devices.record.ticks import Unwrapper, guessed_unit, time_column
from imufit.devices.record.timing import Runs, clock_of, timed, timed_blocks

FRAMES = Announced("binary", "d", 1e-6, ("acc_x",))


def frames(stamps, arrival, *, start=None, opening=None, lost=None, announced=FRAMES):
    """Rows with these 32-bit stamps and arrivals."""
    n = len(stamps)
    zeros = np.zeros(n, np.uint32)
    return Arrived(
        announced,
        np.asarray(arrival, float),
        zeros if opening is None else np.asarray(opening, np.uint32),
        np.zeros(n, np.uint8) if start is None else np.asarray(start, np.uint8),
        (np.asarray(stamps, np.int64) % 2**32).astype(np.uint32),
        np.arange(n).astype(np.uint16),
        zeros if lost is None else np.asarray(lost, np.uint32),
        np.zeros((n, 1)),
    )


def lines(columns, values, arrival, lost=None):
    """Rows of text."""
    n = len(values)
    zeros = np.zeros(n, np.uint32)
    return Arrived(
        Announced("text", "", 0.0, columns),
        np.asarray(arrival, float),
        zeros,
        np.zeros(n, np.uint8),
        zeros,
        np.zeros(n, np.uint16),
        zeros if lost is None else np.asarray(lost, np.uint32),
        np.asarray(values, float),
    )


def read_late(host, rng, delay=0.001, pause=0.006):
    """Arrivals of rows sent at these times: delayed by the line, and read together some hundred times a second."""
    sent = np.maximum.accumulate(host + rng.exponential(delay, host.size))
    reads = sent[0] + np.cumsum(rng.uniform(0.7, 1.3, int((sent[-1] - sent[0]) / pause * 2) + 10) * pause)
    return reads[np.searchsorted(reads, sent)]


@settings(max_examples=40, deadline=None)
@given(
    drift=st.floats(-5e-3, 5e-3),
    first=st.integers(0, 2**32 - 1),
    offset=st.floats(0.0, 1e6),
    rate=st.sampled_from([100.0, 1000.0]),
    delay=st.floats(1e-5, 3e-3),
    seed=st.integers(0, 2**32 - 1),
)
def test_times_are_within_a_millisecond_of_when_rows_were_sent(drift, first, offset, rate, delay, seed):
    rng = np.random.default_rng(seed)
    host = np.arange(int(20.0 * rate)) / rate
    stamps = first + np.round(host * (1.0 + drift) * 1e6).astype(np.int64)
    timing = timed(frames(stamps, offset + read_late(host, rng, delay)))
    t = timing.t - timing.t[0]
    assert np.abs(t - host).max() < 1e-3
    assert np.diff(t).min() > 0.0
    assert timing.fit.drift_ppm == pytest.approx(1e6 * drift, abs=150.0)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.5, 5.0), min_size=1, max_size=4), st.integers(0, 2**32 - 1), st.booleans())
def test_a_clock_that_begins_anew_is_put_where_it_belongs(lengths, seed, drops):
    rng = np.random.default_rng(seed)
    host, stamps, start, opening, begin = [], [], [], [], 0.0
    for k, length in enumerate(lengths):
        own = np.arange(int(length * 500.0)) / 500.0
        host.append(begin + own)
        stamps.append((rng.integers(0, 10**6) + own * 1.0001e6).astype(np.int64))
        start.append(np.full(own.size, k))
        opening.append(np.full(own.size, k if drops else 0))
        begin += length + rng.uniform(0.01, 2.0)
    host = np.concatenate(host)
    rows = frames(
        np.concatenate(stamps),
        7.0 + read_late(host, rng),
        start=np.concatenate(start),
        opening=np.concatenate(opening),
        lost=np.concatenate([[1, *[0] * (part.size - 1)] for part in start]),
    )
    timing = timed(rows)
    assert np.abs(timing.t - timing.t[0] - host).max() < 5e-3
    assert np.diff(timing.t).min() > 0.0
    assert timing.run[-1] == len(lengths) - 1


@pytest.mark.parametrize("away", [10.0, 3000.0, 6000.0, 20000.0])
def test_a_line_that_was_away_for_long_does_not_hide_turns_of_the_counter(away):
    rng = np.random.default_rng(3)
    host = np.concatenate([np.arange(5000) / 1000.0, 5.0 + away + np.arange(5000) / 1000.0])
    opening = np.repeat([0, 1], 5000)
    rows = frames(
        np.round(host * 1e6).astype(np.int64), read_late(host, rng), opening=opening, lost=np.diff(opening, prepend=0)
    )
    timing = timed(rows)
    assert np.abs(timing.t - timing.t[0] - host).max() < 1e-3
    assert timing.run[-1] == 0, "the same clock ran on"


def test_rows_that_piled_up_before_they_were_read_do_not_bend_the_clock():
    rng = np.random.default_rng(5)
    host = np.arange(10000) / 1000.0
    late = np.where(host < 2.0, 2.0 + 0.05 * host, host)  # the first two seconds come in 0.1 s
    timing = timed(frames(np.round(host * 1e6), read_late(late, rng)))
    assert np.abs(timing.t - timing.t[-1] - (host - host[-1])).max() < 1e-3


@pytest.mark.parametrize("speed", [3.0, 100.0])
def test_a_device_faster_than_real_time_keeps_its_own_seconds(speed):
    rng = np.random.default_rng(6)
    own = np.arange(20000) / 1000.0
    timing = timed(frames(np.round(own * 1e6), read_late(own / speed, rng, 1e-4)))
    np.testing.assert_allclose(timing.t - timing.t[0], own, atol=1e-9)
    assert timing.fit.alien
    assert timing.fit.drift_ppm is None


def test_a_few_rows_have_the_time_of_the_device():
    timing = timed(frames([5_000_000, 5_010_000, 5_020_000], [1.0, 1.3, 1.31]))
    np.testing.assert_allclose(np.diff(timing.t), 0.01, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 100), st.floats(-1, 1)), min_size=1, max_size=60))
def test_the_hull_lies_under_all_points_and_touches_its_corners(points):
    x, y = np.round(np.array(sorted(points)), 6).T
    corners, heights = lower_hull(x, y)
    assert (y - np.interp(x, corners, heights) > -1e-9).all()
    assert set(zip(corners, heights, strict=True)) <= set(zip(x, y, strict=True))
    slopes = np.diff(heights) / np.diff(corners)
    assert (np.diff(slopes) > -1e-9 * (1.0 + np.abs(slopes[1:]))).all()


def test_stamps_of_a_coarse_clock_are_spread():
    np.testing.assert_allclose(spread(np.array([0.0, 0.0, 1.0, 1.0, 1.0, 2.0])), [0.0, 0.5, 1.0, 4 / 3, 5 / 3, 2.0])
    np.testing.assert_allclose(spread_arrivals(np.array([1.0, 2.0, 2.0, 3.0])), [1.0, 1.5, 2.0, 3.0])


def test_runs_that_overlap_go_behind_each_other():
    t = Runs().told(np.array([0.0, 0.1, 0.2, 0.15, 0.25]), np.array([0, 0, 0, 1, 1]), whole=True)
    np.testing.assert_allclose(t, [0.0, 0.1, 0.2, 0.21, 0.31])


@pytest.mark.parametrize("tick", [1000, 20_000])
def test_times_are_the_same_however_the_rows_are_cut(tick):
    rng = np.random.default_rng(12)
    own = np.arange(6000) / 500.0
    host = np.concatenate([own[:3500], 2.0 + own[3500:]])
    stamps = np.concatenate([own[:3500] * 1e6 // tick * tick, (own[3500:] - 6.0) * 1e6 // tick * tick])
    start = np.repeat([0, 1], [3500, 2500])
    rows = frames(stamps, read_late(host, rng), start=start)
    whole = timed(rows)
    for size in (1500, 2500, 5999):
        cut = [rows.part(k, min(k + size, rows.n)) for k in range(0, rows.n, size)]
        clock = clock_of(cut)
        assert (clock.fit.rate, clock.fit.offsets.tolist()) == (whole.fit.rate, whole.fit.offsets.tolist())
        pieces = list(timed_blocks(cut, clock))
        np.testing.assert_array_equal(np.concatenate([piece.arrival for piece, _, _ in pieces]), rows.arrival)
        np.testing.assert_array_equal(np.concatenate([run for _, _, run in pieces]), whole.run)
        np.testing.assert_allclose(np.concatenate([t for _, t, _ in pieces]), whole.t, atol=1e-9)


def test_rows_timed_as_they_arrive_are_the_same_however_they_are_cut():
    arrival = np.repeat(np.cumsum(np.full(300, 0.01)), 7)
    rows = lines(("acc_x",), np.zeros((arrival.size, 1)), arrival)
    whole = timed(rows)
    cut = [rows.part(k, min(k + 400, rows.n)) for k in range(0, rows.n, 400)]
    pieces = list(timed_blocks(cut, clock_of(cut)))
    np.testing.assert_allclose(np.concatenate([t for _, t, _ in pieces]), whole.t, atol=1e-9)


def test_a_device_without_numbers_of_its_starts_is_seen_to_begin_anew():
    rng = np.random.default_rng(8)
    own = np.arange(3000) / 1000.0
    host = np.concatenate([own, 4.0 + own])
    stamps = np.concatenate([50_000_000 + own * 1e6, 20_000 + own * 1e6]).astype(np.int64)
    lost = np.zeros(6000)
    lost[3000] = 4711
    timing = timed(frames(stamps, read_late(host, rng), lost=lost))
    assert np.abs(timing.t - timing.t[0] - host).max() < 2e-3
    assert timing.run[-1] == 1


@pytest.mark.parametrize(
    ("columns", "place", "unit"),
    [
        (("t_ms", "acc_x"), 0, 1e-3),
        (("acc_x", "micros"), 1, 1e-6),
        (("Time (s)", "a"), 0, 1.0),
        (("time [ms]", "a"), 0, 1e-3),
        (("timestamp_us", "a"), 0, 1e-6),
        (("millis", "a"), 0, 1e-3),
        (("T", "a"), 0, None),
        (("time", "a"), 0, None),
    ],
)
def test_the_column_of_time_and_its_unit_are_told_by_the_name(columns, place, unit):
    assert time_column(columns) == (place, unit)


def test_text_without_a_column_of_time_has_none():
    assert time_column(("acc_x", "temp", "tilt", "ms2")) is None


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-6])
@pytest.mark.parametrize("seconds", [0.1, 5.0])
def test_the_unit_that_a_name_leaves_open_is_found(unit, seconds):
    host = np.arange(int(seconds * 100.0)) / 100.0
    assert guessed_unit(100.0 + host / unit, host + 0.001) == unit


def test_times_of_text_survive_turns_resets_and_lost_digits():
    rng = np.random.default_rng(9)
    host = np.arange(4000) / 100.0
    micros = 2.0**32 - 5e6 + host * 1e6
    micros = np.where(micros >= 2.0**32, micros - 2.0**32, micros)
    micros[2500:] = 3000.0 + (host[2500:] - host[2500]) * 1e6  # a reset
    micros[1000] = 12.0  # digits lost
    micros[1100] = np.nan
    timing = timed(lines(("micros", "acc_x"), np.stack([micros, host], axis=1), read_late(host, rng)))
    good = np.ones(host.size, bool)
    good[[1000, 1100]] = False
    assert np.abs(timing.t - timing.t[0] - host)[good].max() < 2e-3
    assert np.abs(timing.t - timing.t[0] - host).max() < 0.011
    assert timing.run[-1] == 1
    assert np.diff(timing.t).min() > 0.0


def test_text_without_time_is_timed_as_it_arrived():
    timing = timed(lines(("acc_x",), np.zeros((4, 1)), [1.0, 2.0, 2.0, 3.0]))
    assert timing.fit is None
    assert "as they arrived" in timing.notes[0]
    np.testing.assert_allclose(timing.t, [1.0, 1.5, 2.0, 3.0])


def test_delays_beyond_the_shortest_are_the_jitter():
    host = np.arange(2000) / 100.0
    late = np.where(np.arange(2000) % 2 == 0, 0.0, 0.004)
    segment = np.zeros(2000, np.int64)
    fit = fit_clock(host, 5.0 + host + late, segment, np.zeros(2000, np.uint8))
    assert fit.jitter == pytest.approx(0.002, rel=1e-3)
    assert fit.latest == pytest.approx(0.004, rel=1e-3)


@settings(max_examples=6, deadline=None)
@given(st.floats(-3e-3, 3e-3), st.integers(0, 2**32 - 1))
def test_live_times_grow_as_the_hosts_do(drift, seed):
    rng = np.random.default_rng(seed)
    host = np.arange(10000) / 500.0
    stamps = 2**32 - 10**6 + np.round(host * (1.0 + drift) * 1e6).astype(np.int64)
    arrival = read_late(host, rng)
    clock, cuts = LiveClock(), np.flatnonzero(np.diff(arrival)) + 1
    pieces = [p for p in np.split(np.arange(host.size), cuts) if p.size]
    t = np.concatenate([clock.times(frames(stamps[p], arrival[p])) for p in pieces])
    assert t[0] == 0.0
    assert np.diff(t).min() > 0.0
    # each step to 1 %, the whole to what the first read was late
    assert np.abs(np.diff(t) * 500.0 - 1.0)[100:].max() < 0.01
    assert np.abs(t - host).max() < 0.02


def test_live_times_jump_over_a_gap_and_a_reset():
    rng = np.random.default_rng(2)
    host = np.concatenate([np.arange(1000) / 500.0, 5.0 + np.arange(1000) / 500.0])
    stamps = np.concatenate([np.arange(1000), np.arange(1000)]) * 2000
    rows = frames(stamps, read_late(host, rng), start=np.repeat([1, 2], 1000), opening=np.repeat([0, 1], 1000))
    t = LiveClock().times(rows)
    assert np.abs(t - host).max() < 0.05


def test_an_unwrapper_does_not_mind_how_rows_are_cut():
    rng = np.random.default_rng(1)
    host = np.arange(3000) / 100.0
    stamps = 2**32 - 10**6 + (host * 1e6).astype(np.int64)
    arrival, start = read_late(host, rng), np.repeat([1, 2, 3], 1000)
    lost = rng.integers(0, 2, 3000)
    whole = Unwrapper(FRAMES).add(frames(stamps, arrival, start=start, lost=lost))
    cut, unwrapper = [], Unwrapper(FRAMES)
    for p in np.array_split(np.arange(3000), 77):
        cut.append(unwrapper.add(frames(stamps[p], arrival[p], start=start[p], lost=lost[p])))
    for k in (0, 1):
        np.testing.assert_array_equal(np.concatenate([c[k] for c in cut]), whole[k])
