"""Attitude errors on BROAD: our filters and other packages over every recording of a folder, in one run.

Errors are those of docs/conventions.md: e = q_est q_ref^-1 in the reference frame, root mean squares over the rows with
`movement` = 1, averaged over the trials. North is the field's direction for every filter; no filter sees the reference.
One fixed setting per filter for all trials: ours and the others run with their defaults. Then

- *settings of the others*: ours with, for each trial, the one of `CANDIDATES` that has the least mean error on all
  trials but that one;
- *model of the others*: readings corrected for each trial with a sensor model that all trials but that one gave. It
  holds the effects that the ladder found on more than half of them, fitted to each of them, and of every parameter the
  median. The fits take the field for north, too: with a field of its own each would find an iron of its own. Where the
  model says that the reference is late, the trial is judged against the reference of that much later.

Run: ``python benches/broad.py [FOLDER] [--no-tuning] [--no-models] [--json]``. The table goes to standard output,
progress to standard error.
"""

import argparse
import json
import math
import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import lru_cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import imufit
import numpy as np
from imufit import InputError, Log, SensorModel, _imufit, filters
from imufit.comparing.attitude import corrected
from imufit.replaying import SETTINGS, convert_frame
from imufit.replaying import replay as run_filters
from numpy.typing import NDArray
from peers import MISSING, PEERS
from scipy.signal import butter, lfilter, lfilter_zi

Array = NDArray[np.float64]
Parameters = dict[str, dict[str, float]]
FOLDER = Path(__file__).resolve().parents[1] / ".." / "shared" / "data" / "broad"
NORTH = (0.0, 20.0, -44.0)  # ENU: the horizontal part to the north, as all filters take it
ALMOST_INERTIAL = (0.05, 0.2, 0.5, 1.0, 3.0)
"""Time constants of the low pass of the specific force, s; the last is the default of vqf (tauAcc)."""
OURS = ("mekf", "smoother", "madgwick", "mahony")
TUNED = ("mekf", "smoother")
WITH_MODEL = ("mekf", "smoother", "vqf, online", "vqf, offline")
LEFT_OUT = ("ahrs, Mahony",)  # slower than its Madgwick and no better
PARTS = ("total", "heading", "inclination")
OF_ONE_RECORDING = ("drift", "warmup", "column:", "field_reference")
"""Effects that say nothing of the same sensor in another recording."""

_DEFAULTS = {name: setting["default"] for name, setting in SETTINGS["mekf"].items()}
CANDIDATES: tuple[dict[str, float], ...] = (
    {},
    *(
        {name: _DEFAULTS[name] * factor}
        for name in ("gyr_noise", "bias_walk", "speed", "mag_noise", "mag_departure", "scale_start")
        for factor in (2.0 / 3.0, 1.5)
    ),
)
"""The defaults, and each of the settings that matter by a half larger and smaller."""


@lru_cache(maxsize=4)
def read(path: Path) -> Log:
    log = imufit.read(path)
    if any(column is None for column in (log.acc, log.gyr, log.mag, log.ref_q)) or "movement" not in log.covariates:
        raise InputError("a recording of BROAD has acc, gyr, mag, a reference and the column movement", file=path)
    return log


def errors(log: Log, q: Array) -> list[float]:
    """Total, heading and inclination, deg."""
    found = _imufit.attitude_rmse(q, log.ref_q, log.covariates["movement"] == 1.0)
    if found is None:
        raise InputError("no row with a reference and movement = 1", file=log.path)
    return [float(np.degrees(found[part])) for part in PARTS]


def judge(path: Path, settings: dict[str, float], parameters: Parameters, name: str) -> list[float]:
    """Errors of a filter of ours or of another package over a trial, corrected with a sensor model."""
    log = corrected(SensorModel(list(parameters), parameters), read(path))
    log = replace(log, metadata=replace(log.metadata, mag_reference=NORTH))
    if name not in PEERS:
        return errors(log, run_filters(log, [name], {name: settings}).attitude[name])
    peer, columns = PEERS[name], (np.ascontiguousarray(x, dtype=np.float64) for x in (log.gyr, log.acc, log.mag))
    q = peer.run(float(np.median(np.diff(log.t))), *columns)
    return errors(log, convert_frame(np.ascontiguousarray(q, dtype=np.float64), peer.frame, "ENU"))


