"""Two recordings of one motion on two clocks: simulated by `join_pairs`, which shares no code with imufit, and real."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit.cli.app import main
from imufit.errors import InputError
from imufit.joining import join_as_found, with_attitude
from imufit.log import Log, LogStream, read
from join_pairs import Pair, pair, repetitive, unrelated
from recording import recording
from scipy.spatial.transform import Rotation

FRESH = (3001, 3002, 3003, 3006, 3008, 3010)
"""Seeds of pairs; `benches/join.py` takes hundreds of others."""


def sensor_of(one: Pair) -> Log:
    return Log(t=one.t, acc=one.acc, gyr=one.gyr)


def reference_of(one: Pair) -> Log:
    log = Log(t=one.ref_t, ref_q=one.ref_q, ref_p=one.ref_p)
    return replace(log, metadata=replace(log.metadata, frame="ENU"))


def tolerance(one: Pair) -> float:
    """Two milliseconds and a tenth of the reference's interval, s."""
    return 0.002 + 0.1 * float(np.median(np.diff(one.ref_t)))


def test_the_lag_of_a_pair_is_found_in_the_middle_of_what_both_saw_or_it_is_refused() -> None:
    refused = 0
    for seed in FRESH:
        one = pair(seed)
        try:
            joined = imufit.join(sensor_of(one), reference_of(one))
        except InputError:
            refused += 1
            continue
        late = one.ref_t[0] - one.lag
        middle = 0.5 * (max(one.t[0], late) + min(one.t[-1], one.ref_t[-1] - one.lag)) - late
        found, truth = joined.lag + joined.skew * middle, one.lag + one.skew * middle
        assert found == pytest.approx(truth, abs=tolerance(one) + 3.0 * joined.lag_error), seed
    assert refused <= 1


@pytest.mark.parametrize("seed", [3101, 3102])
def test_a_motion_that_repeats_itself_is_called_ambiguous(seed: int) -> None:
    one = repetitive(seed)
    with pytest.raises(InputError, match="the lag is ambiguous"):
        imufit.join(sensor_of(one), reference_of(one))
    known = imufit.join(sensor_of(one), reference_of(one), lag=one.lag)
    assert known.lag == pytest.approx(one.lag, abs=1e-9)
    assert known.correlation > 0.9


@pytest.mark.parametrize("seed", [3201, 3202, 3203])
def test_recordings_of_different_motions_are_not_joined(seed: int) -> None:
    one = unrelated(seed)
    with pytest.raises(InputError, match=r"ambiguous|not those of one motion|in common"):
        imufit.join(sensor_of(one), reference_of(one))


@pytest.mark.parametrize("name", ["05_undisturbed_slow_rotation_with_breaks_B", "16_undisturbed_fast_translation_B"])
def test_a_lag_put_into_a_recording_is_found(name: str) -> None:
    log = imufit.read(recording(f"broad/{name}.parquet"))
    assert log.ref_q is not None
    assert log.gyr is not None
    turn = Rotation.from_euler("z", 90, degrees=True)
    there = np.isfinite(log.ref_q).all(axis=1)
    ref_q = (Rotation.from_quat(log.ref_q[there][:, [1, 2, 3, 0]]) * turn).as_quat()[:, [3, 0, 1, 2]]
    sensor = Log(t=log.t, gyr=log.gyr, acc=log.acc)
    plain = imufit.join(sensor, Log(t=log.t[there], ref_q=log.ref_q[there]))
    late = imufit.join(sensor, Log(t=log.t[there] + 71.25, ref_q=ref_q))
    assert late.lag - plain.lag == pytest.approx(71.25, abs=0.002)
    # The marker axes are turned by 90 degrees about z: the x of the sensor lies on minus their y.
    np.testing.assert_allclose(late.mount, plain.mount @ turn.as_matrix(), atol=1e-12)
    assert late.correlation > 0.99


def test_the_joined_log_has_all_rows_of_both_and_gaps_stay_open() -> None:
    one = pair(3001)
    joined = imufit.join(sensor_of(one), reference_of(one)).log
    exact = joined.covariates["ref_exact"] == 1.0
    assert joined.gyr is not None
    assert joined.ref_q is not None
    assert np.isfinite(joined.gyr[:, 0]).sum() == np.isfinite(one.gyr[:, 0]).sum()
    assert np.isfinite(joined.ref_q[exact]).all()
    assert (np.diff(joined.t) > 0.0).all()
    assert joined.metadata.frame == "ENU"
    t = joined.t[exact]
    gap = int(np.argmax(np.diff(t)))
    if t[gap + 1] - t[gap] > 5.0 * float(np.median(np.diff(t))):
        within = (joined.t > t[gap]) & (joined.t < t[gap + 1])
        assert np.isnan(joined.ref_q[within]).all()


