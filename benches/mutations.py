"""Mutated inputs (tests/mutated), each put to one of the commands that read; writes into docs/reliability.md.

Run: ``python benches/mutations.py [--inputs N] [--seed S] [--processes P] [--json F] [--keep DIR] [--index K]...
[--from F] [--write]``. Ten thousand inputs take half an hour on one core. An input is drawn by seed and index alone:
``--seed S --index K`` puts it again, and ``--keep DIR`` lays it there with its command line, without the steps that the
failure does not need. `--from` takes what an earlier run wrote with `--json` in place of a new one; with `--write` the
summary goes between the marks of the page, otherwise to standard output. The exit status is 1 if any input failed.
"""

import argparse
import json
import platform
import secrets
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from mutated import draw, judge, seed_files  # noqa: E402  lies beside the tests
from mutated.pool import Worker  # noqa: E402

PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- mutations -->", "<!-- /mutations -->"

REDUCTIONS = 12
"""Attempts to leave out a step of an input that failed; an input has at most six steps."""

Answer = dict[str, Any]


def put(seeds: Path, seed: int, indexes: Sequence[int], processes: int, told: Callable[[Answer], None]) -> list[Answer]:
    """Put the inputs to the commands; answers with faults say how to see them again."""
    local, workers = threading.local(), []

    def one(index: int) -> Answer:
        if not hasattr(local, "worker"):
            local.worker = Worker(seeds)
            workers.append(local.worker)
        answer = judged(local.worker, seed, index)
        told(answer)
        return answer

    with ThreadPoolExecutor(processes) as pool:
        try:
            return list(pool.map(one, indexes))
        finally:
            pool.shutdown(cancel_futures=True)
            for worker in workers:
                worker.__exit__()


def judged(worker: Worker, seed: int, index: int, left_out: Sequence[int] = ()) -> Answer:
    """Judge one input; what failed is judged once more in a fresh process, so that no earlier input is blamed on it."""
    request = {"seed": seed, "index": index, "left_out": list(left_out)}
    answer = worker.judged(request)
    if "faults" in answer:
        again = worker.judged(request, fresh=True)
        answer["again"] = "faults" in again
        answer["classes"] = sorted({judge.label(*fault) for fault in answer["faults"]})
    return {"seed": seed, "index": index, **answer}


def smallest(worker: Worker, seeds: seed_files.SeedFiles, failed: Answer) -> tuple[draw.Case, list[int]]:
    """Leave out every step of an input that its failure does not need."""
    seed, index = failed["seed"], failed["index"]
    kinds, left_out = {kind for kind, _ in failed["faults"]}, []
    count = len(draw.case(seeds, seed, index).steps)
    for step in range(min(count, REDUCTIONS)):
        trial = judged(worker, seed, index, [*left_out, step])
        if kinds & {kind for kind, _ in trial.get("faults", ())}:
            left_out.append(step)
    return draw.case(seeds, seed, index, left_out), left_out


def keep(folder: Path, case: draw.Case, failed: Answer) -> None:
    """Lay an input into a folder of its own, with the command line and the reason."""
    place = folder / f"{failed['seed']}-{failed['index']}"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for name, data in case.files.items():
        (place / name).write_bytes(data)
    said = [f"{kind}: {detail}" for kind, detail in failed["faults"]]
    told = {"arguments": case.arguments, "steps": case.steps, "faults": said, "where": failed.get("where", "")}
    (place / "command.json").write_text(json.dumps(told, indent=1))
    (place / "command.sh").write_text(case.shell() + "\n", errors="backslashreplace")


def classes(failed: Sequence[Answer]) -> list[tuple[str, str, list[Answer]]]:
    """Gather failures by the class of their first fault and the place, most frequent first."""
    found: dict[tuple[str, str], list[Answer]] = {}
    for answer in failed:
        place = answer.get("where", "").split(" < ")[0]
        found.setdefault((answer["classes"][0], place), []).append(answer)
    return [(*key, answers) for key, answers in sorted(found.items(), key=lambda item: -len(item[1]))]


