"""A one-axis rig that does not go where it is told to, and a table that is not level."""

from __future__ import annotations

import pytest
from imufit import Log, SensorModel, ladder
from imufit.diagnosing import diagnose
from imufit.errors import InputError
from imufit.lab.simulate import Noise, simulate
from scipy.spatial.transform import Rotation

DURATION = 80.0


def fitted(effect: str, parameters: dict[str, float], **options: object) -> dict[str, tuple[float, float]]:
    """Parameters and standard errors of an effect, fitted to a log that it was physically put into."""
    log = simulate("tilt", {effect: parameters}, 11, DURATION, **options).to_log()  # type: ignore[arg-type]
    fit = SensorModel([effect]).fit(log)
    return {p.name: (p.value, p.standard_error) for p in fit.parameters}


@pytest.mark.parametrize(
    ("effect", "truth"),
    [
        ("rig.backlash", {"width": 4e-3}),
        ("rig.flexure", {"k": -6e-3}),
        ("rig.periodic", {"a": 1e-3, "b": -2e-3, "N": 13.0}),
        ("ref.tilt", {"x": 0.01, "y": -0.02}),
    ],
)
@pytest.mark.parametrize("axis", ["x", "y"])
def test_what_was_put_into_the_motion_comes_back(effect: str, truth: dict[str, float], axis: str) -> None:
    found = fitted(effect, truth, rig_axis=axis, frame="ENU" if axis == "y" else "NED")
    for name, value in truth.items():
        estimate, error = found[name]
        assert abs(estimate - value) <= max(4.0 * error, 1e-9 * abs(value)), (name, found)
    assert "N" not in truth or found["N"] == (13.0, 0.0)


def test_play_is_named_as_backlash_not_as_delay_and_the_ladder_ends_at_the_noise() -> None:
    log = simulate("tilt", {"rig.backlash": {"width": 3e-3}}, 5, DURATION).to_log()
    result = ladder(log)
    assert [step.effect for step in result.steps] == ["rig.backlash"]
    assert result.ratio_end < 1.05 < result.ratio_start


def test_period_of_a_gear_is_told_with_the_answer() -> None:
    log = simulate("tilt", {"rig.periodic": {"a": 1e-3, "b": 1e-3, "N": 17.0}}, 6, DURATION).to_log()
    answer = diagnose(SensorModel().fit(log))
    assert (answer.verdict, answer.best) == ("missing", "rig.periodic")
    best = answer.candidates[0].to_dict()["parameters"]
    assert best["N"]["value"] == 17.0
    assert best["a"]["value"] == pytest.approx(1e-3, rel=0.1)


def test_mount_of_the_sensor_on_the_rig_makes_no_difference() -> None:
    """The angle counts from the rig's zero, wherever the reference attitude stands there."""
    simulation = simulate("tilt", {"rig.flexure": {"k": 8e-3}}, 3, DURATION, sensors=("acc", "gyr"))
    turned = Rotation.from_euler("xyz", [0.4, -0.3, 1.0])
    q = (turned * Rotation.from_quat(simulation.ref_q[:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]
    upright = simulation.to_log()
    log = Log.from_arrays(
        simulation.t, gyr=simulation.gyr, reference=q, ref_angle=simulation.ref_angle, rig_axis="x", frame="NED"
    )
    k = SensorModel(["rig.flexure"]).fit(log).parameters[0]
    whole = SensorModel(["rig.flexure"]).fit(upright).parameters[0]
    assert abs(k.value - 8e-3) < 4.0 * k.standard_error
    assert abs(whole.value - 8e-3) < 4.0 * whole.standard_error


def test_log_without_a_rig_has_no_rig_effects() -> None:
    log = simulate("handheld", {}, 2, 40.0).to_log()
    with pytest.raises(InputError, match="rig_axis"):
        SensorModel(["rig.backlash"]).fit(log)


def test_tilted_table_is_no_bias_where_the_reference_has_a_position() -> None:
    log = simulate("handheld", {"ref.tilt": {"x": 0.02, "y": 0.01}}, 4, DURATION).to_log()
    result = ladder(log)
    assert [step.effect for step in result.steps] == ["ref.tilt"]
    assert result.ratio_end == pytest.approx(1.0, abs=0.03)


def test_play_within_the_noise_of_the_reference_does_no_harm() -> None:
    """Reversals that are noise of the encoder are no reversals of the drive."""
    noise = Noise(attitude_deg=0.05)
    log = simulate("tilt", {}, 8, DURATION, noise=noise).to_log()
    assert diagnose(SensorModel().fit(log)).verdict == "adequate"
