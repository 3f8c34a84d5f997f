"""The same candidates, given to generic tools, on the same blind logs: how often each finds the hidden effect.

Every tool gets what imufit has: the residual of the ideal sensor and the columns of every effect of the catalogue, each
channel over its noise, stacked. A tool names effects:

- stepwise: statsmodels' least squares, whole effects added as long as Schwarz's criterion falls; the first is its
  answer, all of them what it found (it gets the triangle of the columns' QR decomposition, which has the same sums of
  squares)
- lasso: scikit-learn's LassoLarsIC by the same criterion over columns of unit length; an effect is in if any of its
  columns is, the one whose columns explain most its answer
- pysindy: sequentially thresholded least squares (STLSQ) over columns of unit length, threshold five standard errors
- imufit: its first diagnosis; `ambiguous` counts with the effect that it puts first

Right is the true effect, or one of its true rivals, as the answer; a false alarm is any effect found where nothing is
hidden. Effects without a column before their search (`gyr.warmup`) are imufit's alone. Needs
``pip install statsmodels scikit-learn pysindy``; a tool that is missing is left out.

Run: ``python benches/generic_tools.py [--logs N] [--seed N] [--write]`` (default: 12 logs of each set, a fresh seed);
``--write`` puts the table into docs/blind.md.
"""

import argparse
import importlib
import secrets
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from imufit import Log, SensorModel, _imufit
from imufit.lab.grade import draw
from imufit.lab.grade.wilson import interval
from imufit.loop import Fit
from marked import write_between

Array = np.ndarray
SETS = ("one", "small", "one-realistic", "nothing")
PAGE = Path(__file__).resolve().parents[1] / "docs" / "blind.md"
BEGIN, END = "<!-- measured by benches/generic_tools.py -->", "<!-- end of what generic tools did -->"


class Problem:
    """Residual of the ideal sensor and columns of every candidate, stacked over channels."""

    def __init__(self, fit: Fit) -> None:
        (log,) = fit.analysis.logs
        evidence, facts = log.raw, log.facts
        slots = [*fit.analysis.model.effects, *fit.analysis.unnamed, *fit.analysis.candidates]
        widths = [
            len(fit.analysis.candidates[key].parameters) if key in fit.analysis.candidates else 3 for key in slots
        ]
        first = np.concatenate([[0], np.cumsum(widths)])
        self.places = {key: np.arange(first[k], first[k + 1]) for k, key in enumerate(slots)}
        self.candidates = [key for key in fit.analysis.candidates if not fit.analysis.candidates[key].searched]
        p = len(fit.estimate.step)
        chunk = next(iter(log.passes.chunks(facts.margin, "columns")))
        zero = np.zeros(p)

        def residual(step: Array) -> list[Array | None]:
            return _imufit.evaluate(evidence, chunk, step)

        base = residual(zero)
        kept = [k for k, values in enumerate(base) if values is not None and np.isfinite(log.raw_variance[k])]
        weights = {k: 1.0 / np.sqrt(log.raw_variance[k]) for k in kept}

        def stacked(channels: list[Array | None]) -> Array:
            return np.concatenate([channels[k] * weights[k] for k in kept])

        y = stacked(base)
        wanted = np.concatenate([self.places[key] for key in (*fit.analysis.unnamed, *self.candidates)])
        x = np.zeros((y.size, p))
        for j in wanted:
            unit = zero.copy()
            unit[j] = 1.0
            x[:, j] = y - stacked(residual(unit))
        known = np.isfinite(y) & np.isfinite(x).all(axis=1)
        self.y, self.x = y[known], x[known]
        length = np.linalg.norm(self.x, axis=0)
        self.used = length > 0.0
        self.x[:, self.used] /= length[self.used]
        self.always = np.concatenate([[0], *(self.places[key] for key in fit.analysis.unnamed)])[1:].astype(int)

    def effects_of(self, coefficients: Array) -> list[str]:
        """Effects with a column that counts, the one that explains most first."""
        size = {key: float(np.linalg.norm(coefficients[self.places[key]])) for key in self.candidates}
        return sorted((key for key in size if size[key] > 0.0), key=lambda key: -size[key])


