"""Ranks and words that follow from figures of merit, and the figure of the tilt."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imufit.figures.tilt import Zoom, tilt_figure
from imufit.results import TiltComparison, TiltFigures

METHODS = ("accel", "gyro", "complementary", "kalman")
NOTHING = TiltFigures(0.0, 0.0, None, None, 0.0, None, None, 0, 0, None, None)


def comparison(**columns) -> TiltComparison:
    """Four methods with these figures, one value each."""
    methods = {
        name: dataclasses.replace(NOTHING, **{key: values[at] for key, values in columns.items()})
        for at, name in enumerate(METHODS)
    }
    return TiltComparison("rig", "x", methods, 1, 0, 0, 10.0, 0.1, (5.0, 50.0))


def words(found: TiltComparison, name: str) -> list[str]:
    return [mark.word for mark in found.ranks()[name].values()]


def test_words_of_the_papers_table_follow_from_its_numbers() -> None:
    """Paper B, Table 5 from Table 3 (1 degree) and Table 4; the gyro's noise is what is left without its drift."""
    found = comparison(
        noise_density_deg=(0.1182, 0.012, 0.0238, 0.0116),
        offset_deg=(0.24, 1.9, 0.242, 0.240),
        vibration_gain=(1.0, 0.11, 0.10, 0.01),
        settling_s=(0.0, 0.1, 0.8, 4.0),
    )
    assert words(found, "noise") == ["high", "low", "second highest", "low"]
    assert words(found, "offset") == ["low", "high", "low", "low"]
    assert words(found, "vibration") == ["high", "second highest", "second highest", "low"]
    assert words(found, "settling") == ["short", "short", "second longest", "long"]
    ranks = [mark.rank for mark in found.ranks()["vibration"].values()]
    assert ranks == [1, 2, 2, 4]


def test_what_differs_by_less_than_the_tolerance_or_the_resolution_ties() -> None:
    near = comparison(noise_density_deg=(1.0, 0.81, 0.79, 0.1))
    assert [mark.rank for mark in near.ranks()["noise"].values()] == [1, 1, 3, 4]
    assert [mark.rank for mark in near.ranks(tie=0.05)["noise"].values()] == [1, 2, 2, 4]
    assert words(comparison(offset_deg=(0.001, -0.015, 0.004, 0.0)), "offset") == ["same"] * 4
    assert words(comparison(offset_deg=(0.1, -0.9, 0.1, 0.1)), "offset") == ["low", "high", "low", "low"]


@given(st.lists(st.floats(0.0, 1e3), min_size=4, max_size=4))
def test_a_larger_number_never_ranks_behind_a_smaller_one(values) -> None:
    marks = comparison(noise_density_deg=values).ranks()["noise"]
    ranks = [marks[name].rank for name in METHODS]
    assert min(ranks) == 1
    for a, first in zip(values, ranks, strict=True):
        for b, second in zip(values, ranks, strict=True):
            assert (a <= b) or (first <= second)
            assert a != b or first == second


def test_quantities_without_two_numbers_are_not_ranked() -> None:
    alone = comparison(vibration_gain=(1.0, None, None, None))
    assert "vibration" not in alone.ranks()
    assert "vibration gain" in str(alone)
    assert "noise" not in str(alone.table())


def test_a_lower_bound_is_shown_as_one() -> None:
    found = comparison(settling_s=(3.0, 1.0, 12.34, 0.5), settling_moves=(2, 2, 2, 2), settling_unfinished=(2, 1, 0, 0))
    row = next(row for row in found.table().rows if row[0] == "settling time")
    assert row[2:] == ("> 3.00", "1.00", "12.3", "0.50")


def lines(n: int = 40000):
    t = 0.01 * np.arange(n)
    noisy = np.sin(t) + 0.1 * np.random.default_rng(0).normal(size=n)
    return t, {"accel": noisy, "gyro": np.sin(t) + 0.2 * t, "kalman": np.sin(t)}


def test_long_lines_are_thinned_but_keep_their_extremes() -> None:
    t, angles = lines()
    angles["accel"][12345] = 7.0
    (first, *_, last) = tilt_figure(t, np.sin(t), angles, angles).root.axes
    drawn = {line.get_label(): line for line in first.lines}
    x, y = drawn["accel"].get_data()
    assert len(x) < 5000
    assert y.max() == 7.0
    assert x[y.argmax()] == t[12345]
    assert (np.diff(x) >= 0.0).all()
    assert last.get_title(loc="left").startswith("Error")


def test_a_method_that_runs_away_leaves_the_picture_and_that_is_told() -> None:
    t, angles = lines()
    (first, *_) = tilt_figure(t, np.sin(t), angles, angles).root.axes
    low, high = first.get_ylim()
    assert high < 20.0 < angles["gyro"].max()
    assert low < -1.0
    (told,) = [text.get_text() for text in first.texts]
    assert told.startswith("gyro leaves the picture: 8")


def test_the_noisiest_line_lies_beneath_and_the_reference_on_top() -> None:
    t, angles = lines(500)
    zoom = Zoom("A move", 1.0, 2.0, ((1.2, 1.5),))
    figure = tilt_figure(t, np.sin(t), angles, angles, [zoom], angle="angle about x").root
    first, second, _ = figure.axes
    assert first.lines[0].get_label() == "accel"
    top = max(first.lines, key=lambda line: line.get_zorder())
    assert top.get_label() == "reference"
    assert second.get_title(loc="left") == "A move"
    x, _ = second.lines[0].get_data()
    assert (x.min(), x.max()) == pytest.approx((1.0, 2.0))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["accel", "gyro", "kalman", "reference"]


def test_methods_without_a_colour_of_their_own_get_different_ones() -> None:
    t, angles = lines(100)
    many = dict.fromkeys(("triad", "quest", "mahony", "hybrid", "mekf", *METHODS), angles["kalman"])
    (first, _) = tilt_figure(t, np.sin(t), many, many).root.axes
    colours = [line.get_color() for line in first.lines]
    assert len(set(colours)) == len(colours) == 10
