"""A robot arm swung back and forth: TRIAD, Mahony's filter and their hybrid, and what made one of them look bad.

A GY-86 on a robot arm: published are two figures of roll, pitch and yaw, with two sets of gains, and no numbers. The
hybrid follows the arm as fast as TRIAD and is more accurate where it starts and stops, plain Mahony is the worst, and
other gains improve it. The experiment is simulated here and measured: errors, lag, noise, starts and stops; and the
printed equations are taken at their word to find what makes the published figures.

    python examples/paper_c_hybrid.py [FOLDER [SEEDS]]      writes its figures to FOLDER
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from textwrap import fill

import imufit
import numpy as np
from imufit.figures.style import BLUE, GREY, INK, ORANGE, VERMILION, new_figure, tidy, title
from imufit.lab.simulate import Noise, simulate
from imufit.lab.simulate.robot_arm import ARM, STANDING
from imufit.replaying import PAPER_C_GAINS
from imufit.replaying import replay as run_filters
from imufit.tuning import Tuning
from scipy.spatial.transform import Rotation

RATE, DURATION = 100.0, 60.0
LOW_PASS = {"acc.lowpass": {"tau": 1 / (2 * np.pi * 44.0)}, "gyr.lowpass": {"tau": 1 / (2 * np.pi * 42.0)}}
GYRO_BIAS = {"gyr.bias": dict(zip("xyz", np.radians([0.2, -0.3, 0.15]).tolist(), strict=True))}
"""Change of a gyroscope's bias by a kelvin or two after its correction at rest."""

SETS = {"figure 3": PAPER_C_GAINS["figure_3"], "figure 4": PAPER_C_GAINS["figure_4"]}
IDENTITY = (1.0, 0.0, 0.0, 0.0)
COLUMNS = ("roll", "pitch", "yaw", "total", "lag ms", "at rest", "start", "stop")
STARTED = 1.0
"""Time (s) that is left to the filters at the beginning of a log, at rest."""
MOVING = np.radians(1.0)
"""Rate (rad/s) above which the arm moves."""
RAMP, AFTER = 0.35, 0.3
"""Longest time (s) in which a joint gets to its rate or stops, and how long after that still counts as either."""
TUNED_ON = 101
"""Seed of the swing on which gains are tuned; they are judged on others."""


@cache
def swung(seed: int, *, at_joint: bool = False, mag_rate: float = 75.0) -> imufit.Log:
    """Simulate the arm; with the sensor at its end or, by the same motion, in the joint; magnetometer's rate in Hz."""
    place = {"acc.lever_arm": {"x": -ARM[0]}} if at_joint else {}
    noise = replace(Noise.gy86(), mag_rate=mag_rate)
    return simulate("arm_swing", {**LOW_PASS, **GYRO_BIAS, **place}, seed, DURATION, RATE, noise=noise).to_log()


@dataclass(frozen=True)
class Reading:
    """One way to read eqs. (5) to (7).

    Attributes
    ----------
    whole_field : whether the field is compared with north as it is, dip included, or its horizontal part alone.
    exchanged : whether k_I and k_P change places, as they do in the printed equations.
    gyro : whether the gyroscope's rate is in eq. (7); as printed it is not.
    """

    whole_field: bool = False
    exchanged: bool = False
    gyro: bool = True


READINGS = {
    "as proven: horizontal field": Reading(),
    "v_02 = [1 0 0] for the whole field": Reading(whole_field=True),
    "k_I and k_P exchanged": Reading(exchanged=True),
    "exchanged, and no gyro in eq. (7)": Reading(exchanged=True, gyro=False),
}
WHOLE = "Mahony, whole field"
"""Mahony's filter with the whole field compared with v_02 = [1 0 0], as the paper has it."""


