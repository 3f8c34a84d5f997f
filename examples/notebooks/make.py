"""Make the notebooks of the examples from their sources, run them, and store what they show.

    python examples/notebooks/make.py                 # all of them
    python examples/notebooks/make.py first_loop      # one

A source is a Python file in this folder, cut by lines ``# %%`` into cells of code and by lines ``# %% [markdown]`` into
cells of text. In a cell ``# %% [source]`` the names that are imported stand with their source instead, so that a
notebook shows what a script of the examples holds and nothing is written twice.
"""

from __future__ import annotations

import ast
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode, v4

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent
CELL = re.compile(r"^# %%(?: \[(\w+)\])?$", re.MULTILINE)
LONGEST = 120
"""Time (s) that one cell may take."""
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
"""Metadata of the kernel: nothing of the machine that ran the notebook."""


def sources() -> dict[str, Path]:
    """Return the source of every notebook by its name."""
    return {path.stem: path for path in sorted(HERE.glob("*.py")) if path.stem != Path(__file__).stem}


def notebook(source: Path) -> NotebookNode:
    """Return the notebook of a source, not run."""
    begin, *parts = CELL.split(source.read_text(encoding="utf-8"))
    assert not begin.strip(), f"{source} does not begin with a cell"
    cells = []
    for number, (kind, text) in enumerate(zip(parts[::2], parts[1::2], strict=True)):
        made = _cell(kind, text.strip("\n"))
        made["id"] = f"cell-{number:02d}"
        cells.append(made)
    return v4.new_notebook(cells=cells, metadata=METADATA)


def _cell(kind: str | None, text: str) -> NotebookNode:
    if kind == "markdown":
        return v4.new_markdown_cell("\n".join(line.removeprefix("#").removeprefix(" ") for line in text.split("\n")))
    return v4.new_code_cell(_with_sources(text) if kind == "source" else text)


def _with_sources(text: str) -> str:
    """Replace what is imported from an example by its source; other lines stay."""
    lines = []
    for statement in ast.parse(text).body:
        example = EXAMPLES / f"{statement.module}.py" if isinstance(statement, ast.ImportFrom) else None
        if example is None or not example.is_file():
            lines.append(ast.unparse(statement))
            continue
        lines += ["", "", *(_source_of(example, alias.name) for alias in statement.names)]
    return "\n".join(lines).strip("\n")


def _source_of(file: Path, name: str) -> str:
    """Return the lines of a function with its decorators."""
    code = file.read_text(encoding="utf-8")
    for part in ast.parse(code).body:
        if isinstance(part, ast.FunctionDef) and part.name == name:
            first = min([part.lineno, *(item.lineno for item in part.decorator_list)])
            return "\n".join(code.split("\n")[first - 1 : part.end_lineno]) + "\n"
    raise ValueError(f"{file} has no function {name}")


def run(made: NotebookNode) -> NotebookNode:
    """Run a notebook in the folder of the examples, in a kernel of its own.

    Raises
    ------
    CellExecutionError
        A cell fails.
    """
    # History and settings of the user's own notebooks take no part.
    with tempfile.TemporaryDirectory() as own:
        environment = {**os.environ, "IPYTHONDIR": own, "JUPYTER_CONFIG_DIR": own, "COLUMNS": "100"}
        environment.pop("MPLBACKEND", None)
        client = NotebookClient(
            made,
            timeout=LONGEST,
            kernel_name="python3",
            record_timing=False,
            # A print may leave the kernel in two messages, where its flush falls between them.
            coalesce_streams=True,
            resources={"metadata": {"path": EXAMPLES}},
        )
        client.execute(env=environment)
    made["metadata"] = METADATA
    for cell in made.cells:
        cell["metadata"] = {}
    return made


def shown(cell: NotebookNode) -> list[dict[str, Any]]:
    """Return what a cell shows, by kind: ``text/plain``, ``text/html``, ``image/png`` or ``stderr``."""
    kinds = []
    for output in cell.get("outputs", []):
        if output.output_type == "stream":
            kinds.append({"text/plain" if output.name == "stdout" else "stderr": output.text})
        else:
            kinds.append(dict(output.data))
    return kinds


def main(names: list[str]) -> None:
    """Make, run and store notebooks."""
    for name in names or list(sources()):
        path = EXAMPLES / f"{name}.ipynb"
        nbformat.write(run(notebook(sources()[name])), path)
        print(f"{path.name}: {path.stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
