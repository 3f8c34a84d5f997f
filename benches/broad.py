"""Attitude errors on BROAD: our filters and other packages over every recording of a folder, in one run.

Errors are those of docs/conventions.md: e = q_est q_ref^-1 in the reference frame, root mean squares over the rows with
`movement` = 1, averaged over the trials. North is the field's direction for every filter; no filter sees the reference.
One fixed setting per filter for all trials. Ours are judged a second time with settings tuned on the other trials:
for each trial the one of `CANDIDATES` with the least mean error on all trials but that one. The others run
with their own defaults (imufusion: with its rejections at 10 degrees; ahrs: its EKF).
Run: ``python benches/broad.py [FOLDER] [--no-tuning]``.
"""

import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import ahrs
import imufit
import imufusion
import numpy as np
import qmt
from imufit import Log, _imufit
from imufit.replay import SETTINGS
from imufit.replay import replay as run_filters
from numpy.typing import NDArray
from vqf import VQF, offlineVQF

Array = NDArray[np.float64]
FOLDER = Path(__file__).resolve().parents[1] / ".." / "shared" / "data" / "broad"
NORTH = (0.0, 20.0, -44.0)  # ENU: the horizontal part to the north, as all filters take it
OURS = ("mekf", "smoother")
PARTS = ("total", "heading", "inclination")

_DEFAULTS = {name: setting["default"] for name, setting in SETTINGS["mekf"].items()}
TUNED = ("gyr_noise", "bias_walk", "speed", "mag_noise", "mag_departure", "scale_start")
CANDIDATES: tuple[dict[str, float], ...] = (
    {},
    *({name: _DEFAULTS[name] * factor} for name in TUNED for factor in (0.5, 2.0)),
)
"""The defaults, and each of the settings that matter halved and doubled."""


def read(path: Path) -> Log:
    log = imufit.read(path)
    if log.acc is None or log.gyr is None or log.mag is None or log.ref_q is None:
        raise SystemExit(f"{path}: a recording of BROAD has acc, gyr, mag and a reference")
    return replace(log, metadata=replace(log.metadata, mag_reference=NORTH))


def step_of(log: Log) -> float:
    return float(np.median(np.diff(log.t)))


def vqf_online(log: Log) -> Array:
    return VQF(step_of(log)).updateBatch(log.gyr, log.acc, log.mag)["quat9D"]


def vqf_offline(log: Log) -> Array:
    return offlineVQF(log.gyr, log.acc, log.mag, step_of(log))["quat9D"]


def qmt_vqf(log: Log) -> Array:
    return qmt.oriEstVQF(log.gyr, log.acc, log.mag, params={"Ts": step_of(log)})


def qmt_mahony(log: Log) -> Array:
    return qmt.oriEstMahony(log.gyr, log.acc, log.mag, params={"Ts": step_of(log)})


def ahrs_ekf(log: Log) -> Array:
    dip = float(np.degrees(np.arctan2(-NORTH[2], NORTH[1])))
    return ahrs.filters.EKF(gyr=log.gyr, acc=log.acc, mag=log.mag, Dt=step_of(log), frame="ENU", magnetic_ref=dip).Q


def fusion(log: Log) -> Array:
    running = imufusion.Ahrs()
    rate = 1.0 / step_of(log)
    settings = imufusion.AhrsSettings()
    settings.convention = imufusion.CONVENTION_ENU
    settings.sample_rate, settings.gyroscope_range = rate, 2000.0
    settings.acceleration_rejection, settings.magnetic_rejection, settings.rejection_timeout = 10.0, 10.0, 5.0
    running.settings = settings
    out = np.empty((log.n, 4))
    gyr, acc, mag, step = np.degrees(log.gyr), log.acc / 9.80665, log.mag, step_of(log)
    for k in range(log.n):
        running.update(gyr[k], acc[k], mag[k], step)
        q = running.quaternion
        out[k] = getattr(q, "wxyz", None) if hasattr(q, "wxyz") else (q.w, q.x, q.y, q.z)
    return out


PEERS: dict[str, Callable[[Log], Array]] = {
    "vqf online": vqf_online,
    "vqf offline": vqf_offline,
    "qmt vqf": qmt_vqf,
    "qmt mahony": qmt_mahony,
    "ahrs ekf": ahrs_ekf,
    "imufusion": fusion,
}


def errors(log: Log, q: Array) -> Array:
    """Total, heading and inclination, deg."""
    found = _imufit.attitude_rmse(q, log.ref_q, log.covariates["movement"] == 1.0)
    if found is None:
        raise SystemExit("a trial without a row to be judged")
    return np.degrees([found[part] for part in PARTS])


def ours(log: Log, name: str, settings: dict[str, float]) -> Array:
    return errors(log, run_filters(log, [name], {name: settings}).attitude[name])


def line(name: str, found: Array) -> str:
    return f"{name:24s}" + "".join(f"{x:12.2f}" for x in found)


def left_out(found: Array) -> Array:
    """Errors (trials, 3) with the candidate that is best on the other trials; `found` (candidates, trials, 3)."""
    total = found[:, :, 0]
    best = np.argmin(total.sum(axis=1, keepdims=True) - total, axis=0)
    return found[best, np.arange(total.shape[1])]


def main() -> None:
    arguments = [each for each in sys.argv[1:] if not each.startswith("--")]
    folder = Path(arguments[0]) if arguments else FOLDER
    paths = sorted(path for path in folder.glob("*.parquet") if "norefgaps" not in path.name)
    if not paths:
        raise SystemExit(f"no recordings (*.parquet) in {folder}")
    logs = [read(path) for path in paths]
    with ThreadPoolExecutor() as pool:
        fixed = {name: np.array(list(pool.map(lambda log, n=name: ours(log, n, {}), logs))) for name in OURS}
        fixed["mahony"] = np.array(list(pool.map(lambda log: ours(log, "mahony", {}), logs)))
        for name, peer in PEERS.items():
            try:
                fixed[name] = np.array([errors(log, np.ascontiguousarray(peer(log), dtype=np.float64)) for log in logs])
            except ImportError as error:
                print(
                    f"{name} does not run beside numpy {np.__version__}: {str(error).splitlines()[0]}", file=sys.stderr
                )
        tuned = {}
        if "--no-tuning" not in sys.argv:
            for name in OURS:
                tried = [list(pool.map(lambda log, n=name, s=s: ours(log, n, s), logs)) for s in CANDIDATES]
                tuned[name] = left_out(np.array(tried))
    print(f"{len(logs)} trials, total error in deg")
    print(f"{'':44s}" + "".join(f"{name:>14s}" for name in fixed))
    for k, path in enumerate(paths):
        print(f"{path.stem:44s}" + "".join(f"{found[k, 0]:14.2f}" for found in fixed.values()))
    print(f"\n{'mean over trials, deg':24s}" + "".join(f"{part:>12s}" for part in PARTS))
    for name, found in fixed.items():
        print(line(name, found.mean(axis=0)))
    for name, found in tuned.items():
        print(line(f"{name}, leave one out", found.mean(axis=0)))


if __name__ == "__main__":
    main()