def low_passed(log: Log, tau: float) -> Log:
    """Return the log with its specific force low-passed in an almost inertial frame, as vqf does.

    The frame turns with the body by the integrated rate. The low pass is a Butterworth filter of second order whose
    step response has the time constant tau, s (Laidig and Seel 2023, eq. 8), settled on the first reading.
    """
    rate = 1.0 / float(np.median(np.diff(log.t)))
    b, a = butter(2, math.sqrt(2.0) / (2.0 * math.pi * tau), fs=rate)
    inertial = filters.Gyro(initial=[1.0, 0.0, 0.0, 0.0], recovery=0.0).run(log.gyr, dt_or_t=log.t)
    force = _imufit.rotate(inertial, np.ascontiguousarray(log.acc, dtype=np.float64))
    force = lfilter(b, a, force, axis=0, zi=lfilter_zi(b, a)[:, None] * force[0])[0]
    back = np.ascontiguousarray(inertial * [1.0, -1.0, -1.0, -1.0])
    return replace(log, acc=_imufit.rotate(back, np.ascontiguousarray(force)))


def judge_low_passed(path: Path, tau: float, name: str) -> list[float]:
    """Errors of a filter of ours over a trial whose specific force is low-passed in an almost inertial frame."""
    log = read(path)
    log = replace(log, metadata=replace(log.metadata, mag_reference=NORTH))
    return errors(log, run_filters(low_passed(log, tau), [name]).attitude[name])


def with_field(log: Log) -> Log:
    """Return the log with a reference field: as long as its mean, horizontally and vertically, and to the north."""
    judged = (log.covariates["movement"] == 1.0) & np.isfinite(np.hstack([log.ref_q, log.mag])).all(axis=1)
    q, mag = (np.ascontiguousarray(x[judged], dtype=np.float64) for x in (log.ref_q, log.mag))
    east, north, up = _imufit.rotate(q, mag).mean(axis=0).tolist()
    return replace(log, metadata=replace(log.metadata, mag_reference=(0.0, math.hypot(east, north), up)))


def climb(path: Path) -> list[str]:
    """Return the effects of the sensor that the ladder finds on a trial."""
    return [
        effect
        for effect in imufit.ladder(with_field(read(path))).model
        if not any(x in effect for x in OF_ONE_RECORDING)
    ]


def fit(path: Path, effects: Sequence[str]) -> Parameters | None:
    """Return the parameters of a stack of effects on a trial; None where it cannot be fitted there."""
    try:
        return SensorModel(effects).fit(with_field(read(path))).model.parameters
    except InputError:
        return None


