"""What counts as right and wrong in an answer."""

from types import SimpleNamespace

import pytest
from imufit.lab.grade.mark import Answer, Marks, marked
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.grade.wilson import interval
from scipy.stats import binomtest

DELAY, LAG, BIAS = "acc.delay", "acc.lowpass", "acc.bias"


def puzzle(question, *truth, rivals=(), causes=None):
    simulation = SimpleNamespace(truth=SimpleNamespace(effects={name: {} for name in truth}))
    return Puzzle(question, "", simulation, tuple(rivals), causes=causes or {})


def answer(verdict, *named, steps=(), end="adequate", unexplained=()):
    return Answer(verdict, named, tuple(steps), end, (), tuple(unexplained))


@pytest.mark.parametrize(
    ("rivals", "said", "faults"),
    [
        ((), answer("missing", DELAY, steps=[DELAY]), ()),
        ((), answer("adequate"), ("missed",)),
        ((), answer("unknown"), ("missed",)),
        ((), answer("missing", BIAS, steps=[BIAS]), ("wrong name",)),
        ((), answer("missing", DELAY, steps=[DELAY, BIAS]), ("wrong name",)),
        ((), answer("ambiguous", DELAY, LAG), ("needless",)),
        ((LAG,), answer("ambiguous", DELAY, LAG), ()),
        ((LAG,), answer("ambiguous", LAG, DELAY, BIAS), ("needless",)),
        ((LAG,), answer("ambiguous", LAG, BIAS), ("wrong name",)),
    ],
)
def test_one_hidden_effect(rivals, said, faults):
    assert marked(puzzle("one", DELAY, rivals=rivals), said).faults == faults


@pytest.mark.parametrize(
    ("said", "faults"),
    [
        (answer("ambiguous", LAG, DELAY), ()),
        (answer("missing", DELAY), ("single",)),
        (answer("missing", LAG), ("wrong name", "single")),
        (answer("ambiguous", DELAY, LAG, BIAS), ("needless",)),
        (answer("unknown"), ("missed",)),
    ],
)
def test_pair_that_cannot_be_told_apart(said, faults):
    assert marked(puzzle("confounded", DELAY, rivals=[LAG]), said).faults == faults


@pytest.mark.parametrize(
    ("said", "faults"),
    [
        (answer("missing", BIAS, steps=[BIAS, DELAY]), ()),
        (answer("missing", BIAS, steps=[BIAS]), ("missed",)),
        (answer("missing", BIAS, steps=[BIAS, DELAY, LAG]), ("wrong name",)),
        (answer("missing", BIAS, steps=[BIAS, DELAY], end="unknown"), ("not named",)),
    ],
)
def test_two_hidden_effects(said, faults):
    assert marked(puzzle("two", DELAY, BIAS), said).faults == faults


def test_nothing_hidden_and_anything_found_is_an_alarm():
    assert marked(puzzle("nothing"), answer("adequate")) == Marks(alarm=False)
    for said in (answer("unknown"), answer("missing", BIAS, steps=[BIAS]), answer("ambiguous", BIAS, LAG)):
        assert marked(puzzle("nothing"), said).faults == ("alarm",)


CURRENT = {"gyr_x": ("motor_current",), "gyr_y": ("motor_current", "omega_y"), "gyr_z": ()}


@pytest.mark.parametrize(
    ("said", "faults"),
    [
        (answer("unknown", unexplained=[("gyr_x", "motor_current")]), ()),
        (answer("unknown", unexplained=[("gyr_x", "temp"), ("gyr_x", "motor_current")]), ("another covariate",)),
        (answer("unknown", unexplained=[("gyr_x", "omega_y")]), ("another covariate",)),
        (answer("unknown", unexplained=[("gyr_y", "temp * omega_y")]), ()),
        (answer("missing", "gyr.bias", unexplained=[("gyr_x", "motor_current")]), ("wrong name",)),
        (answer("adequate"), ("missed", "another covariate")),
        (answer("unknown", steps=["gyr.bias"], unexplained=[("gyr_x", "motor_current")]), ("needless",)),
    ],
)
def test_effect_outside_the_catalogue(said, faults):
    assert marked(puzzle("outside", "gyr.current_vee", causes=CURRENT), said).faults == faults


def test_no_covariate_is_asked_for_where_nothing_in_the_log_causes_it():
    assert marked(puzzle("outside", "acc.mains_hum"), answer("unknown")).covariate is None


@pytest.mark.parametrize(("right", "n"), [(0, 7), (7, 7), (58, 60), (1, 2)])
def test_interval_of_a_share_is_wilsons(right, n):
    reference = binomtest(right, n).proportion_ci(0.95, "wilson")
    assert interval(right, n) == pytest.approx((reference.low, reference.high), abs=1e-6)
