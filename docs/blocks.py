"""Run the shell and Python blocks of a Markdown page and hold the pasted output against what they print.

    python docs/blocks.py README.md docs/logs.md            # check
    python docs/blocks.py --write README.md docs/logs.md    # paste anew

A block ```sh or ```python that is followed by a block ```text prints that text; a last line "..." stands for whatever
else it prints. Numbers may differ a little between machines. A shell block whose text holds an error message may fail,
any other may not. A block after the comment <!-- not run --> is left alone.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FENCE = re.compile(r"(?P<skip><!-- not run -->\n+)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ERROR = re.compile(r"^imufit: ", re.MULTILINE)
REST = "..."
WIDTH = "118"


@dataclass(frozen=True)
class Block:
    """A block that is run, the line it starts in, and what it should print (None = not stated)."""

    language: str
    code: str
    line: int
    expected: str | None
    place: tuple[int, int] | None


def blocks(page: str) -> list[Block]:
    """Shell and Python blocks of a page, in order."""
    found = list(FENCE.finditer(page))
    out = []
    for match, after in zip(found, [*found[1:], None][: len(found)], strict=True):
        if match["skip"] or match["language"] not in ("sh", "python"):
            continue
        printed = after if after is not None and after["language"] == "text" else None
        line = page.count("\n", 0, match.start("text"))
        place = None if printed is None else printed.span("text")
        out.append(Block(match["language"], match["text"], line, None if printed is None else printed["text"], place))
    return out


def run(block: Block, folder: Path) -> str:
    """Run a block in a folder; return what it prints, standard error after standard output.

    Raises
    ------
    AssertionError
        It fails although no error message is pasted behind it.
    """
    command = ["bash", "-ec", block.code] if block.language == "sh" else [sys.executable, "-c", block.code]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": path, "COLUMNS": WIDTH, "MPLBACKEND": "agg", "PYTHONIOENCODING": "utf-8"}
    if block.language == "sh" and ERROR.search(block.expected or ""):
        command[1] = "-c"
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    printed = tidy(done.stdout + done.stderr)
    assert done.returncode == 0 or ERROR.search(block.expected or ""), f"line {block.line} failed:\n{printed}"
    return printed


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
    (folder / "examples").symlink_to(ROOT / "examples")


def main() -> int:
    """Check or paste the output of the blocks of pages."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--write", action="store_true", help="paste what is printed")
    parser.add_argument("pages", nargs="+", type=Path)
    arguments = parser.parse_args()
    stale = 0
    for file in arguments.pages:
        page = file.read_text(encoding="utf-8")
        pasted = page
        with tempfile.TemporaryDirectory() as name:
            prepare(Path(name))
            results = [(block, run(block, Path(name))) for block in blocks(page)]
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