def test_attitudes_are_read_as_others_write_them() -> None:
    rng = np.random.default_rng(5)
    turns = Rotation.random(20, random_state=rng)
    q = turns.as_quat()[:, [3, 0, 1, 2]]
    yaw, pitch, roll = turns.as_euler("ZYX", degrees=True).T
    matrix = {f"m{k}": turns.as_matrix().reshape(-1, 9)[:, k] for k in range(9)}
    back = turns.inv().as_quat()
    columns = {"yaw": yaw, "pitch": pitch, "roll": roll, **matrix, **{f"q{k}": back[:, k] for k in range(4)}}
    log = Log(t=np.arange(20.0), covariates=columns)
    for made in (
        with_attitude(log, "euler-ZYX", ("yaw[deg]", "pitch[deg]", "roll[deg]")),
        with_attitude(log, "matrix", tuple(matrix)),
        with_attitude(log, "quaternion", ("q3", "q0", "q1", "q2"), inverse=True),
    ):
        assert made.ref_q is not None
        same = np.abs(np.sum(made.ref_q * q, axis=1))
        np.testing.assert_allclose(same, 1.0, atol=1e-9)
    tilted = with_attitude(log, "angle-x", ("roll[deg]",))
    assert tilted.ref_q is not None
    np.testing.assert_allclose(tilted.ref_q[:, 1], np.sin(np.deg2rad(roll) / 2.0), atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "columns", "said"),
    [
        ("euler", ("a", "b", "c"), "not a kind of attitude"),
        ("euler-ZYX", ("a", "b"), "has 3 columns, 2 were named"),
        ("euler-ZYX", ("a", "b", "yaw"), "the file has no such column"),
        ("quaternion", ("a", "b", "c", "a"), "does not have unit length in 3 of 3 rows"),
        ("matrix", ("a",) * 9, "not a rotation"),
    ],
)
def test_what_is_not_an_attitude_is_refused(kind: str, columns: tuple[str, ...], said: str) -> None:
    log = Log(t=np.arange(3.0), covariates={name: np.full(3, 2.0) for name in "abc"})
    with pytest.raises(InputError, match=said):
        with_attitude(log, kind, columns)


