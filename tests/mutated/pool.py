"""Workers, each in a process of its own that is started afresh when an input has ended it, or after so many inputs."""

import json
import os
import re
import select
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from mutated import judge

ROOT = Path(__file__).resolve().parents[2]

INPUTS_OF_A_PROCESS = 300
"""Then a worker is started anew, so that what one input leaves behind cannot fill the memory of the next ones."""

GRACE_S = 20.0
"""The worker ends itself at the limit of the time; if it has not after so long, it is ended from here."""

START_S = 120.0
"""The first answer of a worker comes after its imports."""


class Worker:
    """One process that judges inputs one after another; use it as a context.

    Attributes
    ----------
    seeds : Path
        Folder of the whole files.
    limit : float
        Time after which an input is ended, s.
    """

    def __init__(self, seeds: Path, limit: float = judge.CLOCK_S) -> None:
        self.seeds, self.limit = seeds, limit
        self.folder = tempfile.TemporaryDirectory(prefix="mutated-")
        self.process: subprocess.Popen[bytes] | None = None
        self.done = 0

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        self.folder.cleanup()

    def judged(self, request: dict[str, Any], fresh: bool = False) -> dict[str, Any]:
        """Judge an input; the answer has `faults`, a list of (kind, detail), only if there are any."""
        if fresh or self.done >= INPUTS_OF_A_PROCESS:
            self._end()
        process = self.process or self._start()
        first, self.done = self.done == 0, self.done + 1
        assert process.stdin
        assert process.stdout
        process.stdin.write(json.dumps(request).encode() + b"\n")
        process.stdin.flush()
        limit = self.limit + GRACE_S + (START_S if first else 0.0)
        in_time = bool(select.select([process.stdout], [], [], limit)[0])
        line = process.stdout.readline() if in_time else b""
        if line:
            reply: dict[str, Any] = json.loads(line)
            if "unmade" in reply:
                return {"code": None, "faults": [("not made", reply["unmade"])]}
            return reply
        return self._died(process, in_time)

    def _start(self) -> subprocess.Popen[bytes]:
        paths = [ROOT / "python", ROOT / "tests"]
        one = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "RAYON", "MKL", "ARROW")}
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths)), "MPLBACKEND": "Agg", **one}
        arguments = [str(self.seeds), self.folder.name, str(self._stacks), str(self.limit)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "mutated.worker", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            cwd=ROOT,
        )
        self.done = 0
        return self.process

    @property
    def _stacks(self) -> Path:
        return Path(self.folder.name) / "stacks"

    def _end(self) -> None:
        if self.process:
            self.process.kill()
            self.process.communicate()
        self.process, self.done = None, 0

    def _died(self, process: subprocess.Popen[bytes], in_time: bool) -> dict[str, Any]:
        """Say how a process ended that gave no answer; after the limit of the time it still runs and is ended here."""
        if not in_time:
            process.kill()
        process.communicate(timeout=GRACE_S)
        self.process, self.done = None, 0
        stack = self._stacks.read_text(encoding="utf-8", errors="replace")
        places = re.findall(r'File "(?:.*/python/)?([^"]+)", line (\d+) in (\S+)', stack)
        where = " < ".join(f"{path}:{line} {name}" for path, line, name in places[:4])
        if not in_time or "Timeout" in stack:
            return {"code": None, "faults": [("hang", f"over {self.limit:g} s")], "where": where}
        said = (Path(self.folder.name) / "err").read_bytes()[-600:].decode("utf-8", "replace")
        detail = f"exit status {process.returncode} {stack.splitlines()[:1]} {said}"
        return {"code": process.returncode, "faults": [("process ended", detail)], "where": where}
