"""Answers of `imufit diagnose` to logs with common mistakes (tests/mistakes); writes into docs/faults.md.

Run: ``python benches/mistakes.py [--logs N] [--seed FIRST] [--processes P] [--rows ID,ID,...] [--recordings N]
[--keep DIR] [--list FILE] [--write]``. A log takes three seconds; all rows on three simulated logs and the recordings
take half an hour on one core. ``--keep`` keeps the spoilt logs, so that the commands of ``--list`` can be run again.
"""

import argparse
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from mistakes.catalogue import CATALOGUE, Mistake, by_id  # noqa: E402  lies beside the tests
from mistakes.judge import Answer, Judgement, Kind, ask, judge, write  # noqa: E402
from mistakes.sound import MOVING, OTHERS, RECORDINGS, Sound, recordings, simulated  # noqa: E402

PAGE = ROOT / "docs" / "faults.md"
BEGIN, END = "<!-- mistakes -->", "<!-- /mistakes -->"
FIRST_SEED = 1000
"""Seeds from here on were never looked at while faults were built."""
LONG = 600
"""Longest part of an answer that is shown, characters: three faults with their remedies."""


def clean_answer(directory: Path, numbered: tuple[int, Sound]) -> Answer:
    """Answer on a sound log."""
    number, sound = numbered
    return ask(write(sound.log, directory / f"sound_{number}.parquet"))


def one(directory: Path, seed: int, asked: tuple[str, Sound, Answer]) -> Judgement | None:
    """Judge one mistake in one log; its files go unless they are to be kept."""
    name, sound, baseline = asked
    found = judge(by_id(name), sound, baseline, directory, seed)
    if found is not None:
        said = "" if found.right else found.message[:LONG]
        print(f"{name:22} {sound.name:45} {found.kind:30} {said}", file=sys.stderr, flush=True)
    return found


def cases(
    rows: list[Mistake], sounds: list[Sound], answers: list[Answer], logs: int, recorded: int
) -> list[tuple[str, Sound, Answer]]:
    """Mistakes with logs that they apply to: so many simulated ones and so many recordings each."""
    chosen = []
    for place, row in enumerate(rows):
        fitting = [pair for pair in zip(sounds, answers, strict=True) if row.needs <= pair[0].has]
        for real, most in ((False, logs), (True, recorded)):
            own = [pair for pair in fitting if pair[0].real is real]
            # Rows begin with different logs, so that a row seen once is not always seen in the same scenario.
            first = place % max(len(own), 1)
            chosen += [(row.id, *pair) for pair in [*own[first:], *own[:first]][:most]]
    return chosen


def table(rows: list[Mistake], found: list[Judgement]) -> Table:
    """Count outcomes by mistake."""
    lines = []
    for row in rows:
        own = [each for each in found if each.mistake == row.id]
        kinds = Counter(each.kind for each in own)
        right = sum(each.right for each in own)
        asked = "not named" if row.harmless else row.remedy.split(":")[0].split(" that")[0]
        other = len(own) - right - kinds[Kind.UNNOTICED] - kinds[Kind.WRONG_MISSING]
        lines.append(
            (
                row.line,
                row.group.value,
                asked,
                f"{right} of {len(own)}",
                f"{kinds[Kind.UNNOTICED] or ''}",
                f"{kinds[Kind.WRONG_MISSING] or ''}",
                f"{other or ''}",
            )
        )
    header = ("mistake", "group", "required answer", ">right", ">unnoticed", ">wrong MISSING", ">other")
    return Table("", header, tuple(lines))


def summary(found: list[Judgement], sounds: list[Sound], answers: list[Answer]) -> str:
    """Shares over all logs, simulated and real, and what was named in sound logs."""
    lines = []
    for real, words in ((False, "simulated logs"), (True, "stretches of recordings")):
        own = [each for each in found if each.real is real]
        kinds = Counter(each.kind for each in own)
        clean = [answer for sound, answer in zip(sounds, answers, strict=True) if sound.real is real]
        named = sum(bool(answer.faults) or answer.code != 0 for answer in clean)
        lines.append(
            f"In {words}: right in {sum(each.right for each in own)} of {len(own)}, unnoticed "
            f"{kinds[Kind.UNNOTICED]}, wrong MISSING {kinds[Kind.WRONG_MISSING]}. Before they were spoilt, faults were "
            f"named in {named} of {len(clean)}."
        )
    return "\n".join(lines)


def listed(found: list[Judgement]) -> str:
    """Every wrong outcome with its command and answer, the most harmful first."""
    order = list(Kind)
    wrong = sorted((each for each in found if not each.right), key=lambda each: order.index(each.kind))
    return "\n".join(
        f"- **{each.kind}** {each.mistake} ({by_id(each.mistake).line}) in {each.log}: `{each.command}`\n  "
        f"{each.message[:LONG]}"
        for each in wrong
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--logs", type=int, default=3, help="simulated logs for each row")
    parser.add_argument("--seed", type=int, default=FIRST_SEED)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--rows", help="ids of rows, with commas between; otherwise all")
    parser.add_argument("--recordings", type=int, default=len(RECORDINGS), help="recordings for each row")
    parser.add_argument("--keep", type=Path, help="directory for the spoilt logs")
    parser.add_argument("--list", type=Path, help="file for the wrong outcomes")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    rows = [by_id(name) for name in given.rows.split(",")] if given.rows else list(CATALOGUE)
    with TemporaryDirectory() as temporary, ProcessPoolExecutor(given.processes) as pool:
        directory = given.keep or Path(temporary)
        directory.mkdir(parents=True, exist_ok=True)
        made = [simulated(kind, given.seed + k, directory) for k in range(given.logs) for kind in (*MOVING, *OTHERS)]
        sounds = [*made, *(recordings() if given.recordings else ())]
        answers = list(pool.map(partial(clean_answer, directory), enumerate(sounds)))
        asked = cases(rows, sounds, answers, given.logs, given.recordings)
        found = [each for each in pool.map(partial(one, directory, given.seed), asked) if each is not None]
    text = f"Seeds from {given.seed} on.\n{summary(found, sounds, answers)}\n\n{markdown(table(rows, found))}"
    if given.list:
        given.list.write_text(f"{text}\n\n{listed(found)}\n", encoding="utf-8")
    if given.write:
        write_between(PAGE, BEGIN, END, text)
    else:
        print(text)


if __name__ == "__main__":
    main()
