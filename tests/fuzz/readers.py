"""Any bytes for everything in Python that reads a file or a text from outside, guided by the lines that they reach.

Run: ``python tests/fuzz/readers.py [TARGET]... [--seconds S] [--seed N] [--corpus DIR]``; it needs atheris. The time is
shared by the targets. A target begins with whole files, the kept inputs of `mutated.corpus`, and what earlier runs
left in DIR. It ends at the first input that raises anything but an InputError, or one whose message breaks a rule of
`mutated.judge`, and writes it to the current folder as ``TARGET-crash-...``: put it into the kept inputs.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "python")]

LONGEST = 8192
"""Bytes of an input: a header and some rows; longer files only repeat what their readers do with a row."""
# The package is imported where it is used: atheris has to see its modules first.
MEMORY_MB, SECONDS_OF_AN_INPUT = 1000, 10
"""Limits of `mutated.judge`."""
START_S = 60
"""Time for imports and the seeds besides the time of a target; a target that takes longer is ended as hanging."""

Target = Callable[[bytes], None]


def file_target(name: str, read: Callable[[Path], object]) -> Callable[[Path], Target]:
    """Make a target that writes its bytes to a file and reads that."""

    def made(folder: Path) -> Target:
        path = folder / name

        def put(data: bytes) -> None:
            path.write_bytes(data)
            read(path)

        return put

    return made


def text_target(read: Callable[[str], object]) -> Callable[[Path], Target]:
    """Make a target that hands its bytes over as text; what is no UTF-8 comes as it comes from a file."""
    return lambda _: lambda data: read(data.decode("utf-8", "surrogateescape")) and None


def _log(path: Path) -> None:
    import imufit

    imufit.read(path)


def _transcript(path: Path) -> None:
    import imufit

    imufit.read(path, mapping={"t": "row[100Hz]"})


def _model(path: Path) -> None:
    import imufit

    imufit.SensorModel.load(path)


def _sidecar(path: Path) -> None:
    import imufit

    log = path.with_suffix(".csv")
    log.write_bytes(b"t,acc_x,acc_y,acc_z\n0,0,0,9.8\n0.01,0,0,9.8\n")
    imufit.read(log)


def _answer(path: Path) -> None:
    from imufit.cli.reveal import read_answer

    read_answer(path)


def _named_values(text: str) -> None:
    from imufit.log import named_values

    named_values.named_values(text)
    named_values.names_in(text)
    named_values.is_table_line(text)
    named_values.lead_of(text)


def _units(text: str) -> None:
    from imufit.errors import InputError
    from imufit.log import units

    unit = text.partition("\n")[0]
    units.lookup(unit)
    units.unit_in_header(unit, "acc_x")
    for read in (lambda: units.conversion("acc_x", unit), lambda: units.parse_mapping(text)):
        try:
            read()
        except InputError as error:
            _judge(error)


TARGETS = {
    "csv": file_target("log.csv", _log),
    "npz": file_target("log.npz", _log),
    "parquet": file_target("log.parquet", _log),
    "transcript": file_target("log.log", _transcript),
    "model": file_target("m.toml", _model),
    "sidecar": file_target("log.toml", _sidecar),
    "answer": file_target("a.json", _answer),
    "named_values": text_target(_named_values),
    "units": text_target(_units),
}

LINES = (
    b"IMU a: accel=(1, 2, 3) temp=21",
    b"12:30:01.250 -> ax=1 ay=-2.5e3",
    b'{"ax": 1, "ay": null}',
    b"Accel X: 1 Y: 2 Z: 3",
    b"Acc (g): 1 2 3",
    b"\x1b[0;32mI (12) x: a=1\x1b[0m",
)
UNITS = (b"g", b"16384 LSB/g", b"340 LSB/degC + 36.53", b"*0.003 + 21", b"0.061 mg/LSB", b"t=row[100Hz],acc_x=-a[g]")


def _judge(error: Exception) -> None:
    from mutated import judge

    broken = judge.faults([], judge.Outcome(judge.UNUSABLE, b"", f"imufit: {error}".encode("utf-8", "replace"), 0, 0))
    if broken:
        raise AssertionError(broken) from error


def lay_seeds(folder: Path) -> None:
    """Write what each target begins with: whole files cut short, and the kept inputs, into a folder by its name."""
    from mutated import corpus, formats, seed_files

    made = folder / "made"
    made.mkdir()
    seed_files.make(made)
    seeds = seed_files.load(made)
    found: dict[str, list[bytes]] = {name: [] for name in TARGETS}
    for log in ("handheld", "poses"):
        columns = {name: values[:20] for name, values in seeds.logs[log].items()}
        found["csv"].append(formats.csv(columns))
        found["npz"].append(formats.npz(columns))
        found["parquet"].append(formats.parquet(columns, b'{"frame": "NED", "gravity": 9.8}', Random(1)))
        found["transcript"] += [formats.transcript(columns, Random(k)) for k in range(6)]
    answer = json.loads(seeds.files["answer.json"])
    found["answer"].append(json.dumps({**answer, "candidates": answer["candidates"][:2], "noise": []}).encode())
    by_suffix = {"csv": "csv", "npz": "npz", "parquet": "parquet", "toml": "model", "json": "answer"}
    files = [*seeds.files.items(), *(item for kept in corpus.KEPT.values() for item in kept.files(seeds).items())]
    for name, data in files:
        target = "sidecar" if name.endswith(".toml") and b"kind" not in data else by_suffix.get(name.rpartition(".")[2])
        if target and len(data) <= LONGEST:
            found[target].append(data)
    found["named_values"], found["units"] = list(LINES), list(UNITS)
    for target, contents in found.items():
        (folder / target).mkdir()
        for k, data in enumerate(contents):
            (folder / target / f"{k}").write_bytes(data)


def fuzz(target: str, seconds: int, seed: int, folders: list[str]) -> None:
    """Run one target in this process, which atheris ends."""
    import atheris

    with atheris.instrument_imports(include=["imufit", "zipfile", "tomllib"]):
        import zipfile  # noqa: F401

        import imufit
        import imufit.cli.app
        import imufit.log.named_values
        import imufit.log.npz
        import imufit.log.parquet
        import imufit.log.transcript
        import imufit.model.effect_stack  # noqa: F401
    from imufit.errors import InputError

    with tempfile.TemporaryDirectory() as name:
        put = TARGETS[target](Path(name))

        def one(data: bytes) -> None:
            try:
                put(data)
            except InputError as error:
                _judge(error)

        limits = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", f"-rss_limit_mb={MEMORY_MB}", f"-seed={seed}"]
        limits += [f"-timeout={SECONDS_OF_AN_INPUT}", f"-artifact_prefix={target}-", "-print_final_stats=1"]
        atheris.Setup([sys.argv[0], *limits, *folders], one)
        atheris.Fuzz()


def run_all(targets: list[str], seconds: int, seed: int, corpus: Path | None) -> int:
    """Run targets one after another, each in a process of its own; return how many of them failed."""
    failed = []
    with tempfile.TemporaryDirectory() as name:
        lay_seeds(Path(name))
        for target in targets:
            folders = [str(Path(name) / target)]
            if corpus:
                (corpus / target).mkdir(parents=True, exist_ok=True)
                folders.insert(0, str(corpus / target))
            share = max(1, seconds // len(targets))
            one = [sys.executable, __file__, target, "--seconds", str(share), "--seed", str(seed), "--inside", *folders]
            try:
                done = subprocess.run(
                    one, check=False, timeout=share + START_S, capture_output=True, text=True, errors="replace"
                )
                text, code = done.stderr + done.stdout, done.returncode
            except subprocess.TimeoutExpired as late:
                text, code = str(late), 1
            runs = [line.split()[-1] for line in text.splitlines() if "number_of_executed_units" in line]
            said = "failed" if code else "held"
            print(f"{target}: {said}, {runs[-1] if runs else 0} inputs", flush=True)
            if code:
                failed.append(target)
                print(text[-3000:], file=sys.stderr)
    return len(failed)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)}; without it all")
    parser.add_argument("--seconds", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0, help="of the inputs; 0: another one each time")
    parser.add_argument("--corpus", type=Path)
    parser.add_argument("--inside", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if unknown := set(given.targets) - set(TARGETS):
        parser.error(f"unknown target {', '.join(sorted(unknown))}")
    if given.inside:
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        fuzz(given.targets[0], given.seconds, given.seed, given.inside)
        return 0
    return int(run_all(given.targets or list(TARGETS), given.seconds, given.seed, given.corpus) > 0)


if __name__ == "__main__":
    sys.exit(main())
