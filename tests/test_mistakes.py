"""The table of mistakes is whole, and the common ones are named."""

from dataclasses import replace

import pytest
from mistakes.catalogue import CATALOGUE, Group, Remedy, by_id
from mistakes.judge import Answer, Kind, ask, judge, kind_of, stands, write
from mistakes.sound import Sound, simulated


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Sound:
    return simulated("handheld", 1, tmp_path_factory.mktemp("sound"))


@pytest.fixture(scope="module")
def baseline(sound, tmp_path_factory) -> Answer:
    return ask(write(sound.log, tmp_path_factory.mktemp("baseline") / "log.parquet"))


def test_the_table_has_every_group_and_no_id_twice():
    ids = [row.id for row in CATALOGUE]
    assert len(ids) >= 60
    assert len(set(ids)) == len(ids)
    assert {row.group for row in CATALOGUE} == set(Group)
    assert all(row.harmless == (row.remedy is Remedy.NOTHING) == (not row.words) for row in CATALOGUE)


@pytest.mark.parametrize("name", ["acc_g", "gyr_dps", "t_ms_whole", "acc_xy", "ref_scalar_last", "frame_unknown"])
def test_a_common_mistake_is_named(name, sound, baseline, tmp_path):
    found = judge(by_id(name), sound, baseline, tmp_path, 1)
    assert found is not None
    assert found.kind is Kind.NAMED, found.message


def test_a_harmless_change_is_not_named(sound, baseline, tmp_path):
    assert judge(by_id("sign_flips"), sound, baseline, tmp_path, 1).kind is Kind.UNTOUCHED


def test_an_answer_without_a_name_is_not_taken_for_one(sound, baseline, tmp_path):
    path = write(sound.log, tmp_path / "log.csv")
    mistake = by_id("acc_g")
    said = {
        "verdict": "missing",
        "best": "acc.scale",
        "ambiguous_with": [],
        "candidates": [],
        "data_faults": [],
        "notes": [],
        "noise": [],
    }
    for change, kind in (
        ({}, Kind.WRONG_MISSING),
        ({"verdict": "adequate", "best": None}, Kind.UNNOTICED),
        ({"verdict": "unknown", "best": None}, Kind.UNKNOWN_ONLY),
    ):
        answer = Answer(0, "", {**said, **change})
        assert kind_of(mistake, sound, sound.log, baseline, answer, path) is kind
    mapped = Answer(2, "acc looks like milli-g. Use --map 'acc_x=acc_x[mg]'", None)
    assert kind_of(mistake, sound, sound.log, baseline, mapped, path) is Kind.MISLED
    assert kind_of(mistake, sound, sound.log, baseline, Answer(2, "no such file", None), path) is Kind.REFUSED_OTHERWISE
    assert kind_of(mistake, sound, sound.log, baseline, Answer(1, "Traceback", None), path) is Kind.CRASHED


def test_a_mapping_that_does_not_restore_is_found(sound, baseline, tmp_path):
    mistake = by_id("gyr_dps")
    path = write(mistake.spoil(sound.log, None), tmp_path / "log.csv")
    said = "gyr is in deg/s. Use --map 'gyr_x=gyr_x[{0}],gyr_y=gyr_y[{0}],gyr_z=gyr_z[{0}]'"
    for unit, kind in (("deg/s", Kind.NAMED), ("rpm", Kind.WRONG_REMEDY)):
        answer = Answer(2, said.format(unit), None)
        assert kind_of(mistake, sound, sound.log, baseline, answer, path) is kind
    silent = replace(Answer(2, "", None), stderr="gyr is in deg/s")
    assert kind_of(mistake, sound, sound.log, baseline, silent, path) is Kind.NO_REMEDY


@pytest.mark.parametrize(
    ("word", "text", "is_there"),
    [
        ("ms", "t seems to be in [ms]", True),
        ("ms", "these terms", False),
        ("16384 LSB", "[16384LSB/g]", True),
        ("4096 LSB", "14096 LSB/g", False),
        ("conjugat*", "Conjugated", True),
    ],
)
def test_words_are_whole(word, text, is_there):
    assert stands(word, text) is is_there
