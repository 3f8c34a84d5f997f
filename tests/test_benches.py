"""Programs beside the package name only modules and functions that the package has."""

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = sorted(
    path.relative_to(ROOT)
    for folder in ("benches", "docs", "examples")
    for path in (ROOT / folder).rglob("*.py")
    if ".ipynb_checkpoints" not in path.parts
)


def has(module: str, name: str) -> bool:
    """Whether a module holds a name, or is the package of a module of this name."""
    if hasattr(importlib.import_module(module), name):
        return True
    try:
        importlib.import_module(f"{module}.{name}")
    except ModuleNotFoundError:
        return False
    return True


@pytest.mark.parametrize("program", PROGRAMS, ids=str)
def test_what_a_program_imports_from_the_package_is_there(program):
    tree = ast.parse((ROOT / program).read_text(encoding="utf-8"))
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module)
    own = [node for node in imports if node.module.split(".")[0] == "imufit"]
    assert [
        f"{node.module}.{name.name}" for node in own for name in node.names if not has(node.module, name.name)
    ] == []


def test_there_are_programs():
    assert len(PROGRAMS) > 10