def by_the_equations(log: imufit.Log, gains: dict[str, float], reading: Reading, start: np.ndarray) -> np.ndarray:
    """Integrate eqs. (5) to (7) over a log of n rows, frame NED; attitudes (n, 4), scalar first, body to frame.

    Written for this comparison alone, in the simplest way: semi-implicit Euler steps, and between two samples of the
    magnetometer the last one, as its register holds it.
    """
    k_1, k_2, k_i, k_p = (gains[name] for name in ("k_1", "k_2", "k_i", "k_p"))
    if reading.exchanged:  # eq. (7) as printed: w_mes - b + K_i w_mes
        k_i, k_p = k_p, k_i + (not reading.gyro)
    down, field = (unit(-log.acc).tolist(), unit(held(log.mag)).tolist())
    rates = (0.5 * reading.gyro * (log.gyr[1:] + log.gyr[:-1])).tolist()
    (w, x, y, z), b = (float(part) for part in start), [0.0, 0.0, 0.0]
    out = [(w, x, y, z)]
    for dt, rate, v_1, v_2 in zip(np.diff(log.t).tolist(), rates, down, field, strict=False):
        north = (w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y))
        below = (2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z)
        if not reading.whole_field:
            dip = sum(a * c for a, c in zip(v_2, below, strict=True))
            level = [a - dip * c for a, c in zip(v_2, below, strict=True)]
            size = sum(a * a for a in level) ** 0.5
            v_2 = [a / size for a in level]  # noqa: PLW2901  the measured direction of eq. (5)
        pairs = zip(cross(v_1, below), cross(v_2, north), strict=True)
        w_mes = [0.5 * (k_1 * a + k_2 * m) for a, m in pairs]
        b = [bias - 0.5 * dt * k_i * each for bias, each in zip(b, w_mes, strict=True)]
        p, q, r = (0.5 * dt * (o - bias + k_p * each) for o, bias, each in zip(rate, b, w_mes, strict=True))
        w, x, y, z = (
            w - x * p - y * q - z * r,
            x + w * p + y * r - z * q,
            y + w * q + z * p - x * r,
            z + w * r + x * q - y * p,
        )
        size = (w * w + x * x + y * y + z * z) ** 0.5
        w, x, y, z = w / size, x / size, y / size, z / size
        out.append((w, x, y, z))
    return np.array(out)


