"""The ladder on logs of a second simulator (tests/independent); writes docs/independent.md.

Sets: `nulls` (no sensor effect is hidden), `whole` (whole cheap sensors with five to seven errors each), `outside` (one
disturbance that the catalogue does not hold), `unknown` (no log states the field of the place), `rows` (failures of
real labs, one log each). Seeds of the drawn sets are fresh unless `--seed` is given; the rows have the seed of
tests/test_independent.py.

Run: ``python benches/independent.py [--set NAME]... [--row NAME]... [--seed N] [--logs N] [--processes N] [--write]
[--from FILE]... [--json FILE]``. Without `--write` the tables go to standard output only; with it they go between the
marks of the page. `--from` takes what earlier runs wrote with `--json` in place of a new one.
"""

import argparse
import importlib
import json
import platform
import secrets
import sys
import tempfile
import traceback
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from imufit.lab.grade.blind_grade import share
from imufit.lab.grade.protocol import side_by_side
from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
sys.path.insert(0, str(ROOT / "tests" / "independent"))

import independent_answer  # noqa: E402  lies beside the tests
from independent_answer import Answer, Case  # noqa: E402
from lab_failures import ROWS  # noqa: E402

PAGE = ROOT / "docs" / "independent.md"
BEGIN, END = "<!-- measured by benches/independent.py -->", "<!-- end of what was measured -->"
CRASH = "crash"

DRAWN = {"nulls": "nulls", "whole": "whole_sensor", "outside": "outside", "unknown": "unknown_field"}
"""Module of each set that is drawn by a seed."""

FULL = {"nulls": 300, "whole": 60, "outside": 120, "unknown": 150, "rows": len(ROWS)}
"""Logs of a full run. No false name leaves at most 1.3 % in 300 logs and 3.1 % in 120 (upper end of Wilson's interval);
60 whole sensors hold some 350 effects, so that a recall of 90 % is known within 3 %. 150 logs of an unknown field are
six of each kind."""


@dataclass(frozen=True)
class Judged:
    """One log, what the ladder said about it, and what is wrong in that; plain values, for JSON."""

    set: str
    seed: int
    name: str
    said: str
    steps: list[str]
    end: str
    truth: list[str]
    false_names: list[str]
    right_verdict: bool
    added_false: int
    within: list[bool]
    faults: list[str]

    def __str__(self) -> str:
        which = f"--set rows --row {self.name} --seed {self.seed}"
        if self.set != "rows":
            which = f"--set {self.set} --seed {self.seed} --logs 1"
            which += f": {self.name}"
        return f"{which}: {', '.join(self.faults)}; answer {self.said}"


def drawn(which: str, row: str, seed: int) -> Case:
    case: Case = ROWS[row](seed) if which == "rows" else importlib.import_module(DRAWN[which]).draw(seed)
    return case


def judged(which: str, row: str, seed: int) -> Judged:
    """Draw one log, let the ladder answer, and mark the answer; an exception is a fault like others."""
    case = drawn(which, row, seed)
    with tempfile.TemporaryDirectory() as folder:
        try:
            said = independent_answer.answer(case, Path(folder))
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1].name
            said = Answer(CRASH, CRASH, remarks=(f"{type(error).__name__} in {place}: {error}",))
    return Judged(
        set=which,
        seed=seed,
        name=case.name,
        said=str(said),
        steps=list(said.steps),
        end=said.end,
        truth=sorted(case.effects),
        false_names=independent_answer.false_names(case, said),
        right_verdict=independent_answer.verdict(case, said) in case.verdicts,
        added_false=len(case.false_names(frozenset(said.steps))),
        within=independent_answer.within(case, said),
        faults=independent_answer.faults(case, said),
    )


def jobs(sets: Sequence[str], rows: Sequence[str], logs: int | None, seed: int | None) -> list[tuple[str, str, int]]:
    first = secrets.randbelow(10**6) if seed is None else seed
    found = [(name, "", first + k) for name in sets if name in DRAWN for k in range(logs or FULL[name])]
    if "rows" in sets:
        found += [("rows", row, independent_answer.SEED if seed is None else seed) for row in rows or ROWS]
    return found


def told(done: int, of: int, _what: str) -> None:
    print(f"\r{done} of {of} logs ", end="", file=sys.stderr, flush=True)


