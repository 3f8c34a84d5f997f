"""MkDocs hook: pages for the files of the repository that the documents link to, and equations without a script.

A link such as `../examples/own_effect.py` leads out of `docs/`. It is right where the repository is browsed; on the
site it leads to a page that shows the file. The built site loads nothing from elsewhere, which is checked at the end.
"""

from __future__ import annotations

import base64
import html
import json
import os
import re
from pathlib import Path, PurePosixPath
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent.parent
DOCS = ROOT / "docs"
FOLDER = "repository"
"""Folder of the site for what lies outside `docs/`."""

LINK = re.compile(r"(?P<before>\]\()(?P<target>[^)#\s:]+)(?P<anchor>#[^)\s]*)?(?P<after>\))")
FENCE = re.compile(r"^(`{3,}).*?^\1\s*$", re.MULTILINE | re.DOTALL)
MATHS = re.compile(r'<div class="arithmatex">\\\[(.*?)\\\]</div>', re.DOTALL)
LANGUAGES = {".py": "python", ".rs": "rust", ".toml": "toml", ".c": "c", ".h": "c", ".json": "json"}
LOADED = re.compile(
    r"<(?:script|img|iframe|source|video|audio)\b[^>]*?\ssrc=[\"']?(?:https?:)?//[^\s\"'>]+"
    r"|<link\b(?=[^>]*\brel=[\"']?(?:stylesheet|preload|preconnect|prefetch|icon))[^>]*?href=[\"']?(?:https?:)?//[^\s\"'>]+"
)
"""Addresses that a browser would fetch from another host while it opens a page."""
LOADED_BY_STYLE = re.compile(r"(?:@import|url\()\s*[\"']?(?:https?:)?//[^\s\"')]+")

STORE = "https://unpkg.com/"
"""Host of which the theme's script fetches what it lacks: a part for browsers before 2020, and diagrams."""

_shown: dict[str, Path] = {}
"""Files outside `docs/` by their place on the site."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each file outside `docs/` that a page links to, and for those that these link to."""
    _shown.clear()
    waiting = [
        (DOCS / file.src_uri, Path(file.abs_src_path or "").read_text(encoding="utf-8")) for file in _pages(files)
    ]
    while waiting:
        place, text = waiting.pop()
        for match in LINK.finditer(FENCE.sub("", text)):
            path = _linked(place, match["target"])
            if path is None or path.is_relative_to(DOCS):
                continue
            uri = _uri(path)
            if uri in _shown:
                continue
            _shown[uri] = path
            content = _as_markdown(path)
            files.append(File.generated(config, uri, content=content))
            waiting.append((path, content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links that lead out of `docs/` lead to the pages that stand for those files."""
    place = _shown.get(page.file.src_uri, DOCS / page.file.src_uri)
    start = PurePosixPath(page.file.src_uri).parent

    def moved(match: re.Match[str]) -> str:
        path = _linked(place, match["target"])
        if path is None:
            return match[0]
        uri = path.relative_to(DOCS).as_posix() if path.is_relative_to(DOCS) else _uri(path)
        if files.get_file_from_path(uri) is None:
            return match[0]
        return f"{match['before']}{os.path.relpath(uri, start)}{match['anchor'] or ''}{match['after']}"

    parts, end = [], 0
    for fence in FENCE.finditer(markdown):
        parts += [LINK.sub(moved, markdown[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, LINK.sub(moved, markdown[end:])])


def on_page_content(content: str, **_: Any) -> str:
    """Set equations in MathML, which browsers draw themselves."""
    return MATHS.sub(lambda match: convert(html.unescape(match[1]), display="block"), content)


def on_post_build(config: MkDocsConfig) -> None:
    """Refuse a site that would load anything from elsewhere."""
    built = Path(config.site_dir)
    for script in built.rglob("*.js"):  # the theme's script would fetch parts that no page here needs
        text = script.read_text(encoding="utf-8")
        if STORE in text:
            script.write_text(text.replace(STORE, "missing/"), encoding="utf-8")
    found = []
    for suffix, pattern in ((".html", LOADED), (".css", LOADED_BY_STYLE)):
        for file in built.rglob(f"*{suffix}"):
            found += [
                f"{file.relative_to(built)}: {part}" for part in pattern.findall(file.read_text(encoding="utf-8"))
            ]
    if found:
        raise PluginError("pages that load from other hosts:\n" + "\n".join(sorted(set(found))))


def _pages(files: Files) -> list[File]:
    """Pages that lie in `docs/` themselves."""
    return [file for file in files.documentation_pages() if file.abs_src_path]


def _linked(place: Path, target: str) -> Path | None:
    """Return the file of the repository that a link in a file leads to; None where there is none."""
    path = Path(os.path.normpath(place.parent / target))
    return path if path.is_file() and path.is_relative_to(ROOT) else None


def _uri(path: Path) -> str:
    """Place on the site of a file outside `docs/`."""
    name = path.relative_to(ROOT).as_posix()
    return f"{FOLDER}/{name}" if path.suffix == ".md" else f"{FOLDER}/{name}.md"


def _as_markdown(path: Path) -> str:
    """Return a file as a page."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text
    if path.suffix == ".ipynb":
        return _notebook(path.name, json.loads(text))
    head = f"# {path.name}\n\n`{path.relative_to(ROOT).as_posix()}`\n\n"
    return f"{head}````{LANGUAGES.get(path.suffix, 'text')}\n{text}````\n"


def _notebook(name: str, notebook: dict[str, Any]) -> str:
    """Return a notebook's cells with what they printed and drew."""
    parts = [] if any(_text(cell).startswith("# ") for cell in notebook["cells"][:1]) else [f"# {name}"]
    for cell in notebook["cells"]:
        if cell["cell_type"] == "markdown":
            parts.append(_text(cell))
        elif cell["cell_type"] == "code":
            parts.append(f"````python\n{_text(cell)}\n````")
            parts += [_output(output) for output in cell["outputs"]]
    return "\n\n".join(part for part in parts if part) + "\n"


def _text(cell: dict[str, Any]) -> str:
    """Return the source of a cell."""
    return "".join(cell["source"])


def _output(output: dict[str, Any]) -> str:
    """Return what a cell printed or drew."""
    if output["output_type"] == "stream":
        return f"````text\n{''.join(output['text']).rstrip()}\n````"
    data = output.get("data", {})
    if "image/png" in data:
        picture = "".join(data["image/png"]).replace("\n", "")
        base64.b64decode(picture, validate=True)
        return f'<img alt="What the cell draws" src="data:image/png;base64,{picture}">'
    if "text/html" in data:
        return "".join(data["text/html"])
    return f"````text\n{''.join(data.get('text/plain', [])).rstrip()}\n````"
