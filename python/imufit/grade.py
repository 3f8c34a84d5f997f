"""The blind protocol: how often the answer is right on logs whose truth is sealed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np

from imufit.diagnose import ladder
from imufit.progress import Progress, silent
from imufit.results import Table
from imufit.simulate import Truth, hidden
from imufit.simulate import grade as grade_answer

SCENARIOS = ("turntable", "poses", "arm", "handheld")
"""Motions of the protocol unless others are asked for; `tilt`, a rig with one axis, is the other one."""
SIZES = ("large", "medium", "small")

FIRST_EFFECTS = (
    "acc.bias",
    "acc.scale",
    "acc.misalignment",
    "acc.lever_arm",
    "acc.bias_temperature",
    "acc.bias_drift",
    "acc.quadratic",
    "acc.cubic",
    "acc.vibration_rectification",
    "acc.delay",
    "acc.saturation",
    "gyr.bias",
    "gyr.scale",
    "gyr.misalignment",
    "gyr.g_sensitivity",
    "gyr.bias_temperature",
    "gyr.bias_drift",
    "gyr.quadratic",
    "gyr.cubic",
    "gyr.scale_asymmetry",
    "gyr.earth_rate",
    "gyr.warmup",
    "gyr.delay",
    "gyr.saturation",
    "mag.hard_iron",
    "mag.soft_iron",
    "mag.current",
    "mag.delay",
    "ref.alignment",
    "ref.tilt",
    "ref.delay",
    "rig.backlash",
    "rig.flexure",
    "rig.periodic",
    "acc.column:vbat",
    "gyr.column:motor_current",
    "mag.column:vbat",
)
"""Effects that may be hidden; each log hides one that its scenario shows apart from the others."""

NOTHING = "nothing"


@dataclass(frozen=True)
class Trial:
    """One blind log.

    Attributes
    ----------
    scenario, size : str
        What was simulated; size ``nothing`` hides nothing.
    seed : int
        Of everything.
    truth : str or None
        The hidden effect.
    verdict, best : str or None
        The answer of the first diagnosis.
    mark : str
        ``right``, ``named among rivals``, ``wrong``, ``missed`` or ``false alarm``.
    ratio_start, ratio_end : float
        Held-out error over noise floor, of the ideal sensor and at the end of the ladder.
    errors : tuple of float
        (estimate - truth) / standard error of each recovered parameter.
    """

    scenario: str
    size: str
    seed: int
    truth: str | None
    verdict: str
    best: str | None
    mark: str
    ratio_start: float
    ratio_end: float
    errors: tuple[float, ...]


@dataclass(frozen=True)
class BlindGrade:
    """Marks of many blind logs."""

    trials: tuple[Trial, ...]

    def of(self, size: str) -> tuple[Trial, ...]:
        """Trials of one size."""
        return tuple(trial for trial in self.trials if trial.size == size)

    def rows(self) -> list[dict[str, Any]]:
        """One row per size: how many logs, how many right, with the 95 % interval."""
        rows = []
        for size in (*SIZES, NOTHING):
            trials = self.of(size)
            if not trials:
                continue
            right = sum(trial.mark in ("right", "named among rivals") for trial in trials)
            wrong = sum(trial.mark in ("wrong", "false alarm") for trial in trials)
            low, high = interval(right, len(trials))
            rows.append(
                {
                    "size": size,
                    "logs": len(trials),
                    "right": right,
                    "wrong": wrong,
                    "share": right / len(trials),
                    "low": low,
                    "high": high,
                    "ratio_start": float(np.median([t.ratio_start for t in trials])),
                    "ratio_end": float(np.median([t.ratio_end for t in trials])),
                }
            )
        return rows

    @property
    def coverage(self) -> float:
        """Share of recovered parameters within two standard errors of the truth; NaN without any."""
        errors = [error for trial in self.trials for error in trial.errors]
        return float(np.mean(np.abs(errors) <= 2.0)) if errors else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """JSON: the table, the coverage, and every trial."""
        return {
            "table": self.rows(),
            "within_two_standard_errors": None if np.isnan(self.coverage) else self.coverage,
            "trials": [{**vars(trial), "errors": list(trial.errors)} for trial in self.trials],
        }

    def table(self) -> Table:
        """Return the table as a person reads it."""
        rows = tuple(
            (
                row["size"],
                f"{row['logs']}",
                f"{row['right']}",
                f"{100 * row['share']:.0f} % ({100 * row['low']:.0f}-{100 * row['high']:.0f})",
                f"{row['wrong']}",
                f"{row['ratio_start']:.3f} -> {row['ratio_end']:.3f}",
            )
            for row in self.rows()
        )
        header = ("hidden effect", ">logs", ">right", ">share (95 %)", ">wrong", ">held-out error, median")
        return Table("Blind logs", header, rows)

    def __str__(self) -> str:
        lines = [str(self.table()), f"Parameters within two standard errors: {100 * self.coverage:.1f} %"]
        lines += [
            f"{t.mark}: {t.scenario}, seed {t.seed}, {t.size}: {t.truth or NOTHING}; answer {t.verdict} {t.best or ''}"
            for t in self.trials
            if t.mark not in ("right", "named among rivals")
        ]
        return "\n".join(lines)


def interval(right: int, n: int) -> tuple[float, float]:
    """95 % interval of a share by Wilson's formula."""
    z = 1.96
    p = right / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))


