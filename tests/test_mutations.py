"""Whatever is put to a command: it answers or refuses in one line, soon and in little memory."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from mutated import corpus, draw, judge, seed_files
from mutated.pool import Worker

SEED, INPUTS = 20, 150


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make the whole files that the inputs are mutations of."""
    folder = tmp_path_factory.mktemp("seeds")
    seed_files.make(folder)
    return folder


@pytest.fixture(scope="module")
def worker(seeds: Path) -> Iterator[Worker]:
    with Worker(seeds) as process:
        yield process


@pytest.mark.parametrize("first", range(0, INPUTS, 25))
def test_mutated_inputs_are_answered_or_refused(worker: Worker, seeds: Path, first: int) -> None:
    loaded, failed = seed_files.load(seeds), []
    for index in range(first, first + 25):
        answer = worker.judged({"seed": SEED, "index": index, "left_out": []})
        if "faults" in answer:
            line = draw.case(loaded, SEED, index).shell()
            failed.append(f"benches/mutations.py --seed {SEED} --index {index}: {line!r}: {answer['faults']}")
    assert not failed, "\n".join(failed)


@pytest.mark.parametrize("name", corpus.KEPT)
def test_kept_input_is_answered_or_refused(worker: Worker, name: str) -> None:
    answer = worker.judged({"kept": name})
    assert "faults" not in answer, f"{corpus.KEPT[name].reason}: {answer['faults']} {answer.get('where', '')}"


def outcome(**changes: object) -> judge.Outcome:
    whole = {"code": 2, "out": b"", "err": b"imufit: a.csv: no rows.\n", "seconds": 0.1, "peak": 10**8}
    return judge.Outcome(**{**whole, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("exit code 1", {"code": 1}),
        ("exit code 139", {"code": 139}),
        ("exception", {"code": None, "escaped": "PanicException: x"}),
        ("internal error", {"err": b"imufit: internal error: ValueError: x\n"}),
        ("traceback", {"err": b"imufit: Traceback (most recent call last):\n"}),
        ("panic", {"err": b"imufit: thread 'main' panicked at lib.rs\n"}),
        ("LAPACK", {"out": b" ** On entry to DLASCL parameter number 4 had an illegal value\n"}),
        ("no message", {"err": b""}),
        ("several lines", {"err": b"imufit: a\nb\n"}),
        ("odd message", {"err": b"Error: a\n"}),
        ("long message", {"err": b"imufit: " + b"x" * 4000}),
        ("control character on standard error", {"err": b"imufit: column \x1b[31m\n"}),
        ("control character on standard error", {"err": "imufit: column \x9b2J\n".encode()}),
        ("control character on standard output", {"code": 0, "out": b"wrote nul\0\n"}),
        ("hang", {"seconds": 10.5}),
        ("memory", {"peak": 2 * 10**9}),
        ("JSON", {"code": 0, "written": {"out.json": b'{"x": NaN}'}}),
        ("JSON", {"code": 0, "written": {"out.json": b'{"x": 1'}}),
        ("no answer", {"code": 0}),
    ],
)
def test_broken_rule_is_found(kind: str, changes: dict[str, object]) -> None:
    arguments = ["compare", "a.csv", "--json", "out.json"]
    assert kind in [found for found, _ in judge.faults(arguments, outcome(**changes))]


def test_refusal_and_answer_break_no_rule() -> None:
    arguments = ["compare", "a.csv", "--json", "out.json"]
    assert judge.faults(arguments, outcome()) == []
    assert judge.faults(arguments, outcome(code=0, err=b"", written={"out.json": b'{"x": null}'})) == []


def test_input_is_drawn_by_its_numbers_alone(seeds: Path) -> None:
    loaded = seed_files.load(seeds)
    for index in range(40):
        first, again = (draw.case(loaded, SEED, index) for _ in range(2))
        assert first == again
        assert draw.case(loaded, SEED, index, range(10)).steps == []


HANG = "import time\ntime.sleep(60)\n"
KILL = "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n"
HOG = "x = bytearray(1_200_000_000)\ndel x\n"


@pytest.mark.parametrize(("kind", "program"), [("hang", HANG), ("process ended", KILL), ("memory", HOG)])
def test_worker_survives_and_tells(seeds: Path, tmp_path: Path, kind: str, program: str) -> None:
    """A user's own effect file is the way to let a command hang, end or take memory."""
    (tmp_path / "own.py").write_text(program)
    with Worker(seeds, limit=3.0 if program == HANG else 60.0) as worker:
        answer = worker.judged({"arguments": ["explain", "--effects-from", os.fspath(tmp_path / "own.py")]})
        assert kind in [found for found, _ in answer["faults"]]
        assert "faults" not in worker.judged({"arguments": ["explain", "gyr.bias"]})
