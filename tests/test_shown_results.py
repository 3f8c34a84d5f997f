"""Every public result shows itself in one line and as a table, and draws where its user says."""

import dataclasses
import inspect

import imufit
import imufit.filters
import imufit.results
import numpy as np
import pytest
from imufit import InputError
from imufit.lab.grade import BlindGrade
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from loop_results import addition, card, comparison, diagnosis, ladder
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

HOSTILE = "<script>alert(1)</script>\x1b[31m"
SHORT = 500
WITHOUT_SETTINGS = {f"filter {name}" for name in ("accel", "gyro", "triad")}
"""Filters of which a table would be empty."""


@pytest.fixture(scope="module")
def made():
    """Return one of each public result."""
    walk = imufit.simulate("handheld", {"gyr.bias": None}, duration=20.0, covariates=("motor_current",))
    log = walk.to_log()
    fit = imufit.fit(log, ["gyr.bias"])
    sides = imufit.simulate("poses", {"acc.bias": {"x": 0.1}}, duration=60.0, seed=1).to_log()
    rest = imufit.Log.from_arrays(np.arange(6000) / 100.0, gyr=np.random.default_rng(0).normal(size=(6000, 3)) * 1e-3)
    results = {
        "Simulation": walk,
        "Log": log,
        "LogStream": imufit.log.LogStream.of_source(imufit.log.FrameSource(log.to_pandas()), log.metadata),
        "SensorModel": fit.model,
        "Fit": fit,
        "Fit.compare": fit.compare(),
        "Fit.against": fit.against(imufit.fit(log)),
        "LogInfo": imufit.info(log, effects=False),
        "Replay": imufit.replay(log, ["mahony", "gyro"]),
        "Calibration": imufit.calibrate(sides),
        "Allan": imufit.allan(rest),
        "Catalogue": imufit.catalogue(),
        "EffectCard": card(),
        "Comparison": comparison(),
        "Diagnosis": diagnosis(),
        "Addition": addition(),
        "Ladder": ladder(),
        "AttitudeComparison": comparison().attitude,
        "BlindGrade": BlindGrade(()),
        **{f"filter {name}": kind() for name, kind in imufit.filters.ALL.items()},
    }
    results["TiltComparison"] = results["Replay"].comparison()
    assert all(value is not None for value in results.values())
    return results


def parts(value, depth=0):
    """Return a result and every dataclass in its fields."""
    yield value
    if dataclasses.is_dataclass(value) and depth < 4:
        for field in dataclasses.fields(value):
            inner = getattr(value, field.name)
            for item in inner if isinstance(inner, tuple | list) else (inner,):
                if isinstance(item, Part | imufit.results.Result):
                    yield from parts(item, depth + 1)


def test_every_result_and_part_is_one_short_line_and_a_table(made):
    seen = set()
    for name, result in made.items():
        for part in parts(result):
            line = repr(part)
            assert 3 < len(line) <= SHORT, (name, line)
            assert "\n" not in line, (name, line)
            assert "array(" not in line, (name, line)
            html = part._repr_html_()
            assert "<table" in html or name in WITHOUT_SETTINGS, (name, html)
            seen.add(type(part).__name__)
    assert {"Candidate", "Panel", "Spectrum", "Step", "Parameter", "ChannelResidual"} <= seen


def test_every_public_result_class_shows_itself():
    kinds = [kind for _, kind in inspect.getmembers(imufit.results, inspect.isclass)]
    assert len(kinds) > 25
    for kind in kinds:
        own = kind is imufit.results.Table
        assert own or issubclass(kind, Part | imufit.results.Result | imufit.results.Params), kind
        # A dataclass that writes its own line would print arrays.
        assert own or "dataclass" not in getattr(kind.__repr__, "__qualname__", ""), kind
        assert own or kind.__repr__.__module__.startswith("imufit."), kind


def test_names_of_others_are_text_in_html_and_lines():
    log = imufit.Log.from_arrays([0.0, 0.1], acc=np.ones((2, 3)), covariates={HOSTILE: [1.0, 2.0]})
    where = imufit.results.Where("gyr_x", HOSTILE, 0.5, 0.0, 1.0)
    named = dataclasses.replace(card(), id=HOSTILE, name=HOSTILE)
    for shown in (log, where, named, dataclasses.replace(diagnosis(), sentence=HOSTILE)):
        assert "<script>" not in shown._repr_html_()
    for shown in (log, where):
        assert "\x1b" not in repr(shown)
        assert "\x1b" not in shown._repr_html_()