def stepwise(problem: Problem, sm: object) -> list[str]:
    chosen: list[str] = []
    n = problem.y.size
    corner = np.linalg.qr(np.column_stack([problem.x, problem.y]), mode="r")

    def bic(keys: list[str]) -> float:
        columns = np.concatenate([problem.always, *(problem.places[key] for key in keys)]).astype(int)
        columns = columns[problem.used[columns]]
        if columns.size == 0:
            return float(n * np.log(problem.y @ problem.y / n))
        found = sm.OLS(corner[:, -1], corner[:, columns]).fit()
        return float(n * np.log(found.ssr / n) + found.model.rank * np.log(n))

    now = bic([])
    while len(chosen) < 10:
        offers = {key: bic([*chosen, key]) for key in problem.candidates if key not in chosen}
        best = min(offers, key=offers.__getitem__)
        if not offers[best] < now:
            break
        chosen.append(best)
        now = offers[best]
    return chosen


def lasso(problem: Problem, linear_model: object) -> list[str]:
    found = linear_model.LassoLarsIC(criterion="bic", fit_intercept=False, noise_variance=1.0)
    coefficients = np.zeros(problem.x.shape[1])
    coefficients[problem.used] = found.fit(problem.x[:, problem.used], problem.y).coef_
    return problem.effects_of(coefficients)


def sindy(problem: Problem, pysindy: object) -> list[str]:
    # Columns have unit length and residuals unit variance: a standard error is about one.
    optimizer = pysindy.STLSQ(threshold=5.0, alpha=1e-3, normalize_columns=False)
    coefficients = np.zeros(problem.x.shape[1])
    coefficients[problem.used] = optimizer.fit(problem.x[:, problem.used], problem.y[:, None]).coef_[0]
    return problem.effects_of(coefficients)


TOOLS: tuple[tuple[str, str, Callable[..., list[str]]], ...] = (
    ("stepwise BIC (statsmodels)", "statsmodels.api", stepwise),
    ("lasso BIC (scikit-learn)", "sklearn.linear_model", lasso),
    ("STLSQ (pysindy)", "pysindy", sindy),
)


def answers(log: Log) -> dict[str, tuple[list[str], float]]:
    """Effects that each tool names, its answer first, and seconds of processor time."""
    start = time.process_time()
    fit = SensorModel().fit(log)
    diagnosis = fit.diagnose()
    named = [diagnosis.best] if diagnosis.best is not None else []
    found = {"imufit": ([*named, *diagnosis.ambiguous_with], time.process_time() - start)}
    problem = Problem(fit)
    for name, module, tool in TOOLS:
        try:
            package = importlib.import_module(module)
        except ImportError:
            continue
        start = time.process_time()
        with warnings.catch_warnings():
            # Columns that are the same in a log, and paths that end early.
            warnings.simplefilter("ignore")
            found[name] = (tool(problem, package), time.process_time() - start)
    return found


def share(count: int, of: int) -> str:
    low, high = interval(count, of)
    return f"{count} of {of}: {100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=12, help="logs of each set")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6), help="first seed; fresh without it")
    parser.add_argument("--write", action="store_true", help="put the table into docs/blind.md")
    given = parser.parse_args()
    lines = [
        f"{given.logs} logs of each set, seeds from {given.seed} on.",
        "",
        "| set | tool | right | false names | CPU time a log |",
        "|---|---|---:|---:|---:|",
    ]
    for name in SETS:
        right: dict[str, int] = defaultdict(int)
        more: dict[str, int] = defaultdict(int)
        seconds: dict[str, float] = defaultdict(float)
        for k in range(given.logs):
            puzzle = draw(name, given.seed + k)
            allowed = {*puzzle.truth, *puzzle.rivals}
            for tool, (found, used) in answers(puzzle.simulation.to_log()).items():
                right[tool] += bool(found and found[0] in allowed) if puzzle.truth else not found
                more[tool] += bool(set(found) - allowed)
                seconds[tool] += used
            print(f"\r{name}: {k + 1} of {given.logs} ", end="", file=sys.stderr, flush=True)
        for tool, spent in seconds.items():
            shares = f"{share(right[tool], given.logs)} | {share(more[tool], given.logs)}"
            lines.append(f"| `{name}` | {tool} | {shares} | {spent / given.logs:.1f} s |")
    text = "\n".join(lines)
    print(f"\n{text}")
    if given.write:
        write_between(PAGE, BEGIN, END, text)


if __name__ == "__main__":
    main()
