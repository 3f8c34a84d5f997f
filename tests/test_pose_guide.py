"""The guide through six sides, sample by sample, and the judge behind it."""

import numpy as np
import pytest
from calibration_logs import SIDES, Sensor, course, exp, typical
from imufit import _imufit
from imufit.calibrating import PoseGuide

SENSOR = typical(3, acc_noise=0.02)


def samples(where, *, names="acc gyr", shake=0.0, sensor=SENSOR):
    arrays = sensor.read(where, 1, names=names, shake=shake)
    return zip(arrays["t"], arrays["acc"], arrays.get("gyr", [None] * len(arrays["t"])), strict=True)


def guided(where, **changed):
    guide = PoseGuide()
    return guide, [guide.step(*sample) for sample in samples(where, **changed)]


@pytest.mark.parametrize("names", ["acc gyr", "acc"])
def test_six_sides_are_accepted_one_after_the_other(names):
    order = ("+z", "+x", "-z", "-y", "-x", "+y")
    guide, advice = guided(course(order, hold=3.0), names=names)
    accepted = [one.accepted for one in advice if one.accepted]
    assert accepted == list(order[:-1])
    assert guide.finish() == "+y"
    assert guide.complete
    assert guide.missing == ()
    for side in SIDES:
        axis = "xyz".index(side[1])
        ideal = (1.0 if side[0] == "+" else -1.0) * 9.80665 * np.eye(3)[axis]
        assert np.linalg.norm(guide.done[side] - SENSOR.acc_gain @ ideal - SENSOR.acc_bias) < 0.02


def test_progress_rises_while_the_sensor_is_held_and_falls_when_it_moves():
    where = course(["+x", "+y"], hold=4.0)
    _, advice = guided(where)
    first = advice[where.rests[0]]
    progress = [one.progress for one in first]
    assert np.all(np.diff(progress) > -1e-9)
    assert first[-1].progress == 1.0
    assert [one.state for one in first if one.state == "held"]
    held = next(k for k, one in enumerate(first) if one.state == "held")
    assert 1.9 < where.t[held] < 2.3
    turning = advice[where.rests[0].stop + 50]
    assert (turning.state, turning.progress) == ("moving", 0.0)


def test_message_says_what_to_do_next():
    where = course(["+x", "+y"], hold=4.0)
    _, advice = guided(where)
    first, second = (advice[rest] for rest in where.rests)
    assert "+x up: hold still, " in first[120].message
    # A quarter turn is nearer than a half one.
    assert first[-1].message == "+x up: held. Now turn +y up."
    assert "+y up: hold still, " in second[120].message
    assert second[120].missing == ("+y", "-x", "+z", "-z", "-y")
    assert second[-1].message == "+y up: held. Now turn -x up."


def test_every_line_of_advice_is_one_line():
    _, advice = guided(course(["+x", "+x", (1.0, 1.0, 1.0), "-z"], hold=3.0))
    assert all(one.message and "\n" not in one.message for one in advice)


def test_shaking_hand_is_refused():
    where = course(["+x", "+y"], hold=4.0)
    shake = 0.5 * np.sin(2 * np.pi * 6.0 * where.t[:, None] + [0.0, 1.0, 2.0])
    guide, advice = guided(where, shake=shake)
    assert not [one.accepted for one in advice if one.accepted]
    assert guide.finish() is None
    assert guide.done == {}
    assert {one.state for one in advice} == {"moving"}


def test_tilted_sensor_is_refused_and_told_how_far_off():
    guide, advice = guided(course([(1.0, 0.7, 0.0), "+z"], hold=4.0))
    assert [one.accepted for one in advice if one.accepted] == []
    refusals = [one.message for one in advice if "off the vertical" in one.message]
    assert len(refusals) == 1
    assert "+x is 3" in refusals[0]
    assert guide.finish() == "+z"


