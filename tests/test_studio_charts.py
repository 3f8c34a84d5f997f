"""Figures of the studio: what the bars of the fall of the error say, and how lines and axes look."""

import math

import numpy as np
import pytest
from imufit.results import Spectrum
from imufit.results.comparison import Panel
from imufit.studio import charts


def test_steps_that_were_undone_stand_in_the_legend():
    names = ["ideal sensor", "+ acc.bias", "acc.bias.x fixed"]
    ratios, expected = [15.8, 15.7, 15.7], [None, 15.7, None]
    there = charts.fall(names, ratios, expected, 2)
    undone = charts.fall(names, ratios, expected, 1)
    assert "undone" not in [trace["name"] for trace in there["data"] if "name" in trace]
    assert "undone" in [trace["name"] for trace in undone["data"] if "name" in trace]
    over = [next(trace["text"] for trace in made["data"] if "text" in trace) for made in (there, undone)]
    assert over == [["15.8", "15.7", "now<br>15.7"], ["15.8", "now<br>15.7", "15.7"]]
    assert undone["data"][0]["marker"]["opacity"] == [1.0, 1.0, charts.UNDONE]


def test_a_long_step_takes_no_room_from_the_bars():
    name = "influence of temperature_of_the_left_motor on the accelerometer x fixed"
    figure = charts.fall(["ideal sensor", name], [2.0, 1.0], [None, None], 1, best=(f"+ {name}", 0.9))
    assert figure["layout"]["xaxis"]["ticktext"] == ["0", "1", charts.NEXT]
    assert figure["data"][0]["customdata"][1] == name


def named(figure, name):
    """The traces of a figure with a name."""
    return [trace for trace in figure["data"] if trace.get("name") == name]


def test_what_is_expected_has_one_mark_before_a_step_and_after_it():
    figure = charts.fall(["ideal sensor", "+ acc.bias"], [9.0, 2.0], [None, 2.1], 1, best=("+ gyr.bias", 1.1))
    (expected,) = named(figure, "expected")
    assert (expected["x"], expected["y"]) == ([1, 2], [2.1, 1.1])
    assert [trace["name"] for trace in figure["data"] if trace.get("showlegend", True)] == ["expected", "noise floor"]
    assert next(trace["text"] for trace in figure["data"] if "text" in trace) == ["9.00", "now<br>2.00", "1.10"]


@pytest.mark.parametrize("ratios", [[2.0, 1.0], [30.0, 1.0], [9.3e8, 1.0]])
def test_bars_stand_on_the_noise_floor_or_on_zero_with_room_for_their_numbers(ratios):
    axis = charts.fall(["ideal sensor", "+ acc.bias"], ratios, [None, None], 0)["layout"]["yaxis"]
    begin, end = axis["range"]
    height = math.log10(ratios[0]) if axis.get("type") == "log" else ratios[0]
    assert begin == 0.0
    assert end == pytest.approx(charts.ROOM * height)
    # The numbers over the bars are crossed by no line of a grid.
    assert not axis["showgrid"]
    assert all("e+" not in text for text in axis.get("ticktext", []))


@pytest.mark.parametrize("decades", [0.1, 0.5, 0.65, 1.0, 2.5, 4.0])
def test_the_axis_of_a_spectrum_names_two_numbers_at_least(decades):
    density = np.array([1.3e-4, 1.3e-4 * 10.0**decades]) ** 2
    found = Spectrum("gyr_x", "(rad/s)^2/Hz", np.array([1.0, 10.0]), density, float(density[0]))
    axis = charts.spectrum(found)["layout"]["yaxis"]
    shown = [value for trace in charts.spectrum(found)["data"] for value in trace["y"]]
    tens = range(-6, 6)
    named_numbers = {1: [10.0**k for k in tens], "D2": [digit * 10.0**k for k in tens for digit in (1.0, 2.0, 5.0)]}
    # Without steps Plotly takes even ones, more than two over less than a decade.
    at = named_numbers.get(axis.get("dtick"), [min(shown), max(shown)])
    assert sum(min(shown) <= value <= max(shown) for value in at) >= 2


def test_a_prediction_leaves_the_reading_beneath_in_sight():
    t, values = np.array([0.0, 1.0]), np.array([9.7, 9.9])
    lines = [("measured", t, values), ("predicted", t, values)]
    figure = charts.trace("acc_x", "m/s^2", lines, (0.0, 1.0), title="reading")
    measured, predicted = (trace["line"] for trace in figure["data"])
    assert predicted["width"] < measured["width"]
    assert (measured["dash"], predicted["dash"]) == ("solid", "dot")


def test_times_at_rest_are_shaded_within_the_window_and_named_in_the_legend():
    t, values = np.linspace(0.0, 10.0, 11), np.zeros(11)
    rests = [(0.0, 1.0), (3.0, 6.0), (8.0, 9.0)]
    figure = charts.trace("acc", "m/s^2", [("x", t, values)], (4.0, 10.0), title="reading", at_rest=rests)
    assert [(shape["x0"], shape["x1"]) for shape in figure["layout"]["shapes"]] == [(4.0, 6.0), (8.0, 9.0)]
    assert [trace["name"] for trace in figure["data"]] == ["x", "at rest"]


def test_without_a_rest_in_the_window_the_legend_names_none():
    t = np.array([0.0, 1.0])
    figure = charts.trace("acc", "m/s^2", [("x", t, t)], (0.0, 1.0), at_rest=[(2.0, 3.0)])
    assert [trace["name"] for trace in figure["data"]] == ["x"]


def test_the_line_of_a_candidate_bears_its_name():
    centre, mean = np.array([0.0, 1.0]), np.array([0.1, 0.2])
    panel = Panel("acc_x", "f_x", "m/s^2", "m/s^2", centre, mean, 0.1 * mean, 0.01, 0.5)
    names = [trace["name"] for trace in charts.residual_panel(panel, panel, effect="accelerometer scale error")["data"]]
    assert "with accelerometer scale error" in names
