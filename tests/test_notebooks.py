"""The notebooks of the examples run, show what is stored in them, and carry nothing of the machine that ran them."""

import base64
import re
import runpy
import sys
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).resolve().parent.parent
MAKE = runpy.run_path(str(ROOT / "examples" / "notebooks" / "make.py"), run_name="make")
BLOCKS = runpy.run_path(str(ROOT / "docs" / "blocks.py"), run_name="blocks")
NAMES = list(MAKE["sources"]())
SIX = {"first_loop", "own_data", "own_effect", "paper_a_calibration", "paper_b_tilt", "paper_c_hybrid"}
MOST = {"first_loop": 300_000}
"""Bytes that a notebook may have; the others as below."""
USUAL = 400_000
PICTURE = 100_000
"""Bytes of a picture."""
TAGS = re.compile(r"<[^>]*>")
FOLDER = re.escape(f"/{ROOT.parts[1]}/")
FOREIGN = re.compile(rf"/home/|/root/|/tmp/|{FOLDER}|/usr/|site-packages|Traceback|Warning|0x[0-9a-f]{{6}}")


def stored(name):
    return nbformat.read(ROOT / "examples" / f"{name}.ipynb", as_version=4)


def words(shown):
    """Return what one output says, as lines."""
    return TAGS.sub("\n", shown.get("text/html", "")) + "\n" + shown.get("text/plain", "")


def png(data):
    assert data.startswith(b"\x89PNG")
    return data


def test_there_are_the_six_notebooks_and_no_other():
    assert set(NAMES) == SIX
    assert {path.stem for path in (ROOT / "examples").glob("*.ipynb")} == SIX


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_that_of_its_source_runs_and_shows_what_is_stored(name):
    held, made = stored(name), MAKE["notebook"](MAKE["sources"]()[name])
    assert [(cell.cell_type, cell.source) for cell in held.cells] == [
        (cell.cell_type, cell.source) for cell in made.cells
    ], "make docs writes it anew"
    ran = MAKE["run"](made)
    for before, after in zip(held.cells, ran.cells, strict=True):
        had, has = MAKE["shown"](before), MAKE["shown"](after)
        assert [set(each) for each in had] == [set(each) for each in has], before.source
        for old, new in zip(had, has, strict=True):
            assert not BLOCKS["differences"](BLOCKS["tidy"](words(new)), words(old)), before.source


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_small_and_carries_nothing_of_a_machine(name):
    path = ROOT / "examples" / f"{name}.ipynb"
    assert path.stat().st_size < MOST.get(name, USUAL)
    held = stored(name)
    assert held.metadata == MAKE["METADATA"]
    pictures = 0
    for cell in held.cells:
        assert cell.metadata == {}
        assert not FOREIGN.search(cell.source), cell.source
        for shown in MAKE["shown"](cell):
            assert "stderr" not in shown, shown
            assert not FOREIGN.search(words(shown)), words(shown)
            if "image/png" in shown:
                pictures += 1
                assert len(png(base64.b64decode(shown["image/png"]))) < PICTURE
    assert pictures >= 2


FRESH = """
import imufit
fit = imufit.fit(imufit.simulate("handheld", {"gyr.bias": None}, duration=10.0).to_log(), ["gyr.bias"])
""".strip()


@pytest.mark.parametrize(
    ("before", "last"),
    [
        ("", "fit.plot()"),
        ("import matplotlib.pyplot as plt", "fit.plot()"),
        ("import matplotlib.pyplot as plt\naxes = plt.gca()", "fit.plot(ax=axes)"),
        ("import matplotlib.pyplot as plt\nfigure = plt.figure()", "imufit.plot(fit.logs[0], ax=figure)"),
    ],
)
def test_exactly_one_picture_appears_in_a_fresh_notebook(before, last):
    cell = nbformat.v4.new_code_cell("\n".join(line for line in (FRESH, before, last) if line))
    (cell,) = MAKE["run"](nbformat.v4.new_notebook(cells=[cell])).cells
    pictures = [shown["image/png"] for shown in MAKE["shown"](cell) if "image/png" in shown]
    assert len(pictures) == 1
    png(base64.b64decode(pictures[0]))
    assert "matplotlib_inline" not in sys.modules