def unit(rows: np.ndarray) -> np.ndarray:
    """Return rows of length one."""
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def cross(a: list[float], b: tuple[float, ...]) -> tuple[float, float, float]:
    """Return the cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def held(readings: np.ndarray) -> np.ndarray:
    """Return the last reading before each row that has none."""
    there = np.isfinite(readings[:, 0])
    return readings[np.maximum.accumulate(np.where(there, np.arange(there.size), 0))]


def first_attitude(log: imufit.Log) -> np.ndarray:
    """Return what TRIAD makes of the first row."""
    return run_filters(log, ["triad"]).attitude["triad"][0]


@cache
def tuning() -> Tuning:
    """Tune the driven hybrid on a swing that nothing is judged on."""
    log = simulate("arm_swing", {**LOW_PASS, **GYRO_BIAS}, TUNED_ON, DURATION, 0.5 * RATE).to_log()
    return imufit.tune(log, "hybrid", gains=("k_p", "k_i"))


FILTERS = {
    "TRIAD": ("triad", {}),
    "QUEST": ("quest", {}),
    "Kalman": ("kalman", {}),
    "mekf": ("mekf", {}),
    **{f"Mahony, {name}": ("mahony", gains) for name, gains in SETS.items()},
    **{f"hybrid seeded, {name}": ("hybrid", {**gains, "driven": 0.0}) for name, gains in SETS.items()},
    **{f"hybrid driven, {name}": ("hybrid", {**gains, "driven": 1.0}) for name, gains in SETS.items()},
}
"""Filter and settings of each method but those that are tuned or written out here."""


def attitudes(seed: int, *, at_joint: bool = False, arm_known: bool = False) -> dict[str, np.ndarray]:
    """Return the attitude (n, 4) by every method, all started at TRIAD's attitude.

    With `arm_known` the filters get the accelerometer's place on the arm as a setting; `WHOLE`, which is not
    the library's, has no such setting.
    """
    log = swung(seed, at_joint=at_joint)
    rules = dict(zip(("lever_x", "lever_y", "lever_z"), ARM, strict=True)) if arm_known else {}
    methods = {**FILTERS, "hybrid, tuned": ("hybrid", tuning().settings["hybrid"])}
    found = {
        name: run_filters(log, [chosen], {chosen: settings, "replay": rules}).attitude[chosen]
        for name, (chosen, settings) in methods.items()
    }
    if not arm_known:
        start, reading = first_attitude(log), Reading(whole_field=True)
        found |= {f"{WHOLE}, {name}": by_the_equations(log, gains, reading, start) for name, gains in SETS.items()}
    return found


def rotations(q: np.ndarray) -> Rotation:
    """Return attitudes (n, 4), scalar first, as scipy has them."""
    return Rotation.from_quat(q[:, [1, 2, 3, 0]])


def error_vectors(log: imufit.Log, q: np.ndarray) -> np.ndarray:
    """Return the rotation from true to estimated attitude, reference frame, (n, 3), deg."""
    return np.degrees((rotations(q) * rotations(log.ref_q).inv()).as_rotvec())


def figures(log: imufit.Log, q: np.ndarray) -> np.ndarray:
    """Return the measures of `COLUMNS` for attitudes (n, 4) over a log.

    Root mean square errors of roll, pitch, yaw and of the total angle (deg); the lag (ms), which is the delay that fits
    the error best, -sum(e . omega) / sum(omega . omega) while the arm moves; the standard deviation of the error at
    rest (deg, all axes together); the largest total error at a start and at a stop (deg), mean over all of them.
    """
    error, t = error_vectors(log, q), log.t
    euler = np.degrees((rotations(q).as_euler("ZYX") - rotations(log.ref_q).as_euler("ZYX"))[:, ::-1])
    euler = (euler + 180.0) % 360.0 - 180.0
    truth = rotations(log.ref_q)
    step = (truth[1:] * truth[:-1].inv()).as_rotvec() / np.diff(t)[:, None]
    rate = np.vstack([step[:1], step])
    moving = np.linalg.norm(rate, axis=1) > MOVING
    lag = -np.sum(error[moving] * np.degrees(rate[moving])) / np.sum(np.degrees(rate[moving]) ** 2)
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    starts, stops = edges[~moving[edges]], edges[moving[edges]]
    size = np.linalg.norm(error, axis=1)
    peaks = [
        np.mean([size[(t >= t[k] - before) & (t <= t[k] + after)].max() for k in places])
        for places, before, after in ((starts, 0.0, RAMP + AFTER), (stops, RAMP, AFTER))
    ]
    bounds = [0, *(np.flatnonzero(np.diff(t[~moving]) > 0.1) + 1), int(np.sum(~moving))]
    rests = [np.flatnonzero(~moving)[a:b] for a, b in pairwise(bounds)]
    late = [rest[t[rest] > t[rest[0]] + 0.5 * STANDING] for rest in rests if np.ptp(t[rest]) > 0.9 * STANDING]
    noise = np.sqrt(np.mean([np.sum(np.var(error[rest], axis=0)) for rest in late])) if late else np.nan
    after = t > STARTED
    rmse = np.sqrt(np.mean(np.column_stack([euler, size])[after] ** 2, axis=0))
    return np.array([*rmse, 1e3 * lag, noise, *peaks])


@cache
def measured(seeds: tuple[int, ...], *, at_joint: bool = False, arm_known: bool = False) -> dict[str, np.ndarray]:
    """Return for every method the measures of `COLUMNS` of each seed, (seeds, 8)."""
    found = [
        {
            name: figures(swung(seed, at_joint=at_joint), q)
            for name, q in attitudes(seed, at_joint=at_joint, arm_known=arm_known).items()
        }
        for seed in seeds
    ]
    return {name: np.stack([each[name] for each in found]) for name in found[0]}


def total(log: imufit.Log, q: np.ndarray) -> float:
    """Return the root mean square of the total error, deg."""
    error = error_vectors(log, q)[log.t > STARTED]
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@cache
def by_reading(seed: int) -> dict[str, dict[str, tuple[float, float]]]:
    """Return for each reading of the equations and each set of gains the total errors of Mahony and the driven hybrid.

    The hybrid shares what is wrong with the gains and with the rate. It does not share errors of the field: it
    takes TRIAD's attitude instead.
    """
    log = swung(seed)
    start = first_attitude(log)
    return {
        name: {
            which: (
                total(log, by_the_equations(log, gains, reading, start)),
                total(log, driven(log, gains, reading)),
            )
            for which, gains in SETS.items()
        }
        for name, reading in READINGS.items()
    }


def driven(log: imufit.Log, gains: dict[str, float], reading: Reading) -> np.ndarray:
    """Return the driven hybrid's attitudes by a reading of the equations."""
    if reading.exchanged:
        gains = {**gains, "k_i": gains["k_p"], "k_p": gains["k_i"] + (not reading.gyro)}
    seen = log if reading.gyro else replace(log, gyr=np.zeros_like(log.gyr))
    return run_filters(seen, ["hybrid"], {"hybrid": gains}).attitude["hybrid"]