def trial(scenario: str, seed: int, size: str, options: dict[str, Any] | None = None) -> Trial:
    """Simulate one blind log, climb the ladder, then break the seal and mark the answer."""
    settings = dict(options or {})
    if size == NOTHING:
        simulation, truth = hidden(scenario, seed, nothing=True, **settings)
    else:
        simulation, truth = hidden(scenario, seed, size, candidates=FIRST_EFFECTS, **settings)
    result = ladder(simulation.to_log())
    diagnosis = result.first
    if diagnosis is None:
        raise ValueError("a ladder has at least one diagnosis")
    return Trial(
        scenario=scenario,
        size=size,
        seed=seed,
        truth=next(iter(truth.effects), None),
        verdict=diagnosis.verdict,
        best=diagnosis.best,
        mark=_mark(truth, diagnosis.to_dict()),
        ratio_start=result.ratio_start,
        ratio_end=result.ratio_end,
        errors=_errors(truth, result.fit.parameters),
    )


def _mark(truth: Truth, answer: dict[str, Any]) -> str:
    if not truth.effects and answer["verdict"] != "adequate":
        return "false alarm"
    return str(grade_answer(truth, answer).mark)


def _errors(truth: Truth, parameters: Sequence[Any]) -> tuple[float, ...]:
    return tuple(
        float((p.value - truth.effects[p.effect][p.name]) / p.standard_error)
        for p in parameters
        if p.effect in truth.effects and p.standard_error > 0
    )


def _share_processors(threads: int) -> None:
    """Let the compiled core of this worker use its share of the processors, unless the user says otherwise."""
    os.environ.setdefault("RAYON_NUM_THREADS", str(threads))


def plan(logs: int, nothing: int, seed: int, scenarios: Sequence[str] = SCENARIOS) -> list[tuple[str, int, str]]:
    """Scenario, seed and size of each blind log: scenarios and sizes in turn, all seeds different."""
    count = len(scenarios)
    jobs = [(scenarios[k % count], seed + k, SIZES[(k // count) % 3]) for k in range(logs)]
    return jobs + [(scenarios[k % count], seed + logs + k, NOTHING) for k in range(nothing)]


def grade(
    *,
    logs: int = 60,
    nothing: int = 30,
    seed: int = 0,
    scenarios: Sequence[str] = SCENARIOS,
    processes: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> BlindGrade:
    """Diagnose many simulated logs without knowing what was done to them, and mark the answers.

    Parameters
    ----------
    logs, nothing : int
        Number of logs with one hidden effect and with none.
    seed : int
        First seed; the same seed gives the same logs.
    scenarios : sequence of str
        Motions in turn, of `imufit.simulate.SCENARIOS`.
    processes : int, optional
        Logs worked on at a time; default: one per processor.
    progress : callable, optional
        Called with (logs done, logs in all, what is being done).
    **options
        Passed to the simulation: ``realistic=True``, ``duration=60.0``, ``noise_in_metadata=False``, ...

    Returns
    -------
    BlindGrade
        The marks, and how well the parameters were recovered.
    """
    tell = progress or silent
    jobs = plan(logs, nothing, seed, scenarios)
    trials: list[Trial] = []
    # A fresh interpreter for each worker: the compiled core's threads do not survive a fork.
    workers = processes or os.cpu_count() or 1
    threads = max(1, (os.cpu_count() or 1) // workers)
    with ProcessPoolExecutor(workers, get_context("spawn"), _share_processors, (threads,)) as pool:
        futures = [pool.submit(trial, *job, options) for job in jobs]
        for future in futures:
            trials.append(future.result())
            tell(len(trials), len(jobs), "diagnosing blind logs")
    return BlindGrade(tuple(trials))