def test_a_catalogue_is_a_list_that_prints_as_a_table():
    cards = imufit.catalogue()
    assert [each.id for each in cards] == list(cards.to_dict()) == list(cards.to_dataframe()["id"])
    assert "gyr.bias" in str(cards)
    assert f"{len(cards)} effects" in repr(cards)
    assert cards[0].id in cards._repr_html_()


@pytest.fixture
def grid():
    """Return a function that makes Axes of pyplot, which are closed after the test."""
    yield plt.subplots
    plt.close("all")


def plots(made):
    return {name: result for name, result in made.items() if hasattr(result, "plot") and name != "BlindGrade"}


def test_every_plot_draws_on_one_axes_on_axes_side_by_side_and_on_a_figure(made, grid):
    drawn = plots(made)
    assert {"Fit", "Log", "Replay", "Calibration", "Allan", "Ladder", "Diagnosis", "Fit.against"} <= set(drawn)
    for name, result in drawn.items():
        own = result.plot()
        assert isinstance(own, Figure), name
        assert own._repr_png_().startswith(b"\x89PNG"), name
        assert len(own._repr_png_()) < 100_000, name
        panels = [axes for axes in own.axes if axes.get_visible() and axes.get_label() != "<colorbar>"]
        figure, one = grid()
        before = plt.get_fignums()
        shown = result.plot(ax=one)
        on = [shown] if isinstance(shown, Axes) else shown
        assert all(isinstance(axes, Axes) and axes.get_figure(root=True) is figure for axes in on), name
        assert len(on) == len(panels), name
        assert (on == [one]) == (len(panels) == 1), name
        figure.canvas.draw()
        assert plt.get_fignums() == before, name
        figure, side = grid(1, len(panels))
        given = list(np.ravel(side))
        back = result.plot(ax=side)
        assert given == ([back] if isinstance(back, Axes) else back), name
        assert all(axes.has_data() for axes in given), name
        assert len(figure.axes) == len(given), name
        left, right = plt.figure(layout="constrained").subfigures(1, 2)
        result.plot(ax=left)
        assert len(left.get_axes()) == len(panels), name
        assert not right.get_axes(), name
        plt.close("all")


def test_a_wrong_ax_is_said(made, grid):
    _, three = grid(1, 3)
    with pytest.raises(InputError, match=r"4 panels, and ax has 3 Axes.*Give 4 Axes"):
        made["Log"].plot(ax=three)
    with pytest.raises(InputError, match="not a matplotlib Axes"):
        made["Fit"].plot(ax="left")
    with pytest.raises(InputError, match="not a matplotlib Axes"):
        made["Fit"].plot(ax=[])
    outside = plt.figure().add_axes((0.1, 0.1, 0.3, 0.3))
    with pytest.raises(InputError, match="outside of a grid"):
        made["Log"].plot(ax=outside)
    assert made["Fit"].plot(ax=outside) is outside


def test_the_users_title_replaces_ours_and_a_chosen_layout_stays(made, grid):
    figure, axes = grid()
    figure.set_layout_engine("tight")
    made["Ladder"].plot(ax=axes)
    assert axes.get_title()
    axes.set_title("mine")
    assert [axes.get_title(loc=place) for place in ("left", "center", "right")] == ["", "mine", ""]
    assert type(figure.get_layout_engine()).__name__ == "TightLayoutEngine"


def test_a_parameter_that_the_log_does_not_tell_has_words_and_no_point():
    told = imufit.Parameter("acc.scale", "x", 0.01, 0.001, "1", 0.02)
    untold = imufit.Parameter("acc.scale", "y", 0.0, 9.0, "1", 0.02)
    fit = dataclasses.replace(addition(), parameters=(told, untold))
    (axes,) = fit.plot().axes
    assert [text.get_text() for text in axes.texts] == [told.shown, "not determined"]
    assert axes.get_xlim()[1] < 10.0


def test_every_plot_of_a_result_is_the_same_method():
    own = {"Calibration"}  # which takes the logs too
    for _, kind in inspect.getmembers(imufit.results, inspect.isclass):
        if hasattr(kind, "plot") and kind.__name__ not in own:
            assert kind.plot is Plotted.plot, kind
