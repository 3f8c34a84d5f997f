"""A line over 180 degrees leaves a figure at one edge and comes in at the other, however much it is thinned."""

import numpy as np
import pytest
from imufit.inspection.circle import Unwound, on_circle


def drawn(t, angle, chunk):
    """Return the line of one wrapped angle, taken chunk by chunk."""
    unwound = Unwound()
    whole = np.concatenate([unwound.add(angle[k : k + chunk, None]) for k in range(0, len(angle), chunk)])
    return on_circle(t, whole)


@pytest.mark.parametrize("chunk", [1, 7, 1000])
@pytest.mark.parametrize("speed", [50.0, -50.0, 2000.0])
def test_no_line_runs_from_one_edge_to_the_other(speed, chunk):
    t = np.linspace(0.0, 10.0, 1000)
    angle = (speed * t + 100.0 + 180.0) % 360.0 - 180.0
    times, line = drawn(t, angle, chunk)
    assert np.all(np.diff(times) >= 0.0)
    assert np.nanmax(np.abs(line)) <= 180.0
    # No step is longer than that of one row, and the edges are reached.
    steps = np.abs(np.diff(line[:, 0]))
    assert np.nanmax(steps) <= abs(speed) * 10.0 / 999 + 1e-9
    assert np.isnan(line).sum() == np.count_nonzero(np.abs(np.diff(angle)) > 180.0)
    assert {-180.0, 180.0} <= set(line[:, 0])
    # What was there is still there.
    assert np.allclose(np.interp(t, times[~np.isnan(line[:, 0])], times[~np.isnan(line[:, 0])]), t)
    assert set(np.round(angle, 6)) <= set(np.round(line[~np.isnan(line[:, 0]), 0], 6))


def test_a_pixel_that_holds_both_sides_of_the_edge_is_not_a_line_across_the_figure():
    # Smallest and largest value of pixels, in turn, of an angle that shakes about 180 degrees.
    angles = np.tile([175.0, 185.0], 50)[:, None]
    _, line = on_circle(np.repeat(np.arange(50.0), 2), angles)
    assert np.nanmax(np.abs(np.diff(line[:, 0]))) <= 5.0 + 1e-9


def test_many_turns_within_a_pixel_fill_it_with_few_points():
    _, line = on_circle(np.array([0.0, 0.0, 1.0]), np.array([[0.0], [1e9], [1e9]]))
    assert len(line) < 20
    assert np.nanmin(line) == -180.0
    assert np.nanmax(line) == 180.0


def test_other_angles_go_on_where_one_is_interrupted():
    t = np.arange(4.0)
    angles = np.column_stack([[170.0, 190.0, 210.0, np.nan], [0.0, 10.0, 20.0, 30.0]])
    times, line = on_circle(t, angles)
    np.testing.assert_allclose(line[:, 1], np.interp(times, t, angles[:, 1]))
