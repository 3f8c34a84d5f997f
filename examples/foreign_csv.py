"""Another maker's CSV: its columns, units and signs to a log, without touching the file.

    python examples/foreign_csv.py

The file has milliseconds, g, deg/s, degrees Fahrenheit, its z axes the wrong way round and, as the reference, the Euler
angles of the turntable in degrees. imufit.read says so where a number cannot be in the unit given.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import imufit
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

MAPPING = {
    "t": "Time[ms]",
    "acc_x": "Ax[g]",
    "acc_y": "Ay[g]",
    "acc_z": "-Az[g]",
    "gyr_x": "Gx[deg/s]",
    "gyr_y": "Gy[deg/s]",
    "gyr_z": "-Gz[deg/s]",
    "temp": "T[degF]",
}
ANGLES = ("Yaw", "Pitch", "Roll")


def foreign_file(path: Path) -> None:
    """Write what another logger would have written of a sensor with a gyroscope that is off by 0.3 deg/s about y."""
    sim = imufit.simulate("turntable", {"gyr.bias": {"y": np.radians(0.3)}}, seed=2, duration=60.0)
    acc, gyr = sim.acc / 9.80665, np.degrees(sim.gyr)
    yaw_pitch_roll = Rotation.from_quat(sim.ref_q[:, [1, 2, 3, 0]]).as_euler("ZYX", degrees=True)
    table = {"Time": 1000.0 * sim.t}
    table |= {"Ax": acc[:, 0], "Ay": acc[:, 1], "Az": -acc[:, 2], "Gx": gyr[:, 0], "Gy": gyr[:, 1], "Gz": -gyr[:, 2]}
    table |= {"T": 1.8 * sim.temp + 32.0}
    table |= dict(zip(ANGLES, yaw_pitch_roll.T, strict=True))
    pd.DataFrame(table).to_csv(path, index=False)


def log_of(path: Path) -> imufit.Log:
    """Read it; the table's Euler angles become the reference attitude and are not covariates any more."""
    log = imufit.read(path, mapping=MAPPING)
    angles = np.stack([log.covariates[name] for name in ANGLES], axis=1)
    others = {name: column for name, column in log.covariates.items() if name not in ANGLES}
    return replace(log, covariates=others).with_reference(Rotation.from_euler("ZYX", angles, degrees=True))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.csv"
        foreign_file(file)
        log = log_of(file)
    print(log)
    print(imufit.ladder(log))