def as_published(mahony: tuple[float, float], hybrid: tuple[float, float], triad: float) -> bool:
    """Return whether total errors with the gains of figures 3 and 4 come as in the paper.

    Figure 3: the hybrid is more accurate than TRIAD, Mahony is the worst of the three. Figure 4: Mahony improves.
    """
    return hybrid[0] < triad < mahony[0] and mahony[1] < mahony[0]


def found_after(seed: int, name: str, within: float = 1.0) -> float:
    """Return the time (s) in which a filter comes from [1 0 0 0] to within (deg) the same one started by TRIAD."""
    (chosen, settings), log = FILTERS[name], swung(seed)
    right, wrong = (
        run_filters(log, [chosen], {chosen: settings}, initial=start).rotation(chosen) for start in (None, IDENTITY)
    )
    far = np.flatnonzero(np.degrees((wrong * right.inv()).magnitude()) > within)
    return float(log.t[far[-1] + 1]) if far.size else 0.0


def redrawn(seed: int, name: str):
    """Draw figure 3 or 4 of the paper: roll, pitch and yaw by TRIAD, Mahony and hybrid over the swings."""
    log = swung(seed)
    gains = SETS[name]
    mahony = by_the_equations(log, gains, Reading(whole_field=True), np.array(IDENTITY))
    lines = {
        "TRIAD": (ORANGE, 2.4, run_filters(log, ["triad"]).attitude["triad"]),
        f"{WHOLE}, from [1 0 0 0]": (VERMILION, 1.3, mahony),
        "hybrid, driven": (BLUE, 1.6, driven(log, gains, Reading())),
        "true": (INK, 0.9, log.ref_q),
    }
    figure = new_figure(11.0, 7.5)
    grid = figure.add_gridspec(3, 2, width_ratios=(3, 1))
    shown = {
        label: np.degrees(np.unwrap(rotations(q).as_euler("ZYX")[:, ::-1], axis=0)) for label, (*_, q) in lines.items()
    }
    truth = shown["true"]
    for row, angle in enumerate(("roll", "pitch", "yaw")):
        moving = np.flatnonzero(np.abs(np.diff(truth[:, row])) * RATE > 1.0)
        begin = log.t[moving[0]]
        for column, span in enumerate(((0.0, log.t[-1]), (begin - 0.3, begin + 2.2))):
            axes = figure.add_subplot(grid[row, column])
            there = (log.t >= span[0]) & (log.t <= span[1])
            for label, (colour, width, _) in lines.items():
                style = "--" if label == "true" else "-"
                axes.plot(log.t[there], shown[label][there, row], style, color=colour, linewidth=width, label=label)
            tidy(axes)
            if column == 0:
                axes.set_ylabel(f"{angle}, deg")
            if row == 0:
                k = gains
                numbers = f"[k1 k2 kI kP] = [{k['k_1']:g} {k['k_2']:g} {k['k_i']:g} {k['k_p']:g}]"
                title(axes, f"{name.capitalize()} redrawn: {numbers}" if column == 0 else "first start and stop")
            if row == 2:
                axes.set_xlabel("t, s")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def dynamics_figure(seeds: tuple[int, ...]):
    """Draw the total error with the sensor at the arm's end, with the arm known, and in the joint."""
    figure = new_figure(9.0, 4.0)
    axes = figure.subplots()
    names = [name for name in measured(seeds, arm_known=True) if not name.startswith(("hybrid seeded", "Kalman"))]
    cases = (
        ("sensor at the arm's end", VERMILION, measured(seeds)),
        ("the same, arm known to the filter", BLUE, measured(seeds, arm_known=True)),
        ("sensor in the joint", GREY, measured(seeds, at_joint=True)),
    )
    for i, (label, colour, values) in enumerate(cases):
        height = [values[name][:, 3].mean() for name in names]
        axes.bar(np.arange(len(names)) + 0.27 * (i - 1), height, 0.25, color=colour, label=label)
        for k, value in enumerate(height):
            axes.annotate(f"{value:.2f}", (k + 0.27 * (i - 1), value), ha="center", va="bottom", fontsize=7, color=INK)
    axes.set_xticks(
        range(len(names)), [name.replace(", ", "\n").replace(" driven", "\ndriven") for name in names], fontsize=8
    )
    axes.set_ylabel("total error, RMS, deg")
    title(axes, "The error common to TRIAD and the hybrid is the acceleration of the arm's end")
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    tidy(axes)
    return figure


