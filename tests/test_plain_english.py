"""Plain English on the pages, in docstrings, in messages and in comments: words and lengths that a machine can check.

A failure names file, line and sentence. The rules stand in ``WRONG``, ``OPENING`` and ``LONGEST``.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "SECURITY.md",
    ROOT / "firmware" / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
FOLDERS = (ROOT / "python" / "imufit", ROOT / "examples", ROOT / "benches", ROOT / "docs")
MODULES = [file for folder in FOLDERS for file in sorted(folder.rglob("*.py"))]
CARDS = sorted((ROOT / "rust" / "model" / "src" / "effects").glob("*.rs"))

WRONG = re.compile(
    r"\b(?:is|are|was|were) no (?!longer\b|more\b|less\b|larger\b|smaller\b|later\b|earlier\b|wider\b)"
    r"|\b(?:tell|tells|telling|told|untold)\b(?! :)"
    r"|\bof no use\b|\bnobody\b|\bbeliev|\bhonest|\bdrown|\bwander|\bfor want of\b",
    re.IGNORECASE,
)
"""Words that have a plainer one here: is not a; determined, shown, stated, separated; bias random walk."""
OPENING = re.compile(r"^(?:What|Whatever|Whoever)\b")
"""Opening of a sentence without a subject; a question may open with What."""
LONGEST = 30
"""Words in a sentence of a page: at most thirty (Cutts, Oxford Guide to Plain English, advises 15 to 20
on average)."""

QUOTED = re.compile(r'"((?:[^"\\]|\\.)*)"')
"""A string of a Rust file, on one line as the texts of the cards are."""
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$.*?\$\$", re.DOTALL)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
INLINE = re.compile(r"``[^`]+``|`[^`]+`|\$[^$\n]+\$")
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
END = re.compile(r"(?<=[.!?])[\"'”*)]*\s+(?=[\"'“*(`\[]*(?:[A-Z0-9]|imufit\b))|(?<=:)\s+|(?<=[.!?])$")
"""Where a sentence ends. A colon ends a clause that stands by itself."""


def kept_lines(match: re.Match[str]) -> str:
    """Empty lines in the place of what is not prose, so that numbers of lines stay."""
    return "\n" * match.group().count("\n")


def paragraphs(page: str) -> Iterator[tuple[int, str, bool]]:
    """First line, text without markup, and whether sentences are to be counted, of each paragraph, item and cell."""
    for rule in (FENCE, FORMULA, COMMENT):
        page = rule.sub(kept_lines, page)
    # A name in code or a formula is one word, whatever it holds.
    lines = LINK.sub(r"\1", INLINE.sub("X", page)).splitlines()
    held: list[str] = []
    first = 0
    for number, line in enumerate([*lines, ""], 1):
        bare = line.strip()
        starts = bare.startswith(("- ", "* ", "|", "#", ">")) or re.match(r"\d+\. ", bare) or not bare
        # An indented line is code unless it goes on with an item of a list.
        if starts or (line.startswith("    ") and not held):
            if held:
                yield first, " ".join(held), True
            held = []
        if bare.startswith("|"):
            yield from ((number, cell.strip(), False) for cell in bare.strip("|").split("|"))
        elif bare and not bare.startswith("#") and not (line.startswith("    ") and not held):
            if not held:
                first = number
            held.append(re.sub(r"^(?:[-*>]|\d+\.) ", "", bare))


def sentences(text: str) -> list[str]:
    """Sentences of a text, without the marks of bold and italic type."""
    return [part.strip() for part in END.split(text.replace("*", "")) if part and part.strip()]


def faults(text: str, longest: int | None = None) -> list[str]:
    """Sentences of a text that break a rule, each with the rule."""
    out = []
    for sentence in sentences(text):
        found = WRONG.search(sentence)
        if found:
            out.append(f"{found.group().strip()!r}: {sentence}")
        if OPENING.match(sentence) and not sentence.endswith("?"):
            out.append(f"opens with {sentence.split()[0]!r}: {sentence}")
        if longest is not None and len(sentence.split()) > longest:
            out.append(f"{len(sentence.split())} words: {sentence}")
    return out


def strings(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and text of every string of a module that is more than a name; a value in a text counts as X."""
    inside = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in ast.walk(node)
        if part is not node
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            text = node.value
        else:
            continue
        if " " in text.strip():
            yield node.lineno, INLINE.sub("X", text)


def comments(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every comment."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], INLINE.sub("X", token.string.lstrip("# "))


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_pages_are_in_plain_english(page: Path) -> None:
    name = page.relative_to(ROOT)
    found = [
        f"{name}:{line}: {fault}"
        for line, text, counted in paragraphs(page.read_text(encoding="utf-8"))
        for fault in faults(text, LONGEST if counted else None)
    ]
    assert not found, "\n" + "\n".join(found)


def test_docstrings_and_messages_are_in_plain_english() -> None:
    found = [
        f"{file.relative_to(ROOT)}:{line}: {fault}"
        for file in MODULES
        for line, text in strings(ast.parse(file.read_text(encoding="utf-8")))
        for paragraph in re.split(r"\n\s*\n", text)
        for fault in faults(" ".join(paragraph.split()))
    ]
    assert not found, f"{len(found)}\n" + "\n".join(found)


def test_comments_are_in_plain_english() -> None:
    found = [
        f"{file.relative_to(ROOT)}:{line}: {fault}"
        for file in MODULES
        for line, text in comments(file.read_text(encoding="utf-8"))
        for fault in faults(text)
    ]
    assert not found, f"{len(found)}\n" + "\n".join(found)


def test_effect_cards_are_in_plain_english() -> None:
    found = [
        f"{file.relative_to(ROOT)}:{number}: {fault}"
        for file in CARDS
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if not line.strip().startswith("//")
        for text in QUOTED.findall(line)
        for fault in faults(text)
    ]
    assert CARDS
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize(
    "text",
    [
        "The log tells the unit.",
        "A lag is no delay.",
        "What is left is noise.",
        "It stops. Whatever is left is noise.",
        "The zero wanders.",
    ],
)
def test_what_breaks_a_rule_is_found(text: str) -> None:
    assert len(faults(text)) == 1


def test_what_keeps_the_rules_passes() -> None:
    assert not faults("What is a log? The lag is no longer a delay. The log shows the unit.")
    assert len(faults(" ".join(["word"] * (LONGEST + 1)), LONGEST)) == 1
    assert list(paragraphs("# Head\n\nOne `a b`\ntwo.\n\n    code\n\n- item\n  goes on\n\n| a | b |\n")) == [
        (3, "One X two.", True),
        (8, "item goes on", True),
        (11, "a", False),
        (11, "b", False),
    ]
    tree = ast.parse('"""Two words."""\nname = "one"\nraise E(f"no {name} here")\n')
    assert list(strings(tree)) == [(1, "Two words."), (3, "no X here")]
