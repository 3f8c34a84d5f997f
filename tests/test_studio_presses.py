"""Presses of a button in a list that changes beneath the pointer."""

from imufit.studio.presses import DOUBLE_CLICK, Presses


def test_the_second_click_of_a_double_click_does_not_count():
    times = iter([0.0, 0.2, 0.2 + DOUBLE_CLICK, 0.3 + DOUBLE_CLICK])
    presses = Presses(lambda: next(times))
    assert [presses.counts() for _ in range(4)] == [True, False, True, False]
