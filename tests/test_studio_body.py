"""The body in three dimensions: frames, order of quaternions, and the attitudes that it plays."""

import numpy as np
import pytest
from imufit.calibrating.guide import PoseGuide
from imufit.filters import Gyro
from imufit.lab.simulate import simulate
from imufit.log import Log
from imufit.loop import SensorModel
from imufit.rests.poses import UP
from imufit.studio import attitudes
from imufit.studio.attitudes import error_deg, measured_track, predicted_track, reference_track, scene_rotation
from scipy.spatial.transform import Rotation

pytest.importorskip("nicegui")

HALF = np.sqrt(0.5)
EAST, NORTH, UPWARDS = np.eye(3)


@pytest.mark.parametrize(
    ("frame", "q", "axes"),
    [
        # level, nose to the north: z down in NED, up in NWU; a yaw of 0 points east in ENU
        ("NED", [1.0, 0.0, 0.0, 0.0], (NORTH, EAST, -UPWARDS)),
        ("NWU", [1.0, 0.0, 0.0, 0.0], (NORTH, -EAST, UPWARDS)),
        ("ENU", [1.0, 0.0, 0.0, 0.0], (EAST, NORTH, UPWARDS)),
        # yaw of 90 degrees: clockwise from above in NED, counter-clockwise in the others
        ("NED", [HALF, 0.0, 0.0, HALF], (EAST, -NORTH, -UPWARDS)),
        ("NWU", [HALF, 0.0, 0.0, HALF], (-EAST, -NORTH, UPWARDS)),
        ("ENU", [HALF, 0.0, 0.0, HALF], (NORTH, -EAST, UPWARDS)),
        # pitch of 90 degrees: nose up in NED, nose down where z is up
        ("NED", [HALF, 0.0, HALF, 0.0], (UPWARDS, EAST, NORTH)),
        ("ENU", [HALF, 0.0, HALF, 0.0], (-UPWARDS, NORTH, EAST)),
        # roll of 90 degrees: right side down in NED
        ("NED", [HALF, HALF, 0.0, 0.0], (NORTH, -UPWARDS, -EAST)),
    ],
)
def test_known_quarter_turns_point_where_they_should(frame, q, axes):
    np.testing.assert_allclose(scene_rotation(np.array(q), frame).T, np.array(axes), atol=1e-12)


def test_scene_rotation_is_a_rotation_whatever_the_sign_of_the_quaternion():
    for q in Rotation.random(20, random_state=1).as_quat()[:, [3, 0, 1, 2]]:
        matrix = scene_rotation(q, "NED")
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
        np.testing.assert_allclose(matrix, scene_rotation(-q, "NED"), atol=1e-12)


@pytest.mark.parametrize("side", list(UP))
def test_side_to_lay_up_points_up(side):
    from imufit.studio.body import side_rotation

    matrix = side_rotation(side)
    np.testing.assert_allclose(matrix @ UP[side], UPWARDS, atol=1e-12)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@pytest.mark.parametrize("frame", ["NED", "NWU", "ENU"])
def test_the_picture_of_a_device_and_the_guide_name_the_same_side(frame):
    """The guide goes by the readings, the picture by the attitude: in every frame the side that is named points up."""
    log = simulate("six_sides", {}, 1, duration=30.0, rate=20.0, frame=frame).to_log()
    guide, named = PoseGuide(), []
    for t, acc, gyr, q in zip(log.t, log.acc, log.gyr, log.ref_q, strict=True):
        advice = guide.step(t, acc, gyr)
        if advice.state == "held":
            named.append(advice.side)
            np.testing.assert_allclose(scene_rotation(q, frame) @ UP[advice.side], UPWARDS, atol=0.02)
    assert named[0] == "+z"
    assert len(set(named)) >= 4


@pytest.fixture(scope="module")
def log():
    return simulate("handheld", {"gyr.bias": {"x": 0.02, "y": -0.01, "z": 0.03}}, 3, 40.0).to_log()


def test_measured_and_predicted_follow_the_reference(log):
    reference, measured = reference_track(log), measured_track(log)
    fit = SensorModel(["gyr.bias"]).fit(log)
    predicted = predicted_track(fit, log)
    assert (reference.name, measured.name, predicted.name) == ("reference", "measured", "predicted")
    for time in (10.0, 25.0, 39.0):
        truth = log.ref_q[np.searchsorted(log.t, time, side="right") - 1]
        assert error_deg(reference.at(time), truth) < 1e-5
        assert error_deg(measured.at(time), truth) < 5.0
        assert error_deg(predicted.at(time), measured.at(time)) < 3.0


def test_gyro_alone_is_off_as_its_bias_predicts(log):
    """The model knows the bias, so the attitude of predicted readings drifts as the measured one does."""
    fit = SensorModel(["gyr.bias"]).fit(log)
    reference = reference_track(log)
    alone = [measured_track(log, Gyro), predicted_track(fit, log, chosen=Gyro)]
    ideal = predicted_track(SensorModel().fit(log), log, chosen=Gyro)
    off = [error_deg(track.at(39.0), reference.at(39.0)) for track in (*alone, ideal)]
    assert off[0] > 20.0
    assert off[1] == pytest.approx(off[0], rel=0.1)
    assert off[2] < 5.0


def test_long_log_is_thinned_and_gaps_are_not_played(log, monkeypatch):
    monkeypatch.setattr(attitudes, "KEPT", 100)
    track = reference_track(log)
    assert 90 <= track.t.size <= 110
    assert track.at(-1.0) is None
    late = log.t.copy()
    late[2000:] += 100.0
    gap = reference_track(Log(late, gyr=log.gyr, ref_q=log.ref_q))
    assert gap.at(10.0) is not None
    assert gap.at(60.0) is None
    unknown = log.ref_q.copy()
    unknown[:1000] = np.nan
    assert reference_track(Log(log.t, gyr=log.gyr, ref_q=unknown)).at(5.0) is None


def test_log_without_reference_or_needed_sensor_has_no_such_track(log):
    assert reference_track(Log(log.t, gyr=log.gyr)) is None
    assert measured_track(Log(log.t, gyr=log.gyr)) is None
