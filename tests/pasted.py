"""What a user pastes of a remedy: the mapping in Python's words, and the one of the command line."""

from __future__ import annotations

import ast
import re
import shlex
from typing import Any

SHELL_MAP = re.compile(r"--map ('(?:[^']|'\"'\"')*')")
_KEYWORD = re.compile(r"\bmapping=(?=\{)")


def python_mappings(text: str) -> list[dict[str, Any]]:
    """Every ``mapping={...}`` of a text, as Python reads it."""
    return [_literal(text[found.end() :]) for found in _KEYWORD.finditer(text)]


def shell_mappings(text: str) -> list[str]:
    """Every value of ``--map`` of a text, as a shell reads it."""
    return [shlex.split(found)[0] for found in SHELL_MAP.findall(text)]


def call_of(text: str, name: str) -> str:
    """The call of a function in a text, up to the bracket that closes it."""
    start = text.index(f"{name}(")
    for end in (start + found.end() for found in re.finditer(r"\)", text[start:])):
        try:
            ast.parse(text[start:end], mode="eval")
        except SyntaxError:
            continue
        return text[start:end]
    raise ValueError(f"{name} is not called in {text!r}")


def _literal(text: str) -> dict[str, Any]:
    for end in (found.end() for found in re.finditer(r"\}", text)):
        try:
            value = ast.literal_eval(text[:end])
        except SyntaxError:
            continue
        assert isinstance(value, dict)
        return value
    raise ValueError(f"no mapping begins here: {text!r}")
