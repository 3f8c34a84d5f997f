"""Results turn into strict JSON, data frames, text, HTML and figures."""

import dataclasses
import json
import math

import numpy as np
import pytest
from imufit._imufit import Problem
from imufit.figures import quantity
from imufit.figures.waterfall import waterfall
from imufit.results import Addition, Parameter, Table
from imufit.results.diagnosis import ENOUGH
from imufit.results.judged import Judged
from imufit.results.noise_part import noise_table
from imufit.results.parameter import parameter_table
from imufit.results.sentences import explanation
from loop_results import G_SENSITIVITY, addition, card, comparison, diagnosis, ladder, noise
from matplotlib.figure import Figure

EVERY = [comparison(), diagnosis(), diagnosis("ambiguous"), diagnosis("unknown"), addition(), ladder(), ladder(False)]


def strict(value):
    """JSON round trip that accepts neither NaN nor infinity."""
    return json.loads(json.dumps(value, allow_nan=False))


@pytest.mark.parametrize("result", EVERY, ids=lambda result: type(result).__name__)
def test_every_result_is_strict_json_text_html_frame_and_figure(result):
    assert strict(result.to_dict()) == result.to_dict()
    assert len(str(result)) > 40
    assert result._repr_html_().startswith("<div>")
    assert len(result.to_dataframe()) >= 0
    assert isinstance(result.plot(), Figure)


def test_compare_json_has_the_published_keys_and_null_for_nan():
    value = strict(comparison().to_dict())
    assert {"n", "duration_s", "model", "channels", "sensors", "attitude", "where"} <= set(value)
    assert value["channels"]["gyr_z"]["ratio"] is None
    assert {"rms", "mean", "noise_floor", "ratio", "unit"} <= set(value["channels"]["acc_x"])
    assert value["sensors"]["gyr"] == {"ratio": 1.38}
    assert value["where"][0] == {
        "channel": "gyr_x",
        "covariate": "acc_y",
        "share": 0.63,
        "t_start": 120.0,
        "t_end": 900.0,
    }


def test_diagnose_json_has_the_published_keys():
    value = strict(diagnosis().to_dict())
    assert {"verdict", "best", "ambiguous_with", "candidates", "unexplained"} <= set(value)
    best = value["candidates"][0]
    assert best["effect"] == value["best"] == "gyr.g_sensitivity"
    assert best["parameters"]["xx"]["unit"] == "rad/s/(m/s^2)"
    assert set(best["parameters"]["xx"]) >= {"value", "standard_error", "unit"}
    assert best["confounded_with"] == [{"effect": "gyr.misalignment", "correlation": 0.31}]
    assert value["candidates"][-1]["p_value"] is None
    assert strict(diagnosis("unknown").to_dict())["unexplained"][0]["shape"] == "V-shaped"


def test_add_and_ladder_json_have_the_published_keys():
    value = strict(addition().to_dict())
    assert {"effect", "before", "expected", "after", "held_out", "parameters", "model"} <= set(value)
    assert set(value["parameters"]) == {item.name for item in G_SENSITIVITY}
    assert value["model_parameters"]["gyr.bias"]["x"]["value"] == 0.01
    value = strict(ladder().to_dict())
    assert {"steps", "model", "verdict", "ratio_start", "ratio_end", "attitude"} <= set(value)
    assert set(value["steps"][0]) >= {"effect", "before", "expected", "after"}
    assert (value["attitude"]["before_deg"], value["attitude"]["after_deg"]) == (3.2, 0.41)
    assert value["attitude"]["heading_after_deg"] == pytest.approx(0.328)
    assert value["attitude"]["where"][0]["quantity"] == "angular_rate"


def test_numpy_scalars_become_plain_numbers():
    step = Addition("gyr.bias", np.float64(2.0), np.float32(1.5), math.inf, np.True_, (), ("gyr.bias",))
    assert strict(step.to_dict())["before"] == 2.0
    assert step.to_dict()["after"] is None
    assert step.to_dict()["held_out"] is True


def test_a_drop_far_from_the_expected_one_is_said():
    assert Addition("gyr.bias", 3.0, 1.5, 2.5, True, (), ()).warning
    assert not Addition("gyr.bias", 3.0, 1.5, 1.4, True, (), ()).warning
    assert "acc.cubic" in str(ladder()) or "gyr.bias_temperature:" in str(ladder())