def print_measures(found: dict[str, np.ndarray]) -> None:
    """Print the measures of every method, mean over the seeds, and their spread where there are several."""
    print(f"\n{'':30}" + "".join(f"{column:>13}" for column in COLUMNS))
    order = sorted(found, key=lambda name: ("figure" in name, name[-1] if "figure" in name else ""))
    for name in order:
        mean, spread = found[name].mean(axis=0), found[name].std(axis=0)
        shown = [
            f"{a:.2f} +-{b:.2f}" if len(found[name]) > 1 else f"{a:.2f}" for a, b in zip(mean, spread, strict=True)
        ]
        print(f"{name:30}" + "".join(f"{text:>13}" for text in shown))


def print_dynamics(seeds: tuple[int, ...]) -> None:
    """Print how much of the errors is the acceleration of the arm's end."""
    print(f"\nTotal error and largest at a stop, deg   {'on the arm':>16}{'arm known':>16}{'in the joint':>16}")
    cases = (measured(seeds), measured(seeds, arm_known=True), measured(seeds, at_joint=True))
    for name in cases[0]:
        pairs = [case[name].mean(axis=0)[[3, 7]] if name in case else None for case in cases]
        shown = ["-" if pair is None else f"{pair[0]:.2f}  {pair[1]:5.2f}" for pair in pairs]
        print(f"{name:40} " + "".join(f"{text:>16}" for text in shown))


def print_readings(seed: int) -> None:
    """Print what each reading of the equations makes of the two figures."""
    triad = total(swung(seed), run_filters(swung(seed), ["triad"]).attitude["triad"])
    print(f"\nTotal error in deg (TRIAD {triad:.2f})          {'Mahony':>12}{'':8}{'hybrid, driven':>16}")
    print(f"{'':38}{'fig. 3':>10}{'fig. 4':>10}{'fig. 3':>10}{'fig. 4':>10}   as published?")
    for name, sets in by_reading(seed).items():
        mahony, hybrid = ([pair[k] for pair in sets.values()] for k in (0, 1))
        verdict = "yes" if as_published(tuple(mahony), tuple(hybrid), triad) else "no"
        print(f"{name:38}" + "".join(f"{value:10.2f}" for value in (*mahony, *hybrid)) + f"   {verdict}")


