"""Run the shell and Python blocks of a Markdown page and hold the pasted output against what they print.

    python docs/blocks.py README.md docs/logs.md            # check
    python docs/blocks.py --write README.md docs/logs.md    # paste anew
    python docs/blocks.py --write                           # every page of the site

A block ```sh or ```python with a block ```text right behind it prints that text; a last line "..." stands for whatever
else it prints. Numbers may differ a little between machines. A shell block whose text holds an error message may fail,
any other may not. Blocks of a page are one session: shell blocks share a folder, Python blocks their names as well.
A block that is not run says so and why, for the reader to see: ```sh title="Not run by the tests: a board is needed".
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

ROOT = Path(__file__).resolve().parent.parent
FENCE = re.compile(
    r"^(?P<ticks>`{3,})(?P<language>\w+)(?P<info>[^\n`]*)\n(?P<text>.*?)^(?P=ticks)$", re.MULTILINE | re.DOTALL
)
RUN = ("sh", "python")
NOT_RUN = re.compile(r'^ title="Not run by the tests: (?P<reason>[^"]+)"$')
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ERROR = re.compile(r"^imufit: ", re.MULTILINE)
REST = "..."
WIDTH = "118"
LONGEST = 120.0
"""Time (s) after which a block is stopped: four times what the slowest takes on a busy machine."""
LENT = ("examples", "benches")
"""Folders of the repository that the blocks find beside them."""

END = "<end of the block>"
"""Line with which the interpreter of a page's Python blocks ends each of them, with 0 or 1 behind it."""
INTERPRETER = f"""
import json, sys, traceback
names = {{"__name__": "__main__"}}
for line in sys.stdin:
    failed = 0
    try:
        exec(compile(json.loads(line), "<block>", "exec"), names)
    except BaseException:
        failed = 1
        traceback.print_exc()
    print("{END}", failed, flush=True)
"""


@dataclass(frozen=True)
class Block:
    """A block that is run, the line it starts in, and what it should print (None = not stated)."""

    language: str
    code: str
    line: int
    expected: str | None
    place: tuple[int, int] | None


def fences(page: str) -> Iterator[tuple[re.Match[str], str | None]]:
    """Shell and Python blocks of a page, each with the reason why it is not run (None = it is)."""
    for match in FENCE.finditer(page):
        if match["language"] in RUN:
            told = NOT_RUN.match(match["info"])
            yield match, None if told is None else told["reason"]


def blocks(page: str) -> list[Block]:
    """Blocks of a page that are run, in order."""
    found = list(FENCE.finditer(page))
    following = dict(zip([match.start() for match in found], [*found[1:], None], strict=False))
    out = []
    for match, reason in fences(page):
        if reason is not None:
            continue
        after = following[match.start()]
        behind = after is not None and after["language"] == "text" and not page[match.end() : after.start()].strip()
        printed = after if behind else None
        line = page.count("\n", 0, match.start("text"))
        place = None if printed is None else printed.span("text")
        out.append(Block(match["language"], match["text"], line, None if printed is None else printed["text"], place))
    return out


