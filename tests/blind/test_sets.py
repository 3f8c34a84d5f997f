"""Every set of blind logs, small: the logs are what they say, and the answers are right nearly always.

Every run draws new seeds; IMUFIT_SEED repeats one (it is told with a failure).
"""

import json
import os
import secrets

import numpy as np
import pytest
from imufit.lab.grade import SETS, BlindGrade, draw, grade, plan, trial
from imufit.lab.grade.drawing import effects
from imufit.lab.grade.pairs import PAIRS
from imufit.lab.simulate import INJECTIONS, OUTSIDE

SEED = int(os.environ.get("IMUFIT_SEED", secrets.randbelow(10**6)))
SURE = tuple(name for name in SETS if name not in ("small", "small-realistic", "outside"))


@pytest.fixture(scope="module")
def marks() -> BlindGrade:
    return grade(SURE, logs=1, seed=SEED, processes=1)


def test_answers_are_right_nearly_always(marks):
    assert len(marks.trials) == len(SURE)
    assert len(marks.failures) <= 2, f"IMUFIT_SEED={SEED}\n{marks}"


def test_ladder_ends_at_the_true_noise(marks):
    ends = [t.true_ratio for t in marks.trials if t.answer.end == "adequate" and not t.marks.faults]
    assert len(ends) >= 3
    assert np.median(ends) == pytest.approx(1.0, abs=0.01), f"IMUFIT_SEED={SEED}\n{marks}"


def test_parameters_are_within_their_errors(marks):
    errors = [error for each in marks.trials for error in each.errors]
    assert len(errors) >= 4
    assert np.sqrt(np.mean(np.square(errors))) < 2.0, f"IMUFIT_SEED={SEED}\n{marks}"


def test_table_counts_what_the_marks_say(marks):
    rows = {row["set"]: row for row in marks.rows()}
    assert list(rows) == list(SURE)
    for name, row in rows.items():
        trials = marks.of(name)
        assert row["logs"] == 1
        for mark in ("named", "wrong", "missed", "alarm", "single", "needless"):
            asked = [getattr(each.marks, mark) for each in trials]
            assert (mark in row) == (asked[0] is not None)
            if mark in row:
                assert row[mark]["count"] == sum(asked)
                assert row[mark]["low"] <= row[mark]["share"] <= row[mark]["high"]
        assert set(SETS[name].demands) <= set(row)


def test_v_over_the_current_is_unknown():
    number = list(OUTSIDE).index("gyr.current_vee") + len(OUTSIDE) * SEED
    # A current that switches may be told first as random telegraph noise over time.
    assert set(trial("outside", number).marks.faults) <= {"another covariate"}, f"IMUFIT_SEED={SEED}"


def test_a_log_depends_on_its_set_and_seed_alone():
    # Effects come in turn with the seed.
    jobs = [("one", 3), ("one", 3), ("one", 3 + len(effects())), ("one-realistic", 3)]
    first, again, other, elsewhere = (draw(*job) for job in jobs)
    np.testing.assert_array_equal(first.simulation.acc, again.simulation.acc)
    assert first.simulation.truth == again.simulation.truth
    for different in (other, elsewhere):
        assert different.kind == first.kind
        assert not np.array_equal(different.simulation.acc[:100], first.simulation.acc[:100])
    assert "noise" not in elsewhere.simulation.metadata
    assert plan(["one", "two"], 2, 5) == [("one", 5), ("one", 6), ("two", 5), ("two", 6)]


def test_effects_in_turn_are_the_whole_catalogue():
    assert set(INJECTIONS) <= set(effects())
    assert len([name for name in effects() if ".column:" in name]) == 3


@pytest.mark.parametrize("number", [0, 4, 8])
def test_pair_is_the_same_in_one_log_and_not_in_the_other(number):
    together, apart = draw("confounded", number), draw("separated", number)
    pair = list(PAIRS.values())[number]
    names = {pair.first[0], pair.second[0]}
    (truth,) = together.truth
    assert names - {truth} <= set(together.rivals)
    assert set(apart.truth) < names
    assert apart.rivals == ()


def test_columns_are_many_and_one_is_the_cause():
    puzzle = draw("columns", 4)
    assert len(puzzle.simulation.covariates) == 7
    (truth,) = puzzle.truth
    assert truth.partition(":")[2] in puzzle.simulation.covariates
    fan, temp = puzzle.simulation.covariates["fan"], puzzle.simulation.temp
    assert 0.3 < np.corrcoef(fan, temp)[0, 1] < 0.99


def test_two_effects_are_both_as_large_as_they_should_be():
    sizes = draw("two", 6).simulation.truth.sizes
    assert len(sizes) == 2
    assert all(0.299 < size < 3.01 for size in sizes.values())


def test_unknown_set_is_refused():
    with pytest.raises(ValueError, match="unknown set 'tow'"):
        draw("tow", 1)
    with pytest.raises(ValueError, match="unknown set 'tow'"):
        grade(["tow"], logs=1)


def test_marks_come_back_from_json(marks):
    again = BlindGrade.from_dict(json.loads(json.dumps(marks.to_dict())))
    assert again.to_dict() == marks.to_dict()
    assert str(again) == str(marks)
