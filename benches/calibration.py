"""Calibration of real poses beside scipy's least squares and imucal, on the same poses in the same run.

Accuracy is judged on what a fit did not see: poses are left out in turn (with all that show the same side), or, beside
imucal, the rests of the recording that the six labelled positions do not include. Our time contains the errors,
correlations and conditions. Both are timed for the bare fit and with every side left out in turn.
Run: ``python benches/calibration.py [FOLDER]`` (recordings; default: IMUFIT_DATA), with imucal if it is installed.
"""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from imufit import _imufit, read
from imufit.calibrating import calibrate, find_poses
from scipy.optimize import least_squares

try:
    import imucal
except ImportError:
    imucal = None

G = 9.80665
MANY = ("mpu9150_unit0", "mpu9150_unit1", "mpu9150_unit3", "xsens_mti_37_poses")
Fit = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def best(work: Callable[[], object], repeat: int = 20) -> float:
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def with_scipy(readings: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale, non-orthogonality (lower triangle) and bias by Levenberg-Marquardt with numerical derivatives."""

    def parts(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrix = np.diag(theta[:3])
        matrix[1, 0], matrix[2, 0], matrix[2, 1] = theta[3:6]
        return matrix, theta[6:]

    def residual(theta: np.ndarray) -> np.ndarray:
        matrix, bias = parts(theta)
        return weights * (np.linalg.norm(readings @ matrix.T + bias, axis=1) - G)

    return parts(least_squares(residual, [1.0, 1, 1, 0, 0, 0, 0, 0, 0], method="lm").x)


def many_poses(folder: Path) -> None:
    print("magnitude cost, 9 unknowns: RMS of |f| - g left out, m/s^2; time of a bare fit and with leaving out, ms")
    print("                                scipy, weights           ours/scipy     bare fit          left out too")
    print(
        "recording           poses before   equal    ours     ours equal ours   scipy  ours ratio   scipy  ours ratio"
    )
    for name in MANY:
        log = read(folder / "many_positions" / f"{name}.parquet")
        poses = [pose for pose in find_poses(log).poses if pose.used]
        readings = np.array([pose.mean for pose in poses])
        direction = readings / np.linalg.norm(readings, axis=1)[:, None]
        variance = np.sum(np.array([pose.variance for pose in poses]) * direction**2, axis=1)
        group = np.array([np.argmax(direction @ d > np.cos(np.radians(8.0))) for d in direction], dtype=float)
        weights = 1.0 / np.sqrt(variance)

        def ours(y: np.ndarray = readings, g: np.ndarray = group, v: np.ndarray = variance) -> np.ndarray:
            return _imufit.magnitude_calibration(y, g, G, variances=v)["held_out_length"]

        def theirs(y: np.ndarray = readings, w: np.ndarray = weights) -> tuple[np.ndarray, np.ndarray]:
            return with_scipy(y, w)

        def theirs_left_out(y: np.ndarray = readings, w: np.ndarray = weights, g: np.ndarray = group) -> np.ndarray:
            lengths = np.full(len(y), np.nan)
            for k in np.unique(g):
                matrix, bias = with_scipy(y[g != k], w[g != k])
                lengths[g == k] = np.linalg.norm(y[g == k] @ matrix.T + bias, axis=1)
            return lengths

        def ours_bare(y: np.ndarray = readings, g: np.ndarray = group, v: np.ndarray = variance) -> object:
            return _imufit.magnitude_calibration(y, g, G, variances=v, leave_out=False)

        plain = theirs_left_out(readings, np.ones(len(poses)))
        left_out = theirs_left_out()
        lengths = ours()
        both = np.isfinite(lengths)
        before = rms(np.linalg.norm(readings, axis=1) - G)
        equal, peer, own = rms(plain[both] - G), rms(left_out[both] - G), rms(lengths[both] - G)
        bare = best(theirs), best(ours_bare)
        whole = best(theirs_left_out, 3), best(ours)
        print(
            f"{name:20}{len(poses):4d} {before:7.4f} {equal:.5f} {peer:.5f}  {own:.5f} "
            f"{own / equal:5.2f} {own / peer:4.2f} {1e3 * bare[0]:6.2f} {1e3 * bare[1]:5.2f} {bare[0] / bare[1]:5.0f} "
            f"{1e3 * whole[0]:7.1f} {1e3 * whole[1]:5.2f} {whole[0] / whole[1]:5.0f}"
        )


def six_positions(folder: Path) -> None:
    if imucal is None:
        print("\nimucal is not installed: pip install imucal")
        return
    log = read(folder / "six_positions" / "ferraris_session_A.parquet")
    sides = {"+x": "x_p", "-x": "x_a", "+y": "y_p", "-y": "y_a", "+z": "z_p", "-z": "z_a"}
    frame = pd.DataFrame(
        np.hstack([log.acc, np.degrees(log.gyr)]), columns=[f"{s}_{a}" for s in ("acc", "gyr") for a in "xyz"]
    )
    rows = {name: np.flatnonzero(log.pose == side) for side, name in sides.items()}
    spans = {name: (r[0], r[-1] + 1) for name, r in rows.items()}
    turn = log.covariates["turn"]
    for k, axis in enumerate("xyz", 1):
        r = np.flatnonzero(np.abs(turn) == k)
        spans[f"{axis}_rot"] = (r[0], r[-1] + 1)
    sections = pd.DataFrame(spans, index=["start", "end"]).T
    regions = imucal.ferraris_regions_from_section_list(frame, sections)
    peer = imucal.FerrarisCalibration(grav=G, expected_angle=-360)
    found = peer.compute(regions, 102.4, from_acc_unit="m/s^2", from_gyr_unit="deg/s")
    labelled = calibrate(log, "vector", sensors=["acc"])
    every = find_poses(log, labelled_only=False).poses
    rests = [p for p in every if p.used and all(cell is None for cell in log.pose[p.rows[0] : p.rows[1] + 1])]
    readings = np.array([pose.mean for pose in rests])
    theirs = np.linalg.solve(found.K_a @ found.R_a, (readings - found.b_a).T).T
    ours = labelled.sensors["acc"].correct(readings)
    before, a, b = (rms(np.linalg.norm(v, axis=1) - G) for v in (readings, theirs, ours))
    used = labelled.used
    y, v = np.array([p.mean for p in used]), np.array([p.variance for p in used])
    u = np.array([G * np.eye(3)["xyz".index(p.name[1])] * (1 if p.name[0] == "+" else -1) for p in used])
    slow = best(lambda: peer.compute(regions, 102.4, from_acc_unit="m/s^2", from_gyr_unit="deg/s"))
    fast = best(lambda: _imufit.vector_calibration(y, v, u, G, leave_out=False))
    whole = best(lambda: calibrate(log, "vector"), 5)
    print(f"\nsix positions (imucal's own session A), judged on the {len(rests)} rests that are not labelled")
    print(f"RMS of |f| - g, m/s^2: before {before:.4f}, imucal {a:.4f}, ours {b:.4f} (ours/imucal {b / a:.2f})")
    print(
        f"time, ms: imucal from cut sections {1e3 * slow:.2f}; our cost from pose means {1e3 * fast:.3f} "
        f"(imucal/ours {slow / fast:.0f}); our whole call, poses found and gyro included, {1e3 * whole:.1f}"
    )


def main() -> None:
    default = os.environ.get("IMUFIT_DATA", str(Path(__file__).resolve().parents[1] / ".." / "shared" / "data"))
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else default)
    if not folder.is_dir():
        print(f"no recordings in {folder}: nothing is compared")
        return
    many_poses(folder)
    six_positions(folder)


if __name__ == "__main__":
    main()