class Trials:
    """The trials of a folder, worked on side by side."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = list(paths)
        self._pool = ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn"))

    def each(self, what: str, task: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
        """Results of a task over paths (all, or the first of the columns) and what goes with each."""
        before = time.perf_counter()
        found = list(self._pool.map(task, *(columns or (self.paths,))))
        print(f"{what}: {len(found)} in {time.perf_counter() - before:.1f} s", file=sys.stderr, flush=True)
        return found

    def judged(self, name: str) -> Array:
        """Errors (trials, 3) of a filter with its defaults."""
        return np.array(self.each(name, partial(judge, settings={}, parameters={}, name=name)))

    def low_passed(self, name: str) -> Array:
        """Total errors (1 + low passes, trials) of a filter, deg: without one, then each of ALMOST_INERTIAL."""
        found = [self.judged(name)[:, 0]]
        for tau in ALMOST_INERTIAL:
            each = self.each(f"{name}, low pass of {tau:g} s", partial(judge_low_passed, tau=tau, name=name))
            found.append(np.array(each)[:, 0])
        return np.array(found)

    def tuned(self, name: str) -> Array:
        """Errors (trials, 3) with the candidate that is best on the other trials."""
        n = len(self.paths)
        settings = [each for each in CANDIDATES for _ in range(n)]
        task = partial(judge, parameters={}, name=name)
        found = self.each(f"{name}, settings", task, self.paths * len(CANDIDATES), settings)
        every = np.array(found).reshape(len(CANDIDATES), n, len(PARTS))
        return every[_best_on_the_others(every[:, :, 0]), np.arange(n)]

    def models(self) -> list[Parameters]:
        """For each trial the model that the others give."""
        found = self.each("ladder", climb)
        stacks = [_majority([*found[:k], *found[k + 1 :]]) for k in range(len(found))]
        fitted = {
            stack: self.each(f"fit of {' '.join(stack)}", partial(fit, effects=stack))
            for stack in dict.fromkeys(stacks)
        }
        return [_median(fitted[stack][:k] + fitted[stack][k + 1 :]) for k, stack in enumerate(stacks)]

    def with_models(self, name: str, models: Sequence[Parameters]) -> Array:
        """Errors (trials, 3) of a filter with its defaults over corrected readings."""
        settings: list[dict[str, float]] = [{}] * len(self.paths)
        return np.array(self.each(f"{name}, model", partial(judge, name=name), self.paths, settings, models))


def _best_on_the_others(total: Array) -> NDArray[np.intp]:
    """Return for each trial the candidate with the least sum over the others, from errors (candidates, trials)."""
    return np.argmin(total.sum(axis=1, keepdims=True) - total, axis=0)


def _majority(found: Sequence[Sequence[str]]) -> tuple[str, ...]:
    count = Counter(effect for effects in found for effect in effects)
    return tuple(sorted(effect for effect, n in count.items() if 2 * n > len(found)))


def _median(fitted: Sequence[Parameters | None]) -> Parameters:
    known = [each for each in fitted if each is not None]
    return {
        effect: {name: statistics.median(each[effect][name] for each in known) for name in known[0][effect]}
        for effect in (known[0] if known else ())
    }


def written(paths: Sequence[Path], found: dict[str, Array], models: Sequence[Parameters]) -> dict[str, Any]:
    """Return everything for `--json`."""
    names = [path.stem for path in paths]
    keys = [f"{part}_deg" for part in PARTS]
    return {
        "trials": names,
        "filters": {
            name: {
                "mean": dict(zip(keys, each.mean(axis=0).tolist(), strict=True)),
                **{key: each[:, k].tolist() for k, key in enumerate(keys)},
            }
            for name, each in found.items()
        },
        "models_of_the_others": dict(zip(names, models, strict=False)),
        "missing": MISSING,
    }


def printed(paths: Sequence[Path], found: dict[str, Array]) -> None:
    print(f"mean over {len(paths)} trials, deg".ljust(36) + "".join(f"{part:>14s}" for part in PARTS))
    for name, each in found.items():
        print(f"{name:36s}" + "".join(f"{x:14.2f}" for x in each.mean(axis=0)))
    print("\ntotal error of each trial, deg")
    for k, name in enumerate(found):
        print(f"{k:4d}  {name}")
    print(" " * 44 + "".join(f"{k:7d}" for k in range(len(found))))
    for k, path in enumerate(paths):
        print(f"{path.stem:44s}" + "".join(f"{each[k, 0]:7.2f}" for each in found.values()))


def sentence(name: str, found: Array) -> str:
    """Say what the low pass in an almost inertial frame does to a filter, from the errors (1 + low passes, trials)."""
    without, *with_it = found.mean(axis=1)
    each = ", ".join(f"{error:.2f} deg with {tau:g} s" for tau, error in zip(ALMOST_INERTIAL, with_it, strict=True))
    n = found.shape[1]
    chosen = found[_best_on_the_others(found), np.arange(n)].mean() if n > 1 else np.nan
    return (
        f"A low pass of the specific force in an almost inertial frame (vqf's way) before `{name}` changes the mean "
        f"total error over {n} trials from {without:.2f} deg to {each}; with the time constant, or none, chosen for "
        f"each trial on the others the error is {chosen:.2f} deg."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--no-tuning", action="store_true", help="leave out the settings of the others")
    parser.add_argument("--no-models", action="store_true", help="leave out the models of the others")
    parser.add_argument("--almost-inertial", metavar="FILTER", help="only: a low pass of the specific force before it")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    given = parser.parse_args()
    paths = sorted(path for path in given.folder.glob("*.parquet") if "norefgaps" not in path.name)
    if not paths:
        raise SystemExit(f"no recordings (*.parquet) in {given.folder}")
    for line in MISSING:
        print(line, file=sys.stderr)
    trials, models = Trials(paths), list[Parameters]()
    if given.almost_inertial:
        print(sentence(given.almost_inertial, trials.low_passed(given.almost_inertial)))
        return
    peers = [name for name, peer in PEERS.items() if peer.frame is not None and name not in LEFT_OUT]
    found = {name: trials.judged(name) for name in (*OURS, *peers)}
    if not given.no_tuning and len(paths) > 1:
        found |= {f"{name}, settings of the others": trials.tuned(name) for name in TUNED}
    if not given.no_models and len(paths) > 1:
        models = trials.models()
        names = [name for name in WITH_MODEL if name in found]
        found |= {f"{name}, model of the others": trials.with_models(name, models) for name in names}
    if given.json:
        print(json.dumps(written(paths, found, models), indent=1))
    else:
        printed(paths, found)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        raise SystemExit(str(error)) from None
