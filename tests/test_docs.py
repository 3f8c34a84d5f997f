"""Documents are true to the tree and to the catalogue."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *DOCS]
FOLDERS = ("python", "rust", "tests", "benches", "examples", "docs")
LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]*)(#[^)\s]*)?\)")


def named():
    text = (ROOT / "docs" / "structure.md").read_text(encoding="utf-8")
    return {word for word in re.findall(r"`([\w./-]+)`", text) if word.split("/")[0] in FOLDERS}


def test_structure_names_only_what_exists():
    assert [path for path in sorted(named()) if not (ROOT / path).exists()] == []


def test_structure_names_every_crate_and_package():
    crates = {path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "rust").glob("*/Cargo.toml")}
    packages = {path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "python" / "imufit").glob("*/__init__.py")}
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "python" / "imufit").glob("[!_]*.py")}
    assert sorted((crates | packages | modules) - named()) == []


def test_page_of_effects_is_what_the_cards_say():
    made = runpy.run_path(str(ROOT / "docs" / "make_effects.py"))["page"]()
    assert (ROOT / "docs" / "effects.md").read_text(encoding="utf-8") == made, "refresh with `make docs`"


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target, anchor in LINK.findall(text):
        if "://" in target:
            continue
        file = page if not target else (page.parent / target)
        assert file.exists(), f"{page.name} links to {target}"
        if anchor and file.suffix == ".md":
            assert anchor[1:] in anchors(file), f"{page.name} links to {target}{anchor}"


def anchors(file):
    headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_index_links_every_page():
    text = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert [page.name for page in DOCS if page.name != "index.md" and f"({page.name})" not in text] == []


@pytest.mark.parametrize(
    ("file", "constant", "words"),
    [
        ("rust/inference/src/search.rs", "ODDS", "exceeds ln(number of candidates) + {}."),
        ("rust/inference/src/search.rs", "LARGEST_GAIN", "no gain above {}"),
        ("rust/inference/src/verdict.rs", "NAMED_SHARE", "named effects have at least {:.0%} of the evidence"),
        ("rust/inference/src/verdict.rs", "NOISE", "differ by no more than {} that noise"),
        ("rust/inference/src/criterion.rs", "ATTENUATION", "too small by {} times the noise's part"),
        ("rust/fit/src/saturated.rs", "COMMON", "as much as {} samples of the whole"),
        ("rust/inference/src/held_out.rs", "FOLDS", "over {} folds"),
        ("rust/inference/src/bins.rs", "CONTRASTS", "up to degree {},"),
        ("rust/fit/src/bins.rs", "BINS", "up to {} bins"),
        ("rust/fit/src/whitening.rs", "MAX_ORDER", "filter of at most {} taps"),
        ("rust/model/src/bandwidth.rs", "TOLERANCE", "{}\\,\\sigma_{{\\text{{ref}}}}"),
        ("python/imufit/fitting/passes.py", "BLOCKS", "B = {} blocks"),
    ],
)
def test_method_states_the_constants_of_the_code(file, constant, words):
    code = (ROOT / file).read_text(encoding="utf-8")
    found = re.search(rf"^(?:pub )?(?:const )?{constant}(?:: \w+)? = ([\d.]+)", code, re.MULTILINE)
    assert found, f"{file} has no {constant} any more"
    value = float(found[1])
    number = int(value) if value.is_integer() else value
    spelt = {2: "twice", 5: "five", 12: "twelve"}.get(number, number)
    text = " ".join((ROOT / "docs" / "method.md").read_text(encoding="utf-8").split()).replace(" %", "%")
    shapes = [number] if ":" in words else [number, spelt]
    assert any(words.format(shape) in text for shape in shapes), (
        f"docs/method.md does not say that {constant} is {value}"
    )