def summary(run: dict[str, Any]) -> str:
    """Write what came of a run: by command, and the failures by class."""
    answers = run["answers"]
    failed = [answer for answer in answers if "faults" in answer]
    lines = [
        f"{len(answers)} inputs of seed {run['seed']}, {run['machine']}, {run['seconds'] / 60:.0f} minutes: "
        f"{sum(a['code'] == judge.GOOD for a in answers)} answered, "
        f"{sum(a['code'] == judge.UNUSABLE for a in answers)} refused, {len(failed)} failed. "
        f"The slowest took {max((a.get('seconds', judge.LIMIT_S) for a in answers), default=0):.1f} s, "
        f"the largest {max((a.get('peak', 0) for a in answers), default=0) / 1e6:.0f} MB.",
        "",
        markdown(table(answers)),
    ]
    if failed:
        lines += ["", "Failures:", ""]
        lines += [f"- {len(each)} x {name} ({place or 'no place'})" for name, place, each in classes(failed)]
    return "\n".join(lines)


def table(answers: Sequence[Answer]) -> Table:
    counts = Counter(answer.get("command", "?") for answer in answers)
    rows = []
    for command, n in sorted(counts.items()):
        own = [answer for answer in answers if answer.get("command", "?") == command]
        codes = [sum(answer["code"] == code for answer in own) for code in (judge.GOOD, judge.UNUSABLE)]
        rows.append((f"`{command}`", f"{n}", *(f"{k}" for k in codes), f"{sum('faults' in answer for answer in own)}"))
    return Table("", ("command", "inputs", "answered", "refused", "failed"), tuple(rows))


def progress(of: int) -> Callable[[Answer], None]:
    counts, lock = Counter[str](), threading.Lock()

    def told(answer: Answer) -> None:
        with lock:
            counts["done"] += 1
            if "faults" in answer:
                counts["failed"] += 1
                which = f"--seed {answer['seed']} --index {answer['index']}"
                kind, detail = answer["faults"][0]
                print(f"\n{which}: {kind}: {detail[:300]!r} {answer.get('where', '')}", file=sys.stderr)
            if counts["done"] % 20 == 0:
                print(f"\r{counts['done']} of {of}, {counts['failed']} failed ", end="", file=sys.stderr, flush=True)

    return told


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--index", type=int, action="append", help="only this input; repeatable")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--keep", type=Path, help="lay every failed input into this folder")
    parser.add_argument("--from", dest="source", type=Path)
    parser.add_argument("--write", action="store_true")
    return parser.parse_args()


def new_run(given: argparse.Namespace) -> dict[str, Any]:
    seed = secrets.randbelow(10**6) if given.seed is None else given.seed
    indexes = given.index or range(given.inputs)
    with tempfile.TemporaryDirectory(prefix="mutated-seeds-") as name:
        folder, start = Path(name), time.monotonic()
        seed_files.make(folder)
        answers = put(folder, seed, indexes, given.processes, progress(len(indexes)))
        seconds = time.monotonic() - start
        seeds = seed_files.load(folder)
        with Worker(folder) as worker:
            for answer in answers:
                if "faults" not in answer or answer["faults"][0][0] == "not made":
                    continue
                case, answer["left_out"] = smallest(worker, seeds, answer) if given.keep else (None, [])
                case = case or draw.case(seeds, seed, answer["index"])
                answer["line"], answer["steps"] = case.shell(), case.steps
                answer["command"] = case.arguments[0]
                if given.keep:
                    keep(given.keep, case, answer)
    machine = f"{platform.system()} {platform.machine()}, CPython {platform.python_version()}"
    return {"seed": seed, "seconds": seconds, "machine": machine, "answers": answers}


def main() -> int:
    given = arguments()
    run = json.loads(given.source.read_text()) if given.source else new_run(given)
    if given.json:
        given.json.write_text(json.dumps(run))
    text = summary(run)
    if given.write:
        write_between(PAGE, BEGIN, END, text)
    else:
        print(text)
    return int(any("faults" in answer for answer in run["answers"]))


if __name__ == "__main__":
    sys.exit(main())
