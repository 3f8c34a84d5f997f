"""A process that puts one input after another through the commands; its standard input says which.

It reads a line of JSON for each input and answers with one. When an input takes too long, it writes where it stood and
ends; so does an input that ends the process itself. Run by `mutated.pool`.
"""

import contextlib
import ctypes
import faulthandler
import gc
import importlib
import json
import os
import re
import resource
import shutil
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import imufit
from imufit.cli.app import main as command

from mutated import corpus, draw, judge
from mutated.seed_files import SeedFiles, load

ADDRESS_SPACE = 8 * 10**9
"""Limit of the address space, bytes: of allocators' reserves and maps too, hence far above the limit of the memory."""

LAID_OPEN = 3 * 2**20
"""A file that a command wrote is looked into up to so many bytes."""


def main() -> None:
    """Serve until standard input ends."""
    seeds_folder, work, stacks = map(Path, sys.argv[1:4])
    limit = float(sys.argv[4])
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    requests = os.fdopen(os.dup(0), encoding="utf-8")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    streams = [(work / name).open("w+b") for name in ("out", "err")]
    stack = stacks.open("w", encoding="utf-8")
    os.environ.pop("IMUFIT_DEBUG", None)
    seeds = load(seeds_folder)
    _import_all()
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    faulthandler.enable(stack)
    for number, stream in enumerate(streams, start=1):
        os.dup2(stream.fileno(), number)
    for line in requests:
        request = json.loads(line)
        try:
            case = _case(seeds, request)
        except Exception:
            print(json.dumps({"unmade": traceback.format_exc()}), file=answers, flush=True)
            continue
        stack.seek(0)
        stack.truncate()
        with _guarded(stack, limit):
            outcome = run(case, work / "folder", streams)
        found = judge.faults(case.arguments, outcome)
        reply: dict[str, Any] = {"code": outcome.code, "seconds": outcome.seconds, "peak": outcome.peak}
        reply["command"] = case.arguments[0]
        if outcome.code == judge.UNUSABLE:
            reply["said"] = judge.label("refused", outcome.err[:400].decode("utf-8", "replace"))
        if found:
            reply["faults"] = found
            if any(kind in ("exit code 1", "internal error") for kind, _ in found):
                with _guarded(stack, limit):
                    reply["where"] = _where(case, work / "folder", streams)
        print(json.dumps(reply), file=answers, flush=True)


def _case(seeds: SeedFiles, request: dict[str, Any]) -> draw.Case:
    if "kept" in request:
        return corpus.KEPT[request["kept"]].case(seeds)
    if "arguments" in request:
        return draw.Case(request["arguments"], {})
    return draw.case(seeds, request["seed"], request["index"], request["left_out"])


def _import_all() -> None:
    """Import what the commands import when they are first used, so that no input pays for it."""
    for name in (
        "matplotlib.pyplot",
        "pandas",
        "pyarrow.parquet",
        "scipy.optimize",
        "scipy.signal",
        "imufit.report.page",
    ):
        importlib.import_module(name)
    for name in dir(imufit):
        getattr(imufit, name)


@contextlib.contextmanager
def _guarded(stack: Any, limit: float) -> Any:
    """End the process when it takes too long, from a thread that compiled code cannot hold up."""
    faulthandler.dump_traceback_later(limit, exit=True, file=stack)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def run(case: draw.Case, folder: Path, streams: list[Any]) -> judge.Outcome:
    """Lay the files into a fresh folder and run the command there."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, data in case.files.items():
        (folder / name).write_bytes(data)
    os.chdir(folder)
    for stream in streams:
        stream.seek(0)
        stream.truncate()
    _forget_peak()
    start = time.process_time()
    code, escaped = None, ""
    try:
        code = _called(case.arguments)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException as error:
        escaped = f"{type(error).__name__}: {str(error)[:400]}"
    with contextlib.suppress(Exception):
        sys.stdout.flush()
    with contextlib.suppress(Exception):
        sys.stderr.flush()
    seconds = time.process_time() - start
    out, err = (_content(stream) for stream in streams)
    written = {}
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if path.is_file() and name not in case.files:
            with path.open("rb") as file:
                written[name] = file.read(LAID_OPEN)
    return judge.Outcome(code, out, err, seconds, _peak(), written, escaped)


def _content(stream: Any) -> bytes:
    stream.seek(0)
    data: bytes = stream.read(LAID_OPEN)
    return data


def _called(arguments: list[str]) -> int:
    if arguments[0] == draw.PYTHON:
        return _python(*arguments[1:])
    return command(arguments)


def _python(function: str, path: str) -> int:
    """Call a function of the package that reads a file; what it may raise becomes what the command would say."""
    functions = {"read": imufit.read, "open_log": imufit.open_log, "load_model": imufit.SensorModel.load}
    try:
        functions[function](path)
    except imufit.InputError as error:
        print(f"imufit: {error}", file=sys.stderr)
        return judge.UNUSABLE
    return judge.GOOD


def _forget_peak() -> None:
    """Begin to measure: memory that earlier inputs freed goes back to the system, as at the end of a command."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found[1]) * 1024 if found else 0


def _where(case: draw.Case, folder: Path, streams: list[Any]) -> str:
    """Run the command again with its traceback, and return the last places in it."""
    os.environ["IMUFIT_DEBUG"] = "1"
    try:
        again = run(case, folder, streams)
    finally:
        del os.environ["IMUFIT_DEBUG"]
    places = re.findall(r'File "([^"]+)", line (\d+), in (\S+)', again.err.decode("utf-8", "replace"))
    own = [f"{path.split('python/')[-1]}:{line} {name}" for path, line, name in places if "/imufit/" in path]
    return " < ".join(reversed(own[-3:]))


if __name__ == "__main__":
    main()
