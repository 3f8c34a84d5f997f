"""The pyramid of smallest and largest values: nothing that a screen should show is lost, and nothing is invented."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import _imufit


def fed(t, columns, gap=3.5, block=64, chunk=5000):
    pyramid = _imufit.Pyramid([gap] * len(columns), block)
    for k in range(0, len(t), chunk):
        pyramid.feed(t[k : k + chunk], [column[k : k + chunk] for column in columns])
    return pyramid


def brute(t, values, begin, end):
    """Smallest and largest sample within a window."""
    inside = values[(t >= begin) & (t <= end)]
    return np.nanmin(inside), np.nanmax(inside)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 20_000),
    block=st.integers(1, 300),
    chunk=st.integers(1, 7000),
    pixels=st.integers(1, 1500),
    missing=st.floats(0.0, 0.9),
)
def test_extremes_and_gaps_agree_with_numpy_in_every_window(seed, rows, block, chunk, pixels, missing):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5, 1.5, rows)) + rng.normal(0.0, 1e4)
    values = rng.standard_cauchy(rows)
    values[rng.random(rows) < missing] = np.nan
    pyramid = fed(t, [values], block=block, chunk=chunk)
    begin, end = np.sort(rng.uniform(t[0] - 1.0, t[-1] + 1.0, 2))
    (points,) = pyramid.lines([0], begin, end, pixels)
    first, stop = pyramid.rows_between(begin, end)
    inside = (t >= begin) & (t <= end)
    assert inside[first:stop].sum() == inside.sum()
    exact = _imufit.thinned(t[first:stop], values[first:stop], 3.5, begin, end, pixels)
    for at, low, high in (points, exact):
        assert at.size <= 2 * pixels
        assert np.all(np.diff(at) >= 0.0)
        assert np.array_equal(np.isnan(low), np.isnan(high))
        assert np.isin(low[~np.isnan(low)], values).all()
        if np.isfinite(values[inside]).any():
            smallest, largest = brute(t, values, begin, end)
            assert np.nanmin(low) <= smallest
            assert np.nanmax(high) >= largest
    # as many pixels as one asks for, each with the extremes of exactly its own rows
    at, low, high = exact
    if np.isfinite(values[inside]).sum() > 2 * pixels:
        assert (np.nanmin(low), np.nanmax(high)) == brute(t, values, begin, end)


def test_slow_sensor_between_the_rows_of_a_fast_one_is_one_line():
    t = np.arange(10_000) * 0.01
    fast, slow = np.sin(t), np.where(np.arange(t.size) % 10 == 0, np.cos(t), np.nan)
    slow[4000:6000] = np.nan
    pyramid = _imufit.Pyramid([0.035, 0.35])
    pyramid.feed(t, [fast, slow])
    whole, sparse = pyramid.lines([0, 1], 0.0, 100.0, 50)
    assert not np.isnan(whole[1]).any()
    (at,) = whole_breaks = np.flatnonzero(np.isnan(sparse[1]))
    assert len(whole_breaks) == 1
    assert sparse[0][at] == pytest.approx(50.0, abs=3.0)


def test_pyramid_can_be_asked_while_it_is_fed():
    t = np.arange(2_000_000.0)
    pyramid, seen = _imufit.Pyramid([3.5]), []
    feeder = threading.Thread(target=lambda: [pyramid.feed(part, [part]) for part in np.split(t, 100)])
    feeder.start()
    while feeder.is_alive():
        if pyramid.span is not None:
            seen.append(np.nanmax(pyramid.lines([0], *pyramid.span, 100)[0][2]))
    feeder.join()
    assert pyramid.rows == t.size
    assert all(np.diff(seen) >= 0.0)
    assert np.nanmax(pyramid.lines([0], 0.0, t[-1], 100)[0][2]) == t[-1]


def test_memory_is_a_small_part_of_the_rows():
    t = np.arange(2_000_000.0)
    pyramid = fed(t, [t, t, t], block=128, chunk=65_536)
    assert pyramid.bytes < 0.05 * 4 * t.nbytes


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda p: p.feed(np.array([5.0, 4.0]), [np.zeros(2)]), "goes back"),
        (lambda p: p.feed(np.array([np.nan]), [np.zeros(1)]), "not finite"),
        (lambda p: p.feed(np.zeros(2), [np.zeros(3)]), "3 rows but t has 2"),
        (lambda p: p.feed(np.zeros(2), []), "0 columns came"),
        (lambda p: p.lines([0], 1.0, 0.0, 10), "not a window"),
        (lambda p: p.lines([0], 0.0, 1.0, 0), "not a window"),
        (lambda p: p.lines([1], 0.0, 1.0, 10), "column 1 is not one of the 1"),
        (lambda p: _imufit.Pyramid([np.nan]), "a length"),
    ],
)
def test_unusable_arguments_are_refused_in_words(wrong, words):
    with pytest.raises(ValueError, match=words):
        wrong(_imufit.Pyramid([1.0]))