@pytest.mark.parametrize(
    ("value", "error", "unit", "shown"),
    [
        (
            math.radians(0.02) / 9.80665,
            math.radians(0.0004) / 9.80665,
            "rad/s/(m/s^2)",
            "0.02000 ± 0.00040 deg/s per g",
        ),
        (0.0123, 0.0011, "1", "1.23 ± 0.11 %"),
        (0.5, 0.0, "m/s^2", "0.500 m/s²"),
        (0.01, math.nan, "s", "10.0 ms"),
        (6.3e-4, 2e-5, "s", "0.630 ± 0.020 ms"),
        (-2e-5, 7e-5, "s", "-20 ± 70 µs"),
        (12.4, 2e-3, "s", "12.4000 ± 0.0020 s"),
        (0.0, 0.0, "s", "0 s"),
        (2.0, 0.5, "uT", "2.00 ± 0.50 µT"),
    ],
)
def test_values_are_shown_in_the_units_people_use(value, error, unit, shown):
    assert quantity.with_error(value, error, unit) == shown


DEG = 180.0 / math.pi


@pytest.mark.parametrize(
    ("unit", "factor", "shown"),
    [
        ("rad/s", DEG, "deg/s"),
        ("rad", DEG, "deg"),
        ("rad/s^2", DEG, "deg/s²"),
        ("(rad/s)/K", DEG, "deg/s/K"),
        ("(rad/s)/(m/s^2)", DEG * 9.80665, "deg/s per g"),
        ("rad/s/(m/s^2)", DEG * 9.80665, "deg/s per g"),
        ("(m/s^2)/K", 1.0, "m/s²/K"),
        ("m/s^2", 1.0, "m/s²"),
        ("1/K", 100.0, "%/K"),
        ("1/(rad/s)", 100.0 / DEG, "%/(deg/s)"),
        ("(rad/s)/(rad/s)^2", 1.0 / DEG, "deg/s/(deg/s)²"),
        ("(rad/s)/sqrt(Hz)", DEG, "deg/s/√Hz"),
        ("uT/A", 1.0, "µT/A"),
        ("1", 100.0, "%"),
        ("s", 1.0, "s"),
        ("rad s/m", 1.0, "rad s/m"),
    ],
)
def test_shown_unit_converts_the_number_with_the_unit(unit, factor, shown):
    assert quantity.shown_unit(unit)[0] == pytest.approx(factor)
    assert quantity.shown_unit(unit)[1] == shown


def test_missing_numbers_are_dashes():
    assert [quantity.ratio(None), quantity.share(math.nan), quantity.p_value(math.inf), quantity.number(None)] == [
        "-"
    ] * 4


def test_text_table_aligns_and_html_table_escapes():
    table = Table("T", ("name", ">value"), (("a<b", "1"), ("c", "10")))
    assert str(table).splitlines()[-1] == "c        10"
    assert "a&lt;b" in table.html()


def test_a_small_fall_of_an_error_has_a_digit_more():
    assert quantity.change(1.0044, 1.0021) == "1.004 → 1.002"
    assert quantity.fall(1.0044, 1.0021) == "from 1.004 to 1.002 times the noise floor"
    assert quantity.change(1.0021, 1.0044) == "stays at 1.00"
    assert quantity.change(1.0021, 1.0144) == "rises to 1.01"
    assert quantity.change(1.00441, 1.00442) == "stays at 1.00"


def test_parts_of_the_noise_beside_the_floor_are_shown_as_added():
    shares = [(row[1], row[3]) for row in noise_table(noise()).rows[:3]]
    assert shares == [("white", "70 %"), ("reference", "30 %"), ("random walk", "+ 40 %")]


def test_card_prints_its_parts_and_equal_typical_sizes_once():
    text = str(card())
    assert text.startswith("gyr.g_sensitivity: g-sensitivity")
    assert text.count("deg/s per g") == 1
    assert card().to_dict()["parameters"]["xy"] == {"unit": "rad/s/(m/s^2)", "typical": 3e-5}


def test_smallest_detectable_sizes_that_are_equal_stand_once():
    assert diagnosis().candidates[0].smallest_detectable == "each 0.00281 deg/s per g"


def test_error_of_the_drop_does_not_depend_on_the_unit_of_the_gain():
    best = diagnosis().candidates[0]
    scaled = dataclasses.replace(best, gain=1e4 * best.gain, gain_error=1e4 * best.gain_error)
    assert scaled.drop_error == pytest.approx(best.drop_error)
    assert best.drop_error == pytest.approx(0.49 * 0.02 / 0.41)
    assert math.isnan(dataclasses.replace(best, gain=0.0).drop_error)


