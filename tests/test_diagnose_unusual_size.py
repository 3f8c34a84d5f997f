"""Effects far beyond their typical size: named if they explain everything, and not if something is left."""

import imufit
import numpy as np
import pandas as pd
import pytest
from imufit import Log, SensorModel
from imufit.lab import simulate


def made(**size: float) -> Log:
    effects = {"acc.scale_temperature": dict.fromkeys("xyz", 0.0) | size}
    return simulate.simulate("handheld", effects, 4, 60.0).to_log()


def test_a_drift_thirty_times_as_large_as_usual_is_named():
    answer = SensorModel().fit(made(x=0.006, y=-0.006)).diagnose()
    assert (answer.verdict, answer.best) == ("missing", "acc.scale_temperature")
    assert (answer.candidates[0].status, answer.unexplained) == ("significant", ())


def test_one_three_hundred_times_as_large_is_not():
    answer = SensorModel().fit(made(x=0.06)).diagnose()
    assert answer.best is None


@pytest.mark.parametrize("seed", [1, 2])
def test_what_only_looks_like_it_is_not(seed):
    log = made(x=0.006, y=0.004)
    table = log.to_dataframe()
    # A product of temperature and force that turns round in the middle of the log.
    later = table["t"] > table["t"].median()
    rng = np.random.default_rng(seed)
    plain = simulate.simulate("handheld", {}, 4, 60.0).to_log().to_dataframe()
    for axis in "xyz":
        drift = table[f"acc_{axis}"] - plain[f"acc_{axis}"]
        table[f"acc_{axis}"] = (
            plain[f"acc_{axis}"] + np.where(later, -drift, drift) + 1e-3 * rng.normal(size=len(table))
        )
    answer = SensorModel().fit(Log.from_dataframe(table, log.metadata)).diagnose()
    assert answer.best != "acc.scale_temperature"


def test_beside_what_cannot_be_so_large_the_effect_of_another_sensor_is_named_and_none_besides():
    effects = {"acc.scale": {"x": 0.6, "y": 0.5}, "mag.hard_iron": {"x": 15.0, "y": -10.0, "z": 20.0}}
    found = imufit.ladder(simulate.simulate("handheld", effects, 4, 60.0).to_log())
    assert (found.verdict, [step.effect for step in found.steps]) == ("unknown", ["mag.hard_iron"])
    # The rest is stated by the effect that it looks like, and on the channels of the accelerometer.
    assert "acc.scale is larger than sensors have it" in found.sentence
    first = found.diagnosis.unexplained[0]
    assert (first.channel, first.covariate) in {(f"acc_{axis}", f"f_{axis}") for axis in "xyz"}


def test_readings_without_any_noise_have_an_answer(tmp_path):
    # Three attitudes, each held to the last digit: the magnetometer's noise is that of rounding.
    poses = pd.DataFrame(
        {
            **{"acc_x": [-5.365, -6.996, 1.26], "acc_y": [-7.025, -6.884, 6.755], "acc_z": [-4.318, -0.227, -7.015]},
            **{"gyr_x": [-0.001, 1.098, 0.001], "gyr_y": [0.001, 0.0, -0.001], "gyr_z": [0.0, 0.001, -2.45]},
            **{"mag_x": [39.933, 19.042, 2.893], "mag_y": [19.234, 42.541, -44.35], "mag_z": [18.769, 11.833, 19.081]},
            **{"ref_qw": [0.807, -0.08, 0.763], "ref_qx": [0.5, 0.441, -0.345]},
            **{"ref_qy": [-0.176, 0.542, -0.154], "ref_qz": [0.261, 0.711, 0.525], "temp": [25.746, 26.858, 26.323]},
        }
    )
    held = poses.loc[np.repeat([0, 1, 2], [100, 100, 40])].reset_index(drop=True)
    held.insert(0, "t", 0.05 * np.arange(len(held)))
    held.to_csv(tmp_path / "held.csv", index=False)
    (tmp_path / "held.toml").write_text('frame = "NED"\nmag_reference = [20.0, 0.0, 44.0]\n')
    assert imufit.diagnose(tmp_path / "held.csv").sentence
