"""Paper C's filters on sensors that an industrial robot carried: does the paper's claim hold on real data?

Every recording of a folder but those of path 1, by the methods of `examples/paper_c_hybrid.py` with both published
sets of gains and with gains tuned on path 1 of the same sensor: with the readings as they are, and with the effects
taken out that the ladder finds on that path. All filters start at TRIAD's attitude. The first two seconds are left out:
there the radio's buffer empties, and three hundred rows a second carry the time of their arrival.
Run: ``python benches/robot_arm.py [FOLDER]``.
"""

import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import imufit
import numpy as np
from imufit import Log
from imufit.comparing.attitude import corrected
from imufit.replaying import estimate_mag_reference
from imufit.replaying import replay as run_filters
from imufit.tuning import tune
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".." / "shared" / "data" / "robot_arm"
FITTED = "path1_150mms"
"""The recording on which the model is fitted: slow turns about all axes. Path 1 is not judged at any speed."""
BUFFERED = 2.0
"""Time (s) at the beginning of a recording whose times are not those of the samples."""
PAPER: dict[str, Any] = runpy.run_path(str(ROOT / "examples" / "paper_c_hybrid.py"))
MEASURES = {"total": 3, "lag ms": 4, "start": 6, "stop": 7}
"""The reported measures of the example, and their places there."""


def read(path: Path) -> Log:
    """Return a recording without its beginning."""
    log = imufit.read(path)
    if log.ref_q is None or log.mag is None or log.acc is None or log.gyr is None:
        raise SystemExit(f"{path}: a recording of the robot arm has acc, gyr, mag and a reference")
    return log.rows(int(np.searchsorted(log.t, BUFFERED)), log.n)


def with_reference(log: Log) -> Log:
    """Return the rows from the first to the last with a reference."""
    known = np.flatnonzero(np.isfinite(np.asarray(log.ref_q)).all(axis=1))
    return log.rows(int(known[0]), int(known[-1]) + 1)


def with_field_north(log: Log) -> Log:
    """Return a log in NED with the horizontal part of its mean field as north, as the equations want it."""
    field = estimate_mag_reference(log)
    if field is None or log.metadata.frame != "NWU" or log.ref_q is None:
        raise SystemExit("a recording of the robot arm is in NWU and has a field")
    azimuth = np.arctan2(field[1], field[0])
    turn = Rotation.from_euler("X", np.pi) * Rotation.from_euler("Z", -azimuth)
    turned = (turn * Rotation.from_quat(log.ref_q[:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]
    known = (float(np.hypot(field[0], field[1])), 0.0, float(-field[2]))
    return replace(log, ref_q=turned, metadata=replace(log.metadata, frame="NED", mag_reference=known))


def judged(log: Log, tuned: dict[str, float] | None = None) -> dict[str, Array]:
    """Return for every method heading and inclination error (deg), then `MEASURES`; `tuned` adds a hybrid."""
    log = with_field_north(with_reference(log))
    start = run_filters(log, ["triad"]).attitude["triad"][0]
    reading = PAPER["Reading"](whole_field=True)
    found = {
        f"{PAPER['WHOLE']}, {name}": PAPER["by_the_equations"](log, gains, reading, start)
        for name, gains in PAPER["SETS"].items()
    }
    methods = {**PAPER["FILTERS"], **({"hybrid, tuned": ("hybrid", tuned)} if tuned else {})}
    for name, (chosen, settings) in methods.items():
        found[name] = run_filters(log, [chosen], {chosen: settings}).attitude[chosen]
    measures = list(MEASURES.values())
    return {
        name: np.array([*parts(log, q), *PAPER["figures"](log, q)[measures]])
        for name, q in sorted(found.items(), key=lambda item: item[0][-1] if "figure" in item[0] else "")
    }


def parts(log: Log, q: Array) -> Array:
    """Return the root mean squares of heading and inclination error, deg."""
    errors = imufit.replaying.Replay(log, {"one": q}, {}, {}).row_errors("one")
    return np.asarray(np.degrees(np.sqrt(np.nanmean(errors[:, 1:3] ** 2, axis=0))))


def print_table(name: str, before: list[dict[str, Array]], after: list[dict[str, Array]]) -> None:
    """Print the mean over the recordings, as they are and with the model applied."""
    columns = ("heading", "inclination", *MEASURES)
    print(f"\n{name}: mean of {len(before)} recordings, as they are")
    for title, found in (("", before), ("the same with the model of another path applied", after)):
        print(title or f"{'':30}" + "".join(f"{column:>13}" for column in columns))
        for method in found[0]:
            mean = np.mean([each[method] for each in found], axis=0)
            print(f"{method:30}" + "".join(f"{value:13.2f}" for value in mean))


def print_claim(found: list[dict[str, Array]]) -> None:
    """Print in how many recordings the paper's claim holds."""
    total = {method: np.array([each[method][2] for each in found]) for method in found[0]}
    peaks = {method: np.array([each[method][4:6].mean() for each in found]) for method in found[0]}
    for name in PAPER["SETS"]:
        hybrid, whole = f"hybrid driven, {name}", f"{PAPER['WHOLE']}, {name}"
        print(
            f"  {name}: the driven hybrid beats TRIAD in {np.sum(total[hybrid] < total['TRIAD'])} of {len(found)}, "
            f"where the arm starts and stops in {np.sum(peaks[hybrid] < peaks['TRIAD'])}; "
            f"{PAPER['WHOLE']} is worse than both in "
            f"{np.sum((total[whole] > total['TRIAD']) & (total[whole] > total[hybrid]))}"
        )


def main(folder: Path) -> None:
    """Judge all recordings of a folder, sensor by sensor."""
    sensors = sorted({path.name.split("_")[0] for path in folder.glob("*_path*.parquet")})
    if not sensors:
        raise SystemExit(f"{folder}: no recordings SENSOR_pathN_SPEED.parquet")
    everything: tuple[list[dict[str, Array]], list[dict[str, Array]]] = ([], [])
    for sensor in sensors:
        fitted = read(folder / f"{sensor}_{FITTED}.parquet")
        ladder = imufit.ladder(fitted)
        tuned = tune(corrected(ladder.fit.model, fitted), "hybrid").settings["hybrid"]
        gains = ", ".join(f"{name} = {value:.2g}" for name, value in tuned.items())
        print(f"{sensor}: model of {FITTED}: {', '.join(ladder.model)}; gains tuned there: {gains}")
        logs = [read(path) for path in sorted(folder.glob(f"{sensor}_path*.parquet")) if "_path1_" not in path.name]
        before = [judged(log, tuned) for log in logs]
        after = [judged(corrected(ladder.fit.model, log), tuned) for log in logs]
        print_table(sensor, before, after)
        for whole, part in zip(everything, (before, after), strict=True):
            whole.extend(part)
    for name, found in zip(("as they are", "with the model applied"), everything, strict=True):
        print(f"\nThe claim, readings {name}:")
        print_claim(found)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
