"""What may come of an input, whatever it is: the rules of the public contract, and what broke them."""

import json
import re
from dataclasses import dataclass, field
from itertools import pairwise

GOOD, UNUSABLE = 0, 2
LIMIT_S = 10.0
"""No command may take longer on a log of a few hundred rows, which takes it a tenth of a second when it is whole:
seconds of the processor, or thrice as many of the clock, since others may use the processor too."""
CLOCK_S = 3 * LIMIT_S
LIMIT_BYTES = 10**9
"""Peak memory, that of the imports (some 200 MB) included; the largest file of an input has a few megabytes."""
LIMIT_MESSAGE = 4_000
"""Characters on standard error: a screen and a half, in which a person still finds the point."""
STREAMED = 10**6
"""Characters of standard output above which no result of such a log lies."""

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""C0 and C1 control characters but for tab and newline; escape codes start with one of them."""

WORDS = {
    "Traceback (most recent call last)": "traceback",
    "internal error": "internal error",
    "panicked at": "panic",
    "PanicException": "panic",
    "On entry to": "LAPACK",
    "Exception ignored in": "ignored exception",
}
"""What no output may contain, and what it is called."""


@dataclass
class Outcome:
    """What a command did.

    Attributes
    ----------
    code : int or None
        Exit code; None if an exception came out of the command.
    out, err : bytes
        Standard output and standard error.
    seconds : float
        Time that it took of the processor.
    peak : int
        Most memory that the process held meanwhile, in bytes.
    written : dict
        Content of each file in the folder that was not there before.
    escaped : str
        The exception that came out, if one did.
    """

    code: int | None
    out: bytes
    err: bytes
    seconds: float
    peak: int
    written: dict[str, bytes] = field(default_factory=dict)
    escaped: str = ""


def faults(arguments: list[str], outcome: Outcome) -> list[tuple[str, str]]:
    """Return kind and detail of every rule that was broken; the kind names the rule, for counting."""
    found: list[tuple[str, str]] = []
    err = outcome.err.decode("utf-8", "backslashreplace").strip()
    out = outcome.out.decode("utf-8", "backslashreplace")
    if outcome.escaped:
        found.append(("exception", outcome.escaped))
    elif outcome.code not in (GOOD, UNUSABLE):
        found.append((f"exit code {outcome.code}", err))
    for word, kind in WORDS.items():
        if (word in err or word in out) and (kind != "internal error" or not found):
            found.append((kind, err if word in err else out[:500]))
    if outcome.code == UNUSABLE and not outcome.escaped:
        found += _message(err)
    if len(err) > LIMIT_MESSAGE:
        found.append(("long message", f"{len(err)} characters: {err[:200]}..."))
    for name, text in (("standard error", err), ("standard output", out)):
        if control := CONTROL.search(text):
            start = max(control.start() - 60, 0)
            found.append((f"control character on {name}", repr(text[start : control.start() + 40])[1:-1]))
    if outcome.seconds > LIMIT_S:
        found.append(("hang", f"{outcome.seconds:.1f} s"))
    if outcome.peak > LIMIT_BYTES:
        found.append(("memory", f"{outcome.peak / 1e6:.0f} MB"))
    return found + (_answers(arguments, outcome, out) if outcome.code == GOOD else [])


def _message(err: str) -> list[tuple[str, str]]:
    lines = [line for line in err.split("\n") if line.strip()]
    if not lines:
        return [("no message", "exit code 2 and nothing on standard error")]
    if len(lines) > 1:
        return [("several lines", err[:500])]
    return [] if lines[0].startswith("imufit: ") else [("odd message", lines[0][:500])]


def _answers(arguments: list[str], outcome: Outcome, out: str) -> list[tuple[str, str]]:
    """Hold what a command answers with success against what it promised."""
    found = []
    asked = [value for flag, value in pairwise(arguments) if flag == "--json"]
    texts = {name: data for name, data in outcome.written.items() if name.endswith(".json")}
    if asked and asked[-1] == "-":
        texts["standard output"] = out.encode("utf-8", "surrogateescape")
    elif asked and asked[-1] == "out.json" and "out.json" not in outcome.written:
        found.append(("no answer", "exit code 0 without the file of --json"))
    for name, data in texts.items():
        try:
            json.loads(data.decode("utf-8"), parse_constant=_refuse)
        except (ValueError, RecursionError) as error:
            found.append(("JSON", f"{name}: {error}"))
    wanted = [value for flag, value in pairwise(arguments) if flag in ("-o", "--output")]
    if wanted and wanted[-1].startswith("out.") and not outcome.written.get(wanted[-1]):
        found.append(("no output", f"exit code 0 without {wanted[-1]}"))
    if len(out) > STREAMED and "standard output" not in texts:
        found.append(("long output", f"{len(out)} characters"))
    return found


def _refuse(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def label(kind: str, detail: str) -> str:
    """Name the class of a failure: its kind and its message without numbers, names and paths."""
    first = detail.split("\n", maxsplit=1)[0]
    first = re.sub(r"'[^']*'|\"[^\"]*\"", "'...'", first)
    first = re.sub(r"\S*\.(csv|npz|parquet|txt|toml|json|part|log|png|html)\b", "FILE", first)
    first = re.sub(r"[-+]?\d[\d.e+-]*", "N", first)
    return f"{kind}: {first[:120]}" if kind not in ("hang", "memory") else kind
