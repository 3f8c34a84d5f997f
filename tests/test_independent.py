"""The ladder on failures of real labs, drawn by a second simulator (tests/independent/lab_failures.py).

Rows whose answer is wrong are open: docs/independent.md lists them with their faults.
"""

import re
from pathlib import Path

import lab_failures
import outside
import pandas as pd
import pytest
import unknown_field
import whole_sensor
from case import Case
from independent_answer import REFUSED, SEED, Answer, answer, false_names, faults, missed, too_far, verdict

OPEN = frozenset({"mount_rings"})
PAGE = Path(__file__).resolve().parents[1] / "docs" / "independent.md"


@pytest.mark.parametrize("row", [name for name in lab_failures.ROWS if name not in OPEN])
def test_failure_of_a_lab_is_answered_rightly(row, tmp_path):
    case = lab_failures.ROWS[row](SEED)
    said = answer(case, tmp_path)
    assert not false_names(case, said), said
    assert not missed(case, said), said
    assert verdict(case, said) in case.verdicts, said
    assert not too_far(case, said), said


def test_a_low_pass_is_not_taken_for_a_delay_and_gains(tmp_path):
    """The noise of the reference is smoothed along by the low-pass: under one noise for both the delay would win."""
    case = whole_sensor.draw(9103)
    assert {"gyr.lowpass", "ref.delay"} <= case.effects.keys()
    said = answer(case, tmp_path)
    assert set(said.steps) == case.effects.keys()
    assert said.end == "adequate"


@pytest.mark.parametrize("seed", [5915, 11815])
def test_a_spring_that_creeps_is_not_taken_for_a_scale_error(seed, tmp_path):
    """Each axis reads force less a part that follows within seconds; beside a wandering zero a gain explains most."""
    case = outside.draw(seed)
    assert "creep" in case.name
    said = answer(case, tmp_path)
    assert not false_names(case, said), said
    assert verdict(case, said) == "unknown", said


@pytest.mark.parametrize("seed", [6, 44, 47, 49])
def test_iron_in_an_unknown_field_is_named_where_it_can_be_seen(seed, tmp_path):
    """Strong iron, a tilted table, iron along the only axis of a level table, and none beside a noisy reference."""
    case = unknown_field.draw(seed)
    said = answer(case, tmp_path)
    assert not false_names(case, said), said
    assert not missed(case, said), said


def test_page_shows_which_rows_are_open():
    rows = re.findall(r"^\| `(\w+)` \| .* \| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    faults = {name: fault for name, fault in rows if name in lab_failures.ROWS}
    assert faults.keys() == lab_failures.ROWS.keys()
    assert {name for name, fault in faults.items() if fault != "-"} == OPEN


@pytest.mark.parametrize(
    ("effects", "said", "found"),
    [
        ((), Answer("adequate", "adequate"), []),
        ((), Answer(REFUSED, REFUSED), ["verdict refused instead of adequate"]),
        (
            (),
            Answer("missing", "adequate", ("gyr.scale",), ("gyr.scale",)),
            ["false name gyr.scale", "verdict missing"],
        ),
        (("acc.bias",), Answer("missing", "adequate", ("acc.bias",), ("acc.bias",)), []),
        (("acc.bias",), Answer("missing", "adequate", ("acc.bias", "acc.scale"), ("acc.bias",)), []),
        (("acc.bias",), Answer("adequate", "adequate"), ["missed acc.bias"]),
        (("acc.bias",), Answer("missing", "unknown", ("acc.bias",), ("acc.bias", "acc.cubic")), ["false", "verdict"]),
    ],
)
def test_faults_of_an_answer(effects, said, found):
    truth = {effect: {"x": 0.1} for effect in effects}
    case = Case("", pd.DataFrame(), {}, truth, frozenset({*effects, "acc.scale"}), frozenset({"adequate"}), 1.0)
    told = faults(case, said)
    assert len(told) == len(found)
    assert all(fault.startswith(start) for fault, start in zip(told, found, strict=True)), told


def test_a_lever_arm_three_millimetres_off_is_a_fault():
    name = "lever_arm_beside_lively_reference"
    case = lab_failures.ROWS[name](SEED)
    true = case.effects["acc.lever_arm"]["x"]
    near, far = (
        Answer("missing", "adequate", parameters={"acc.lever_arm.x": (true + off, 1e-4)}) for off in (0.001, 0.003)
    )
    assert not too_far(case, near)
    assert too_far(case, far)