def test_pose_that_was_left_too_early_is_refused_with_its_time():
    where = course(["+x", "+y"], hold=1.5)
    guide, advice = guided(where)
    assert [one.accepted for one in advice if one.accepted] == []
    assert len([one for one in advice if one.message.startswith("Too short: hold still for longer than ")]) == 1
    assert guide.finish() is None


def test_side_that_is_known_is_not_taken_twice():
    _, advice = guided(course(["+x", "+y", "+x", "+z"], hold=3.0))
    assert [one.accepted for one in advice if one.accepted] == ["+x", "+y"]
    assert [one.message for one in advice if "known already" in one.message] == ["+x up is known already."]


def test_missing_readings_do_not_stop_the_guide():
    guide, missing = PoseGuide(), np.full(3, np.nan)
    for k, (t, acc, gyr) in enumerate(samples(course(["+x", "+y"], hold=4.0))):
        guide.step(t, missing if k % 7 == 0 else acc, missing if k % 5 == 0 else gyr)
    assert list(guide.done) == ["+x"]
    assert guide.finish() == "+y"


def knocked():
    """Sides with a knock, a shift, a gap and missing readings in them."""
    where = course([*SIDES, (1.0, 1.0, 0.5), "+z"], hold=3.0)
    shake = np.zeros((len(where.t), 3))
    row = where.rests[1].start + 150
    shake[row : row + 12] = [5.0, -3.0, 4.0]
    shifted = slice(where.rests[2].start + 140, where.rests[2].stop)
    where.up = where.up.copy()
    where.up[shifted] = where.up[shifted] @ exp([0.02, 0.0, 0.02]).T
    arrays = Sensor(acc_step=0.01).read(where, 2, names="acc gyr", shake=shake)
    arrays["acc"][::11] = np.nan
    arrays["gyr"][::13] = np.nan
    arrays["t"] = arrays["t"] + np.where(np.arange(len(where.t)) > where.rests[4].start + 150, 5.0, 0.0)
    return arrays


@pytest.mark.parametrize("with_gyro", [True, False])
def test_stream_and_whole_log_give_the_same_poses(with_gyro):
    arrays = knocked()
    t, acc, gyr = arrays["t"], arrays["acc"], arrays["gyr"] if with_gyro else None
    # With the noise given neither has to learn it.
    settings = {"acc_noise": 0.03, "gyr_noise": 0.002, "hold": 1.0}
    whole = _imufit.find_rests(t, acc, gyr, None, settings)["poses"]
    judge = _imufit.PoseJudge(settings)
    stream = []
    for k in range(len(t)):
        closed = judge.step(t[k], acc[k].tolist(), None if gyr is None else gyr[k].tolist())["closed"]
        stream += [closed] if closed else []
    stream.append(judge.finish())
    # The whole log leaves out what is far too short without a word.
    stream = [one for one in stream if not (one["flaw"] and one["flaw"][0] == "short" and one["flaw"][1] < 0.5)]
    assert len(whole) == len(stream) >= 9
    assert sum(bool(one["knocks"]) for one in whole) >= 1
    for one, other in zip(whole, stream, strict=True):
        for key in ("rows", "time", "knocks", "n", "mean", "deviation", "side", "flaw", "rate"):
            assert one[key] == other[key], key


def test_unknown_criteria_are_refused():
    with pytest.raises(ValueError, match="patience is no criterion"):
        PoseGuide({"patience": 1.0})
    with pytest.raises(ValueError, match="hold is 0"):
        PoseGuide({"hold": 0.0})


def test_a_side_that_was_held_is_not_asked_for_again_while_the_sensor_leaves_it():
    where = course(["-z", "+x"], hold=4.0)
    _, advice = guided(where, names="acc")
    held = next(k for k, one in enumerate(advice) if one.state == "held")
    accepted = next(k for k, one in enumerate(advice) if one.accepted == "-z")
    leaving = [one for one in advice[held:accepted] if one.state == "moving"]
    assert leaving
    assert {one.wanted for one in leaving}.isdisjoint({"-z"})
    assert all("-z" not in one.message for one in leaving)
