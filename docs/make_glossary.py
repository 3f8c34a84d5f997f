"""Write docs/glossary.md from the definitions in python/imufit/glossary.toml.

python docs/make_glossary.py
"""

from pathlib import Path

from imufit.glossary import Term, terms

PAGE = Path(__file__).parent / "glossary.md"
HEAD = """# Glossary

Written by `python docs/make_glossary.py` from `python/imufit/glossary.toml`: do not edit.

The words of screens, JSON and reports. An HTML report explains the words that it uses at its end. Effects
stand in [effects](effects.md), faults in [faults](faults.md), settings of filters in [filters](api_filters.md).
"""


def section(term: Term) -> list[str]:
    """Return one term."""
    heading = f"### {term.word}".replace("*", r"\*").replace("_", r"\_")
    facts = [f"Also: {', '.join(f'`{word}`' for word in term.also)}."] if term.also else []
    facts += [f"Unit: {term.unit.removesuffix('.')}."] if term.unit else []
    facts += [f"From: {term.origin}"]
    return [heading, "", term.means, "", *[f"- {fact}" for fact in facts], ""]


def page() -> str:
    """Return the whole page."""
    lines, group = [HEAD], ""
    for term in terms():
        if term.group != group:
            lines += [f"## {term.group}", ""]
            group = term.group
        lines += section(term)
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
