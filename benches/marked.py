"""The part of a page that a bench writes, between two marks of its own."""

from pathlib import Path


def write_between(page: Path, begin: str, end: str, text: str) -> None:
    """Put text between two marks of a page; what stands around them stays."""
    head, _, rest = page.read_text(encoding="utf-8").partition(begin)
    page.write_text(f"{head}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}", encoding="utf-8")