def test_the_command_joins_euler_angles_of_another_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from imufit.cli.app import main

    one = pair(3002)
    sensor_of(one).write(tmp_path / "sensor.csv")
    there = np.isfinite(one.ref_q).all(axis=1)
    angles = Rotation.from_quat(one.ref_q[there][:, [1, 2, 3, 0]]).as_euler("ZYX", degrees=True)
    rows = np.column_stack((one.ref_t[there], angles))
    np.savetxt(tmp_path / "mocap.csv", rows, delimiter=",", header="t,yaw,pitch,roll", comments="")
    arguments = [str(tmp_path / "sensor.csv"), str(tmp_path / "mocap.csv"), "-o", str(tmp_path / "log.parquet")]
    more = ["--attitude", "euler-ZYX:yaw[deg],pitch[deg],roll[deg]", "--frame", "ENU", "--json", "-"]
    assert main(["join", *arguments, *more]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["lag"] == pytest.approx(one.lag, abs=0.01)
    assert imufit.read(tmp_path / "log.parquet").n == answer["rows"]
    assert main(["join", *arguments[::-1][2:], *arguments[2:]]) == 2
    assert "the file has no sensor" in capsys.readouterr().err


def test_a_phone_and_cameras_in_their_native_files_become_one_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = recording("phone_qualisys/native/Thibaud_Nexus5_NoDist_Texting")
    out = tmp_path / "joined.parquet"
    assert main(["join", str(folder), str(folder / "qualisys.mat"), "--frame", "ENU", "-o", str(out)]) == 0
    assert "attitude read as matrix of" in capsys.readouterr().out
    found = read(out)
    assert found.metadata.extra["lag"] == pytest.approx(0.952, abs=0.005)
    assert found.ref_q is not None
    # The phone was held flat, within three degrees: neither units nor axes explain its 400 uT of iron.
    answer = imufit.diagnose(found[: found.n // 2])
    assert (answer.best, answer.data_faults) == ("mag.hard_iron", ())
    # Without the frame the joined log says that gravity shows another one.
    assert main(["join", str(folder), str(folder / "qualisys.mat"), "-o", str(out)]) == 0
    assert "state --frame ENU" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("kind", ["scalar last", "inverse", "degrees"])
def test_columns_of_an_attitude_are_read_as_the_rates_show(kind: str) -> None:
    one = pair(3001)
    q = one.ref_q[np.isfinite(one.ref_q).all(axis=1)]
    t = one.ref_t[np.isfinite(one.ref_q).all(axis=1)]
    if kind == "degrees":
        angles = np.degrees(Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_euler("ZYX"))
        columns = {f"head_{name}": angles[:, k] for k, name in enumerate(("yaw", "pitch", "roll"))}
    else:
        numbers = q * [1, -1, -1, -1] if kind == "inverse" else q[:, [1, 2, 3, 0]]
        columns = {f"body.rotation[{k}]": numbers[:, k] for k in range(4)}
    log, bare = sensor_of(one), Log(t=t, covariates=columns)
    found = join_as_found(log, bare, None, None)
    declared = imufit.join(log, Log(t=t, ref_q=q))
    assert found.lag == pytest.approx(declared.lag, abs=1e-6)
    assert ("reference to body" in found.log.notes[-1]) == (kind == "inverse")


def middle_error(one: Pair, ref_t: np.ndarray, skew: float, joined: imufit.joining.Joined) -> float:
    """Error of the lag in the middle of what both saw, s."""
    late = ref_t[0] - one.lag
    length = (ref_t[-1] - ref_t[0]) * (1.0 - skew)
    middle = 0.5 * (max(one.t[0], late) + min(one.t[-1], late + length)) - late
    return float(joined.lag + joined.skew * middle - one.lag - skew * middle)


@pytest.mark.parametrize(("seed", "fast"), [(3001, 0.008), (3006, -0.009), (3010, 0.003)])
def test_clocks_that_are_a_percent_apart_are_joined(seed: int, fast: float) -> None:
    one = pair(seed)
    ref_t = one.ref_t[0] + (one.ref_t - one.ref_t[0]) * (1.0 + fast)
    skew = 1.0 - (1.0 - one.skew) / (1.0 + fast)
    joined = imufit.join(sensor_of(one), replace(reference_of(one), t=ref_t))
    assert abs(middle_error(one, ref_t, skew, joined)) < tolerance(one) + 3.0 * joined.lag_error
    assert joined.skew == pytest.approx(skew, abs=5e-4)


def test_the_lag_of_a_slow_motion_scatters_as_little_as_the_noise_allows() -> None:
    step, length, noise, shake, off = 0.01, 40.0, 0.002, 0.2, np.deg2rad(0.4)
    t = np.arange(0.0, length, step)
    rng = np.random.default_rng(11)
    frequency = rng.uniform(0.1, 0.4, (12, 3))
    phase = rng.uniform(-np.pi, np.pi, (12, 3))
    size = 0.05 / (2.0 * np.pi * frequency)
    waves = 2.0 * np.pi * frequency * t[:, None, None] + phase
    attitude = Rotation.from_rotvec(np.sum(size * np.sin(waves), axis=1))
    rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / step
    # Cramer-Rao: the derivative of the attitude by the lag is the rate; white noise of the gyroscope becomes 1/f^2.
    power = np.sum(np.abs(np.fft.rfft(rate, axis=0)) ** 2, axis=1)[1:] * step**2
    turning = 2.0 * np.pi * np.fft.rfftfreq(len(rate), step)[1:]
    bound = (2.0 * np.sum(power / (off**2 * step + noise**2 * step / turning**2)) / length) ** -0.5
    errors = []
    for _ in range(16):
        vibration = shake * np.sin(2.0 * np.pi * 31.0 * t[:, None] + rng.uniform(-np.pi, np.pi, 3))
        gyr = np.vstack((rate, rate[-1:])) + vibration + noise * rng.normal(size=(len(t), 3))
        # A mean rate is that of the middle of the step.
        seen = attitude * Rotation.from_rotvec(off * rng.normal(size=(len(t), 3)))
        joined = imufit.join(
            Log(t=t + 0.5 * step, gyr=gyr), Log(t=t + 3.0, ref_q=seen.as_quat()[:, [3, 0, 1, 2]]), skew=0.0
        )
        errors.append(joined.lag - 3.0)
    # Of sixteen normal errors the root of the mean square exceeds 1.6 times the standard error once in 1500 cases.
    assert np.sqrt(np.mean(np.square(errors))) < 1.6 * bound


@pytest.mark.parametrize("seed", [41004, 41010, 41015])
def test_positions_without_an_attitude_are_joined_by_the_length_of_the_specific_force(seed: int) -> None:
    one = pair(seed)
    reference = replace(reference_of(one), ref_q=None)
    joined = imufit.join(sensor_of(one), reference)
    assert abs(middle_error(one, one.ref_t, one.skew, joined)) < tolerance(one) + 3.0 * joined.lag_error
    assert joined.mount is None
    assert joined.log.ref_q is None
    assert joined.log.ref_p is not None
    assert joined.to_dict()["compared"] == "forces"
    exact = joined.log.covariates["ref_exact"] == 1.0
    assert np.isfinite(joined.log.ref_p[exact]).all()
    # The vertical of positions cannot be the other way round.
    upside_down = replace(reference, metadata=replace(reference.metadata, frame="NED"))
    with pytest.raises(InputError, match="the z axis of the positions points up") as refused:
        imufit.join(sensor_of(one), upside_down)
    assert "frame='ENU'" in str(refused.value)
    assert "--frame ENU" in str(refused.value.shell_remedy)


def test_positions_of_another_motion_are_refused() -> None:
    one, other = pair(41004), pair(41010)
    with pytest.raises(InputError, match=r"ambiguous|not those of one motion|seconds of motion|opposite direction"):
        imufit.join(sensor_of(one), replace(reference_of(other), ref_q=None))


@pytest.mark.parametrize("seed", [31000, 31025])
def test_gravity_settles_a_mount_of_which_the_rates_show_one_axis(seed: int) -> None:
    one = pair(seed)
    assert one.motion == "tilt"
    joined = imufit.join(sensor_of(one), reference_of(one))
    assert joined.by_gravity
    assert joined.mount is not None
    assert (Rotation.from_matrix(joined.mount.T) * one.mount).magnitude() < np.deg2rad(15.0)
    bare = imufit.join(Log(t=one.t, gyr=one.gyr), reference_of(one))
    assert not bare.by_gravity
    assert "nothing shows how the sensor is turned" in bare.remarks[0]


@pytest.mark.parametrize("axis", [(0.0, -1.0, 0.0), (0.6, 0.0, 0.8)])
def test_the_axis_of_an_encoder_is_found(axis: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(7)
    t = np.arange(0.0, 60.0, 0.01)
    targets = np.repeat(rng.uniform(-1.5, 1.5, 40), 150)[: len(t)]
    angle = np.convolve(np.pad(targets, 50, mode="edge"), np.hanning(101) / np.hanning(101).sum(), "valid")
    upright = Rotation.from_euler("xyz", [0.3, -0.4, 1.0])
    attitude = upright * Rotation.from_rotvec(np.outer(angle, axis))
    gyr = np.outer(np.gradient(angle, t), axis) + rng.normal(0.0, 0.003, (len(t), 3))
    acc = attitude.apply([0.0, 0.0, 9.80665], inverse=True) + rng.normal(0.0, 0.03, (len(t), 3))
    reference = Log(t=t[500:5500] + 12.5, covariates={"encoder": np.rad2deg(angle[500:5500])})
    reference = replace(reference, metadata=replace(reference.metadata, frame="ENU"))
    joined = join_as_found(Log(t=t, acc=acc, gyr=gyr), reference, None, None)
    assert joined.lag == pytest.approx(12.5, abs=0.002)
    assert joined.axis is not None
    np.testing.assert_allclose(joined.axis, axis, atol=0.01)
    known = joined.log.has_reference
    assert joined.log.ref_q is not None
    assert joined.log.acc is not None
    force = Rotation.from_quat(joined.log.ref_q[known][:, [1, 2, 3, 0]]).apply(joined.log.acc[known])
    mean = np.nanmean(force, axis=0)
    np.testing.assert_allclose(mean / np.linalg.norm(mean), [0.0, 0.0, 1.0], atol=0.02)
    on_axis = max(np.abs(axis)) == 1.0
    assert joined.log.metadata.rig_axis == ("y" if on_axis else None)
    if on_axis:
        assert joined.log.ref_angle is not None
        expected = -np.interp(joined.log.t[known], t, angle)
        np.testing.assert_allclose(joined.log.ref_angle[known], expected, atol=0.01)


def test_a_known_lag_that_leaves_nothing_in_common_is_refused() -> None:
    one = pair(3001)
    with pytest.raises(InputError, match="less than a few seconds of motion"):
        imufit.join(sensor_of(one), reference_of(one), lag=one.lag + 5000.0)


@pytest.mark.parametrize("name", ["time", "Time", "t_s", "timestamp"])
def test_the_time_of_a_reference_is_found_by_its_name(name: str, tmp_path: Path) -> None:
    t = np.arange(300) * 0.01
    rows = np.column_stack([t, np.ones(300), np.zeros((300, 3))])
    np.savetxt(tmp_path / "ref.csv", rows, delimiter=",", header=f"{name},qw,qx,qy,qz", comments="")
    reference = LogStream(tmp_path / "ref.csv", bare=True).read()
    assert reference.duration == pytest.approx(2.99)
    assert set(reference.covariates) == {"qw", "qx", "qy", "qz"}


def test_a_reference_without_a_known_time_names_the_option_of_its_own(tmp_path: Path) -> None:
    rows = np.column_stack([np.arange(300) * 0.01, np.ones(300)])
    np.savetxt(tmp_path / "ref.csv", rows, delimiter=",", header="c,qw", comments="")
    with pytest.raises(InputError, match="column t is missing") as caught:
        LogStream(tmp_path / "ref.csv", bare=True)
    assert "--reference-map 't=row[100Hz]'" in str(caught.value.shell_remedy)
