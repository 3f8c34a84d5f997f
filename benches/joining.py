"""`imufit.join` on simulated pairs of a sensor and a reference (tests/join_pairs.py); writes into docs/logs.md.

Run: ``python benches/joining.py [--pairs N] [--seed FIRST] [--processes P] [--write]``. Two hundred pairs take six
minutes on two cores. The pairs come from a generator that shares no code with imufit; seeds below 100 were used while
the search was built, and none of them may stand on the page.
"""

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from imufit.errors import InputError
from imufit.joining import join
from imufit.log import Log
from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import join_pairs  # noqa: E402  lies beside the tests

PAGE = ROOT / "docs" / "logs.md"
BEGIN, END = "<!-- joining -->", "<!-- /joining -->"
FIRST_SEED = 100
"""Seeds from here on were never looked at while the search was built."""
LIMIT_S, PART = 0.002, 0.1
"""A lag counts as right to two milliseconds and a tenth of the interval of the reference."""


class Outcome(NamedTuple):
    """Result of a pair: the answer, and the error of the lag in the middle of what both saw, s."""

    kind: str
    motion: str
    answered: bool
    error: float
    limit: float
    standard_error: float


def outcome(kind: str, seed: int) -> Outcome:
    """Join one pair."""
    one = {"pair": join_pairs.pair, "repetitive": join_pairs.repetitive, "unrelated": join_pairs.unrelated}[kind](seed)
    limit = LIMIT_S + PART * float(np.median(np.diff(one.ref_t)))
    try:
        found = join(Log(t=one.t, acc=one.acc, gyr=one.gyr), Log(t=one.ref_t, ref_q=one.ref_q, ref_p=one.ref_p))
    except InputError:
        return Outcome(kind, one.motion, False, np.nan, limit, np.nan)
    late = one.ref_t[0] - one.lag
    middle = 0.5 * (max(one.t[0], late) + min(one.t[-1], one.ref_t[-1] - one.lag)) - late
    error = found.lag + found.skew * middle - one.lag - one.skew * middle
    return Outcome(kind, one.motion, True, abs(float(error)), limit, found.lag_error)


def table(outcomes: list[Outcome]) -> Table:
    """Count answers by motion."""
    rows = []
    for motion in dict.fromkeys(each.motion for each in outcomes if each.kind == "pair"):
        own = [each for each in outcomes if each.kind == "pair" and each.motion == motion]
        rows.append(_row(motion, own))
    rows.append(_row("all of these", [each for each in outcomes if each.kind == "pair"]))
    for kind, words in (("repetitive", "repeats itself"), ("unrelated", "of another recording, or at rest")):
        own = [each for each in outcomes if each.kind == kind]
        rows.append((words, f"{len(own)}", "", f"{sum(not each.answered for each in own)}", "", ""))
    header = ("motion", ">pairs", ">lag right", ">refused", ">median error, ms", ">largest, ms")
    return Table("", header, tuple(rows))


def _row(words: str, own: list[Outcome]) -> tuple[str, ...]:
    right = sum(each.answered and each.error <= each.limit for each in own)
    errors = 1e3 * np.array([each.error for each in own if each.answered])
    size = (f"{np.median(errors):.2f}", f"{errors.max():.1f}") if errors.size else ("", "")
    return words, f"{len(own)}", f"{right}", f"{sum(not each.answered for each in own)}", *size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=FIRST_SEED)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    fifth = given.pairs // 5
    asked = [("pair", k) for k in range(given.pairs)]
    asked += [(kind, k) for kind in ("repetitive", "unrelated") for k in range(fifth)]
    with ProcessPoolExecutor(given.processes) as pool:
        outcomes = list(pool.map(outcome, [kind for kind, _ in asked], [given.seed + k for _, k in asked]))
    text = f"Seeds from {given.seed} on; a lag is right within 2 ms and a tenth of the reference's interval.\n\n"
    text += markdown(table(outcomes))
    if given.write:
        write_between(PAGE, BEGIN, END, text)
    else:
        print(text)


if __name__ == "__main__":
    main()
