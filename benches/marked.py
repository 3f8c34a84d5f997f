"""The part of a page that a bench writes, between two marks of its own."""

from pathlib import Path

from imufit.results import Table


def write_between(page: Path, begin: str, end: str, text: str) -> None:
    """Put text between two marks of a page; what stands around them stays."""
    head, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(f"{head}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}", encoding="utf-8")


def markdown(table: Table) -> str:
    """Write a table as Markdown, numbers on the right."""
    rule = "|".join("---:" if right else "---" for right in table.right)
    lines = [" | ".join(table.names), rule, *(" | ".join(row) for row in table.rows)]
    return "\n".join(f"| {line} |" if line != rule else f"|{line}|" for line in lines)
