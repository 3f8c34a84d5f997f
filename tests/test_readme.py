"""Blocks of the README and of the documents do what they say, and print what is pasted behind them."""

import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))

import blocks  # noqa: E402  lies beside the documents

PAGES = (
    "README.md",
    "docs/logs.md",
    "docs/own_effect.md",
    "docs/several.md",
    "docs/calibration.md",
    "docs/device.md",
    "docs/replay.md",
    "docs/tuning.md",
    "docs/tilt.md",
    "docs/hybrid.md",
)


@pytest.mark.parametrize("name", PAGES)
def test_blocks_print_what_the_page_says(name, tmp_path):
    blocks.prepare(tmp_path)
    stale = []
    for block in blocks.blocks((ROOT / name).read_text(encoding="utf-8")):
        printed = blocks.run(block, tmp_path)
        if block.expected is not None:
            stale += [f"{name}:{block.line}: {line}" for line in blocks.differences(printed, block.expected)]
    assert not stale, "refresh with `make docs`:\n" + "\n".join(stale)


def test_other_words_or_numbers_are_noticed():
    assert not blocks.differences("a 1.001 b\nc\n", "a 1.002 b\n...\n")
    assert blocks.differences("a 1.3 b\n", "a 1.0 b\n")
    assert blocks.differences("a 1.0 c\n", "a 1.0 b\n")
    assert blocks.differences("a\nb\n", "a\n")
    assert blocks.differences("a\n", "a\nb\n")


def test_the_picture_shows_what_its_script_draws(tmp_path):
    picture = ROOT / "docs" / "pictures" / "ladder.png"
    assert picture.stat().st_size < 150_000
    result = runpy.run_path(str(ROOT / "docs" / "pictures" / "make.py"))["ladder"]()
    told = f"from {result.ratio_start:.2f} to {result.ratio_end:.2f} times the noise floor as five effects"
    assert len(result.steps) == 5
    assert told in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_pictures_of_a_calibration_are_drawn_from_what_the_page_says():
    make = runpy.run_path(str(ROOT / "docs" / "pictures" / "make.py"))
    page = " ".join((ROOT / "docs" / "calibration.md").read_text(encoding="utf-8").split())
    for effect, values in make["SENSOR"].items():
        assert f"--effect {effect}:{','.join(f'{name}={value:g}' for name, value in values.items())} " in page
    for name in ("sides", "calibration"):
        assert (ROOT / "docs" / "pictures" / f"{name}.png").stat().st_size < 150_000
    turned = make["LYING"]
    for up, axes in turned.items():
        assert axes["xyz".index(up[1])] == up[0] + "z", "the named axis points up in the room"