def test_a_figure_says_of_a_candidate_that_raises_the_error_alone_what_the_tables_say():
    found = diagnosis()
    raising = dataclasses.replace(found.candidates[0], held_out_before=133.0, held_out_after=204.0)
    drawn = dataclasses.replace(found, candidates=(raising, *found.candidates[1:]))
    axes = drawn.plot().axes[0]
    assert raising.error_change == "rises to 204"
    assert axes.texts[0].get_text() == "rises to 204"
    assert (
        axes.get_title(loc="left").replace("\n", " ").startswith("Alone gyr.g_sensitivity does not lower the held-out")
    )
    assert axes.get_xlim()[1] < 140.0


def test_a_probable_candidate_is_not_called_insignificant():
    found = diagnosis()
    likely = dataclasses.replace(found.candidates[2], probability=0.81)
    unlikely = dataclasses.replace(likely, probability=0.2)
    certain = dataclasses.replace(likely, probability=0.9995)
    rows = dataclasses.replace(found, candidates=(certain, likely, unlikely)).candidate_table().rows
    assert [row[1] for row in rows] == ["in doubt", "likely, not established", "not significant"]
    assert pytest.approx(ENOUGH, abs=5e-4) == 1.0 / (1.0 + math.exp(-Problem.ODDS))
    assert "would be a guess" in explanation(card(), certain)
    assert likely.to_dict()["status"] == "not significant"
    assert "more probable than not" in explanation(card(), likely)
    assert "more probable than not" not in explanation(card(), unlikely)


def test_adequate_is_said_of_logs_that_were_judged_as_a_whole():
    judged, left = Judged("mag", True, None), Judged("acc", False, "too few rests")
    whole = dataclasses.replace(diagnosis("adequate"), judged=(judged,), ratio=1.0)
    assert whole.headline == "ADEQUATE"
    assert dataclasses.replace(whole, judged=(judged, left)).headline == "PARTLY JUDGED"
    assert dataclasses.replace(whole, ratio=1.5).headline == "ABOVE THE NOISE"
    assert diagnosis("missing").headline == "MISSING"


def test_channels_stand_with_the_worst_one_first():
    ratios = [row[1] for row in comparison().channel_table().rows]
    known = [float(ratio) for ratio in ratios if ratio != "-"]
    assert known == sorted(known, reverse=True)
    assert "-" not in ratios[: len(known)]


def test_waterfall_is_logarithmic_only_where_the_fall_is_large():
    assert ladder().plot().axes[0].get_yscale() == "log"
    small = waterfall(["gyr.bias"], before=[1.6], expected=[1.1], after=[1.1], training=[1.0], start=1.6)
    assert small.axes[0].get_yscale() == "linear"
    assert small.axes[0].get_ylim()[0] == 0.0


def test_figures_have_a_sentence_for_a_title():
    assert "from 1.52 to 1.03" in diagnosis().plot().axes[0].get_title(loc="left")
    assert "beyond chance" in diagnosis("adequate").plot().axes[0].get_title(loc="left")
    assert "equally well" in diagnosis("ambiguous").plot().axes[0].get_title(loc="left")
    assert "No effect takes away enough" in diagnosis("unknown").plot().axes[0].get_title(loc="left")
    assert "63 %" in comparison().plot().get_suptitle()
    assert "plausible" in Parameter("gyr.bias", "x", 0.01, 1e-4, "rad/s", 0.02).plot().axes[0].get_title(loc="left")


def test_figures_survive_results_without_numbers():
    lonely = Parameter("gyr.bias", "x", math.nan, math.nan, "rad/s", None)
    assert isinstance(lonely.plot(), Figure)
    panel = comparison().panels[0]
    empty = type(panel)("gyr_x", "t", "rad/s", "s", np.full(3, np.nan), np.full(3, np.nan), np.zeros(3), 0.0, math.nan)
    assert isinstance(empty.plot(), Figure)
    empty.plot().canvas.draw()


def test_a_parameter_that_the_log_does_not_tell_is_not_shown_as_a_number():
    scale = [Parameter("gyr.scale", "x", 0.012, 0.001, "1", 0.03), Parameter("gyr.scale", "y", 0.0, 9.0, "1", 0.03)]
    assert [parameter.told for parameter in scale] == [True, False]
    assert [row[2] for row in parameter_table(scale).rows] == ["1.20 ± 0.10 %", "not determined"]
    assert str(scale[1]) == "gyr.scale y = not determined"
    own = Parameter("mag.mine", "k", 1.0, 1e9, "uT", None)
    assert own.told, "without a typical size nobody knows how much is too much"