def print_slow(seed: int) -> None:
    """Print what a magnetometer at its usual 15 Hz does to those who take the heading of it row by row."""
    print(f"\n{'Magnetometer':40}{'75 Hz: yaw, deg':>16}{'lag, ms':>9}{'15 Hz: yaw, deg':>18}{'lag, ms':>9}")
    for name in ("TRIAD", "QUEST", "Mahony, figure 3", "hybrid driven, figure 3", "hybrid driven, figure 4", "mekf"):
        shown = [by_rate(seed, name, rate)[[2, 4]] for rate in (75.0, 15.0)]
        print(f"{name:40}" + "".join(f"{yaw:16.2f}{lag:9.1f}  " for yaw, lag in shown).rstrip())


def by_rate(seed: int, name: str, mag_rate: float) -> np.ndarray:
    """Return the measures of a method with a magnetometer of this rate, Hz."""
    (chosen, settings), log = FILTERS[name], swung(seed, mag_rate=mag_rate)
    return figures(log, run_filters(log, [chosen], {chosen: settings}).attitude[chosen])


def print_start(seed: int) -> None:
    """Print how long a filter takes that starts at [1 0 0 0] while the arm stands elsewhere."""
    away = np.degrees(rotations(first_attitude(swung(seed))[None]).magnitude()[0])
    print(f"\nStarted at [1 0 0 0], {away:.0f} deg away: within 1 deg of the same filter started by TRIAD after")
    for name in FILTERS:
        if "figure" in name:
            print(f"  {name:24} {found_after(seed, name):5.1f} s")


def print_verdict(found: dict[str, np.ndarray]) -> None:
    """Print whether the paper's claim holds."""
    print("\nDoes the claim hold?")
    mean = {name: values.mean(axis=0) for name, values in found.items()}
    for name in SETS:
        hybrid, triad, whole = mean[f"hybrid driven, {name}"], mean["TRIAD"], mean[f"{WHOLE}, {name}"]
        print(
            f"  {name}: the hybrid lags by {hybrid[4]:.1f} ms and TRIAD by {triad[4]:.1f} ms; starts and stops cost "
            f"{0.5 * (hybrid[6] + hybrid[7]):.1f} and {0.5 * (triad[6] + triad[7]):.1f} deg;\n"
            f"    total error {hybrid[3]:.2f} and {triad[3]:.2f} deg; {WHOLE} {whole[3]:.2f} deg"
        )
    totals = {method: [found[f"{method}, {name}"][:, 3] for name in SETS] for method in (WHOLE, "hybrid driven")}
    runs = [
        as_published(plain, hybrid, triad)
        for plain, hybrid, triad in zip(
            zip(*totals[WHOLE], strict=True),
            zip(*totals["hybrid driven"], strict=True),
            found["TRIAD"][:, 3],
            strict=True,
        )
    ]
    print(f"  as published, with the whole field compared with v_02 = [1 0 0], in {sum(runs)} of {len(runs)} runs.")
    gains = ", ".join(f"{gain.name} = {gain.tuned:.3g}" for gain in tuning().gains)
    print(f"\nTuned on another swing: {gains}.\n" + fill(tuning().sentence, 118))
    print("\n".join(text for text in tuning().remarks if "triad" in text))


def main(folder: str | None = None, count: str = "1") -> None:
    """Print what was measured, and write the figures if there is a folder for them."""
    seeds = tuple(range(1, 1 + int(count)))
    found = measured(seeds)
    print_measures(found)
    print_verdict(found)
    print_readings(seeds[0])
    print_start(seeds[0])
    print_slow(seeds[0])
    print_dynamics(seeds)
    if folder is None:
        return
    drawn = {f"hybrid_{name.replace(' ', '_')}": redrawn(seeds[0], name) for name in SETS}
    drawn["hybrid_dynamics"] = dynamics_figure(seeds)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for name, figure in drawn.items():
        figure.savefig(Path(folder) / f"{name}.png", dpi=80)
    print(f"\n{len(drawn)} figures in {folder}.")


if __name__ == "__main__":
    main(*sys.argv[1:3])
