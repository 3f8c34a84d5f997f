"""A simulated log: motion, environment, effects, noise, in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from imufit.lab.simulate.courses import Course
from imufit.lab.simulate.environment import GRAVITY, Environment, stream
from imufit.lab.simulate.injections import injection, order
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.noise import Noise, noisy_attitude
from imufit.lab.simulate.scenarios import LABELS, SCENARIOS, pose_labels
from imufit.lab.simulate.sealed import Truth
from imufit.lab.simulate.sensor import SENSORS, Setup, outputs
from imufit.lab.simulate.study import Study
from imufit.lab.simulate.truth import Trajectory, quaternion_from_matrix
from imufit.log import Log


@dataclass(frozen=True, repr=False)
class Simulation:
    """A simulated log with what is known of it.

    Attributes
    ----------
    t : (n,), s.
    acc, gyr, mag : (n, 3), m/s^2, rad/s, uT; None where the log has no such sensor. A slow one has NaN between samples.
    temp : (n,), degC, or None.
    ref_q : (n, 4), scalar first, body to reference frame.
    ref_p : (n, 3), m, or None where the body does not translate.
    ref_angle : (n,), rad, commanded angle of a one-axis rig, or None.
    pose : (n,) of text, empty outside a pose, or None.
    covariates : (n,) each.
    metadata : frame, gravity, mag_reference, rig_axis, sensor, noise: whichever apply.
    trajectory : the motion that the reference reports; `trajectory.at(t)` is exact.
    noise : for each sensor, (n, 3), its readings less what they would be without noise, rounding and shaking.
    truth : what was injected. None of these three gets into the log.
    """

    t: Array
    acc: Array | None
    gyr: Array | None
    mag: Array | None
    temp: Array | None
    ref_q: Array
    ref_p: Array | None
    ref_angle: Array | None
    pose: npt.NDArray[np.str_] | None
    covariates: Mapping[str, Array]
    metadata: Mapping[str, Any]
    trajectory: Trajectory
    noise: Mapping[str, Array]
    truth: Truth

    def to_log(self) -> Log:
        """Return the log as a user would have it: rows and metadata, without what was injected."""
        return Log.from_arrays(
            self.t,
            acc=self.acc,
            gyr=self.gyr,
            mag=self.mag,
            temp=self.temp,
            reference=self.ref_q,
            ref_p=self.ref_p,
            ref_angle=self.ref_angle,
            pose=None if self.pose is None else [label or None for label in self.pose.tolist()],
            covariates=self.covariates,
            **self.metadata,
        )

    def _repr_html_(self) -> str:
        return self.to_log().table_html(repr(self))

    def __repr__(self) -> str:
        return f"Simulation({len(self.t)} rows of {self.truth.scenario}; to_log() is its log, truth what was put in)"


def simulate(
    scenario: str,
    effects: Mapping[str, Mapping[str, float] | None] | None = None,
    seed: int = 0,
    duration: float = 120.0,
    rate: float = 100.0,
    *,
    size: str | float = "medium",
    frame: str = "NED",
    sensors: Sequence[str] | None = None,
    covariates: Sequence[str] = (),
    courses: Mapping[str, Course] | None = None,
    noise: Noise | None = None,
    realistic: bool = False,
    rig_axis: str = "x",
    noise_in_metadata: bool = True,
) -> Simulation:
    """Simulate a log.

    Parameters
    ----------
    scenario : one of `SCENARIOS`.
    effects : names of effects with their parameters (SI units); None instead of parameters draws them with `size`.
    seed : of everything random. The motion, noise and environment of a seed do not depend on the effects.
    duration, rate : s, Hz.
    size : "large", "medium", "small" or a number: root mean square of a drawn effect over its sensor's white noise.
    frame : reference frame: "NED", "ENU" or "NWU".
    sensors : which of "acc", "gyr", "mag", "temp" the log has; default those of the scenario.
    covariates : further columns, such as "motor_current" and "vbat"; those that an effect needs are there anyhow.
    courses : for "temp" or a covariate the course that it takes, instead of one by chance.
    noise : random errors; default those of the scenario: white noise, on a machine tool an MPU6050's.
    realistic : whether the default is `Noise.realistic()` instead.
    rig_axis : axis of a one-axis rig: "x", "y" or "z".
    noise_in_metadata : whether the metadata states the white noise.

    Returns
    -------
    Simulation

    Raises
    ------
    ValueError
        For an unknown scenario, effect, parameter, frame or sensor, or an effect that the log cannot show.
    """
    chosen = dict(effects or {})
    study = Study(
        scenario,
        list(chosen),
        seed,
        duration,
        rate,
        frame=frame,
        sensors=sensors,
        covariates=covariates,
        courses=courses,
        noise=noise,
        realistic=realistic,
        rig_axis=rig_axis,
    )
    parameters = {
        name: study.draw(name, size) if given is None else study.complete(name, given) for name, given in chosen.items()
    }
    sizes = {name: study.scale.ratio(name, p) for name, p in parameters.items()}
    truth = Truth(scenario, seed, parameters, sizes, size if isinstance(size, str) and None in chosen.values() else "")
    return _recorded(study, truth, rig_axis, noise_in_metadata)


def _recorded(study: Study, truth: Truth, rig_axis: str, noise_in_metadata: bool) -> Simulation:
    """Inject the effects of `truth` and record the log."""
    noise, rows, t, seed = study.noise, study.rows, study.rows.t, study.seed
    kind, trajectory, frame = SCENARIOS[truth.scenario], study.trajectory, study.run.frame
    sampled = study.scale.sampled
    setup = Setup.ideal(trajectory, study.environment)
    for name in sorted(truth.effects, key=order):
        injection(name).apply(setup, truth.effects[name], study.run)
    sensors: dict[str, Array | None] = dict.fromkeys(SENSORS)
    errors: dict[str, Array] = {}
    rates = rows.kinematics(setup.trajectory, 0.0).omega
    for name, output in outputs(setup, rows, tuple(sampled)).items():
        sensor, rng = setup.sensors[name], stream(seed, f"noise {name}")
        digits = sensor.digits(output, noise.sensor(name), rng, t, rates)
        shaking = study.environment.vibration if name == "acc" else None
        calm = sensor.limited(output) - (0.0 if shaking is None else shaking.at(t - sensor.delay))
        errors[name] = np.where(sampled[name][:, None], digits - calm, np.nan)
        sensors[name] = np.where(sampled[name][:, None], digits, np.nan)

    reference = rows.recorded(trajectory, setup.recorder)
    rng = stream(seed, "noise of the reference")
    attitude = noisy_attitude(reference.rotation, noise, rng)
    position = reference.position + noise.position * rng.standard_normal((t.size, 3))
    joint, now = trajectory.rig_joint, rows.kinematics(trajectory, 0.0)
    return Simulation(
        t=t,
        acc=sensors["acc"],
        gyr=sensors["gyr"],
        mag=sensors["mag"],
        temp=_temperature(study.environment, noise, seed, t) if "temp" in study.names else None,
        ref_q=quaternion_from_matrix(attitude),
        ref_p=position if kind.position else None,
        ref_angle=None if joint is None else setup.recorder.averaged(lambda then: joint.angle.at(then).value, t),
        pose=np.array([*LABELS, ""])[pose_labels(frame, now.rotation, now.omega)] if kind.poses else None,
        covariates={name: course.at(t) for name, course in study.environment.covariates.items()},
        metadata=_metadata(study, truth.scenario, rig_axis if kind.rig else None, noise_in_metadata),
        trajectory=trajectory,
        noise=errors,
        truth=truth,
    )


def _temperature(environment: Environment, noise: Noise, seed: int, t: Array) -> Array:
    shown = environment.temperature.at(t) + noise.temperature * stream(seed, "noise temp").standard_normal(t.size)
    step = noise.temperature_resolution
    return shown if step == 0.0 else np.round(shown / step) * step


def _metadata(study: Study, scenario: str, rig_axis: str | None, noise_in_metadata: bool) -> dict[str, Any]:
    frame, names = study.run.frame, study.names
    data: dict[str, Any] = {"frame": frame, "gravity": GRAVITY, "sensor": f"simulated, scenario {scenario}"}
    if "mag" in names:
        data["mag_reference"] = study.environment.field.tolist()
    if rig_axis is not None:
        data["rig_axis"] = rig_axis
    if noise_in_metadata:
        data["noise"] = {name: white for name, white in study.noise.white().items() if name in names}
    return data