class Session:
    """State that the blocks of one page share: a folder, and an interpreter from the first Python block on.

    Parameters
    ----------
    folder : Path
        Where files are written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
        self._environment = {
            **os.environ,
            "PATH": path,
            "COLUMNS": WIDTH,
            "MPLBACKEND": "agg",
            "PYTHONIOENCODING": "utf-8",
        }
        self._python: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._python is not None:
            self._python.communicate()

    def run(self, block: Block) -> str:
        """Run a block; return what it prints, of a shell block standard error after standard output.

        Raises
        ------
        AssertionError
            It fails although no error message is pasted behind it.
        """
        may_fail = ERROR.search(block.expected or "") is not None
        failed, printed = self._shell(block, may_fail=may_fail) if block.language == "sh" else self._in_python(block)
        assert not failed or may_fail, f"line {block.line} failed:\n{printed}"
        return printed

    def _shell(self, block: Block, *, may_fail: bool) -> tuple[bool, str]:
        command = ["bash", "-c" if may_fail else "-ec", block.code]
        # A group of its own, since what a block started in the background has to end with it.
        running = subprocess.Popen(
            command,
            cwd=self.folder,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            output, errors = running.communicate(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            os.killpg(running.pid, signal.SIGKILL)
            output, errors = running.communicate()
            return True, tidy(f"{output}{errors}\nstopped after {LONGEST:.0f} s")
        return running.returncode != 0, tidy(output + errors)

    def _in_python(self, block: Block) -> tuple[bool, str]:
        if self._python is None:
            self._python = subprocess.Popen(
                [sys.executable, "-c", INTERPRETER],
                cwd=self.folder,
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
        assert self._python.stdin is not None
        assert self._python.stdout is not None
        limit = threading.Timer(LONGEST, self._python.kill)
        limit.start()
        self._python.stdin.write(json.dumps(block.code) + "\n")
        self._python.stdin.flush()
        lines: list[str] = []
        for line in self._python.stdout:
            if line.startswith(END):
                limit.cancel()
                return line.split()[-1] != "0", tidy("".join(lines))
            lines.append(line)
        limit.cancel()
        self._python = None
        return True, tidy("".join([*lines, f"the interpreter ended, or was stopped after {LONGEST:.0f} s"]))


def run(block: Block, folder: Path) -> str:
    """Run a single block in a folder."""
    with Session(folder) as session:
        return session.run(block)


def tidy(text: str) -> str:
    """Text without blanks at line ends and without two empty lines in a row."""
    lines = "\n".join(line.rstrip() for line in text.splitlines())
    return re.sub(r"\n{3,}", "\n\n", lines).strip("\n") + "\n"


def shortened(printed: str, expected: str) -> str:
    """Cut what is printed to the length of what was pasted, if that ends in "..."."""
    wanted = expected.splitlines()
    if not wanted or wanted[-1] != REST:
        return printed
    return "\n".join([*printed.splitlines()[: len(wanted) - 1], REST]) + "\n"


def differences(printed: str, expected: str) -> list[str]:
    """Lines in which words differ, or numbers by more than the last digits that machines may disagree about."""
    out = []
    got, wanted = shortened(printed, expected).splitlines(), tidy(expected).splitlines()
    for number, line in enumerate(wanted):
        other = got[number] if number < len(got) else "(nothing)"
        words = [NUMBER.sub("#", text).split() for text in (line, other)]
        numbers = [[float(n) for n in NUMBER.findall(text)] for text in (line, other)]
        near = len(numbers[0]) == len(numbers[1]) and all(
            abs(a - b) <= 0.03 * max(abs(a), abs(b)) + 0.011 for a, b in zip(*numbers, strict=True)
        )
        if words[0] != words[1] or not near:
            out += [f"- {line}", f"+ {other}"]
    return out + [f"+ {line}" for line in got[len(wanted) :]]


def prepare(folder: Path) -> None:
    """Let a folder hold what the pages refer to."""
    for name in LENT:
        (folder / name).symlink_to(ROOT / name)


def pages() -> list[str]:
    """Pages whose blocks are run, as the navigation of the site names them, and the README, from the root on."""
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    return ["README.md", *(f"docs/{name}" for name in re.findall(r": (\S+\.md)$", navigation, re.MULTILINE))]


def main() -> int:
    """Check or paste the output of the blocks of pages."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--write", action="store_true", help="paste what is printed")
    parser.add_argument("pages", nargs="*", type=Path, help="default: every page of the site")
    arguments = parser.parse_args()
    stale = 0
    for file in arguments.pages or [ROOT / name for name in pages()]:
        page = file.read_text(encoding="utf-8")
        pasted = page
        with tempfile.TemporaryDirectory() as name:
            prepare(Path(name))
            with Session(Path(name)) as session:
                results = [(block, session.run(block)) for block in blocks(page)]
        for block, printed in reversed(results):
            if block.expected is None or block.place is None:
                continue
            for line in differences(printed, block.expected):
                print(f"{file}:{block.line}: {line}")
                stale += 1
            pasted = pasted[: block.place[0]] + shortened(printed, block.expected) + pasted[block.place[1] :]
        if arguments.write:
            file.write_text(pasted, encoding="utf-8")
    return 1 if stale and not arguments.write else 0


if __name__ == "__main__":
    sys.exit(main())
