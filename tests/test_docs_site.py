"""The site has every page, generated pages are fresh, citations and licences are told, examples of functions run."""

import doctest
import importlib
import re
import runpy
import tomllib
from pathlib import Path

import imufit
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
MONTHS = ["January", "February", "March", "April", "May", "June", "July", "August", "October", "November", "December"]
CITATION = re.compile(r"\b([A-ZÀ-Ž][a-zà-ž]{2,})\b,? \(?(1[89]\d\d|20[0-2]\d)\b")
SOURCES = (("rust", "*.rs"), ("python", "*.py"), ("docs", "*.md"), ("examples", "*.py"), ("benches", "*.py"))


def navigation():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    return re.findall(r": (\S+\.md)$", text, re.MULTILINE)


def test_navigation_has_every_page_once():
    assert sorted(navigation()) == sorted(path.name for path in DOCS.glob("*.md"))


def test_warnings_are_errors_and_nothing_is_fetched():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert "\nstrict: true\n" in text
    assert "font: false" in text
    assert "://" not in text
    hook = runpy.run_path(str(DOCS / "site_build" / "repository_pages.py"))
    assert hook["LOADED"].search('<script src="https://host/a.js">')
    assert hook["LOADED"].search('<link rel="stylesheet" href="//host/a.css">')
    assert not hook["LOADED"].search('<a href="https://host/">there</a> <img src="pictures/a.png">')
    assert hook["LOADED_BY_STYLE"].search("@import url(https://host/a.css)")


@pytest.mark.parametrize(("script", "page"), [("make_filters", "api_filters.md")])
def test_generated_page_is_fresh(script, page):
    made = runpy.run_path(str(DOCS / f"{script}.py"))["page"]()
    assert (DOCS / page).read_text(encoding="utf-8") == made, "refresh with `make docs`"


def test_api_pages_have_every_public_function_class_and_verb():
    text = "".join(path.read_text(encoding="utf-8") for path in DOCS.glob("api*.md"))
    described = set(re.findall(r"^::: \S+\.(\w+)$", text, re.MULTILINE))
    names = {"forget" if name == "forget_effect" else name for name in imufit.__all__} - {"__version__"}
    assert sorted(names - described) == []
    for target in re.findall(r"^::: (\S+)$", text, re.MULTILINE):
        module, _, name = target.rpartition(".")
        assert hasattr(importlib.import_module(module), name), target


def citations():
    for folder, pattern in SOURCES:
        for path in (ROOT / folder).rglob(pattern):
            if "target" in path.parts or path.name == "bibliography.md":
                continue
            for name, year in CITATION.findall(" ".join(path.read_text(encoding="utf-8").split())):
                if name not in MONTHS:
                    yield name, year, path.name


def test_bibliography_has_every_citation():
    entries = [" ".join(entry.split()) for entry in (DOCS / "bibliography.md").read_text("utf-8").split("\n- ")]
    found = set(citations())
    assert len({(name, year) for name, year, _ in found}) > 25
    missing = {item for item in found if not any(item[0] in entry and item[1] in entry for entry in entries)}
    assert missing == set()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with the two logs that docs/api.md makes and the examples of docstrings read."""
    made = tmp_path_factory.mktemp("api")
    code = re.search(r"```python\n(.*?)```", (DOCS / "api.md").read_text(encoding="utf-8"), re.DOTALL)[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        exec(code, {})
    return made


VERBS = ("allan", "calibrate", "compare", "diagnose", "fit", "info", "join", "ladder", "plot", "replay", "tune")


@pytest.mark.parametrize("name", VERBS)
def test_example_of_a_function_prints_what_it_says(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    verbs = importlib.import_module("imufit.verbs")
    assert set(VERBS) <= set(dir(verbs))
    parser = doctest.DocTestParser()
    example = parser.get_doctest(getattr(verbs, name).__doc__, {"imufit": imufit, "np": np}, name, None, None)
    assert example.examples
    said = []
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    doctest.DocTestRunner(optionflags=flags, verbose=False).run(example, out=said.append)
    assert not said, "".join(said)


def test_licences_are_those_of_the_crates_that_are_linked():
    made = runpy.run_path(str(ROOT / "rust" / "make_licences.py"))["page"]()
    text = (ROOT / "THIRD_PARTY_LICENSES").read_text(encoding="utf-8")
    assert text == made, "refresh with `python rust/make_licences.py`"
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    locked = {(package["name"], package["version"]) for package in lock}
    told = set(re.findall(r"^([\w-]+) (\d\S*) \(.+\)$", text, re.MULTILINE))
    assert {"pyo3", "nalgebra", "rayon"} <= {name for name, _ in told} <= {name for name, _ in locked}
    assert told <= locked
    assert "syn" not in {name for name, _ in told}


def test_metadata_name_authors_and_licence_files():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["authors"] == [{"name": "imufit contributors"}]
    assert all((ROOT / name).is_file() for name in project["license-files"])
    assert "THIRD_PARTY_LICENSES" in project["license-files"]