def shown(values: Iterable[bool]) -> str:
    """Write how many of how many, and the 95 % interval of the share."""
    each = list(values)
    if not each:
        return "-"
    found = share(each)
    return f"{found['count']} of {found['of']}: {100 * found['low']:.1f} to {100 * found['high']:.1f} %"


def set_row(which: str, logs: list[Judged]) -> tuple[str, ...]:
    added = [step in log.truth for log in logs for step in log.steps]
    false = sum(log.added_false for log in logs)
    precise = [True] * (len(added) - false) + [False] * false
    recalled = [effect in log.steps for log in logs for effect in log.truth]
    counted = which in ("whole", "unknown")
    return (
        f"`{which}`",
        f"{len(logs)}",
        shown(bool(log.false_names) for log in logs),
        shown(log.right_verdict for log in logs),
        shown(recalled) if counted else "-",
        shown(precise) if counted else "-",
        shown(inside for log in logs for inside in log.within),
        shown(log.end == "adequate" for log in logs),
    )


def by_set(found: list[Judged]) -> dict[str, list[Judged]]:
    return {name: logs for name in FULL if (logs := [each for each in found if each.set == name])}


def set_table(found: list[Judged]) -> Table:
    header = (
        "set",
        ">logs",
        ">logs with a false name",
        ">right verdict",
        ">hidden effects added (recall)",
        ">added effects not false (precision)",
        ">parameters within 2 SE",
        ">`adequate` ends",
    )
    return Table("", header, tuple(set_row(name, logs) for name, logs in by_set(found).items()))


def row_table(rows: list[Judged]) -> Table:
    lines = tuple((f"`{row.name}`", cell(row.said), cell(", ".join(row.faults)) or "-") for row in rows)
    return Table("", ("row", "answer", "open fault"), lines)


def cell(text: str) -> str:
    """Return text that a cell of a Markdown table can hold."""
    return " ".join(text.replace("|", "\\|").split())


def size(which: str, logs: list[Judged]) -> str:
    """Say how many logs there were beside a full run, and their seeds."""
    seeds = [log.seed for log in logs]
    span = f"seed {seeds[0]}" if min(seeds) == max(seeds) else f"seeds {min(seeds)} to {max(seeds)}"
    return f"`{which}` {len(logs)} of {FULL[which]} ({span})"


def section(found: list[Judged]) -> str:
    sizes = ". ".join(size(name, logs) for name, logs in by_set(found).items())
    parts = [
        f"Logs of each set, of as many as a full run has. {sizes}. {platform.machine()}, "
        f"CPython {platform.python_version()}.",
        markdown(set_table(found)),
    ]
    if rows := [each for each in found if each.set == "rows"]:
        parts += ["### Failures of real labs", markdown(row_table(rows))]
    if wrong := [each for each in found if each.faults]:
        lines = "\n".join(cell(str(each)) for each in wrong)
        parts += [
            "### Faults",
            "Every answer with a fault, with what repeats that log alone after `python benches/independent.py`:",
            f"```text\n{lines}\n```",
        ]
    return "\n\n".join(parts)


def read_runs(files: list[Path]) -> list[Judged]:
    runs: list[list[dict[str, Any]]] = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    return [Judged(**each) for run in runs for each in run]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="put what was measured into docs/independent.md")
    parser.add_argument("--seed", type=int, help="first seed of each set, and the seed of the rows")
    parser.add_argument("--logs", type=int, help="logs of each drawn set; a full run without it")
    parser.add_argument("--processes", type=int, default=2, help="logs at a time")
    parser.add_argument("--set", dest="sets", action="append", choices=list(FULL), help="only these sets; repeatable")
    parser.add_argument("--row", dest="rows", action="append", choices=list(ROWS), help="only these rows; repeatable")
    parser.add_argument("--from", dest="files", action="append", type=Path, help="a run's --json; repeatable")
    parser.add_argument("--json", type=Path, help="write every answer to this file")
    given = parser.parse_args()
    if given.files:
        found = read_runs(given.files)
    else:
        todo = jobs(given.sets or list(FULL), given.rows or (), given.logs, given.seed)
        found = side_by_side(judged, todo, given.processes, told)
        print(file=sys.stderr)
    text = section(found)
    print(text)
    if given.json:
        given.json.write_text(json.dumps([asdict(each) for each in found], indent=1) + "\n", encoding="utf-8")
    if given.write:
        write_between(PAGE, BEGIN, END, text)


if __name__ == "__main__":
    main()
