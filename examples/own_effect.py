"""An effect of one's own: a cooling fan beside the sensor shifts the zero of gyro z.

Run it as it is, or hand it to the command line, which runs the same lines:

    python examples/own_effect.py fan.parquet
    imufit diagnose fan.parquet --effects-from examples/own_effect.py
"""

import sys
from dataclasses import replace

import imufit
import numpy as np


@imufit.effect(
    "gyr.fan",
    parameters={"z": "rad/s/A"},
    typical=0.01,
    axes="z",
    needs=["fan_current"],
    explanation="vibration of the fan, which grows with its current, is rectified by gyro z",
    mistaken_for="gyr.bias_temperature, since the fan starts when it gets warm",
    confirm="let the sensor lie still and switch the fan on and off",
)
def fan(w: imufit.Window, z: float) -> np.ndarray:
    """Return what the fan adds to gyro z: (n,), rad/s."""
    return z * w.column("fan_current")


def recorded() -> imufit.Log:
    """Record a hand-held sensor (with an accelerometer bias too) beside a fan that runs in bursts.

    Nothing here uses the effect above: the fan spins up slowly, its vibration grows with the square of its speed, and
    the current is measured with noise.
    """
    log = imufit.simulate("handheld", {"acc.bias": None}, seed=5, duration=90.0).to_log()
    switched_on = np.sin(0.9 * log.t) + np.sin(0.37 * log.t) > 0.4
    speed = np.zeros(log.n)  # over its full speed
    for i in range(1, log.n):
        speed[i] = speed[i - 1] + (switched_on[i] - speed[i - 1]) * (log.t[i] - log.t[i - 1]) / 0.8
    gyr = log.gyr + np.outer(speed**2, [0.0, 0.0, 0.004])
    current = 0.35 * speed**2 + 0.002 * np.random.default_rng(1).standard_normal(log.n)
    return replace(log, gyr=gyr, covariates={"fan_current": current})


if __name__ == "__main__":
    log = recorded()
    if len(sys.argv) > 1:
        log.write(sys.argv[1])
    print(imufit.SensorModel().fit(log).diagnose().sentence)
    print(imufit.ladder(log))
