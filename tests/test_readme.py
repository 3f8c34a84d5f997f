"""Blocks of the README and of the documents do what they say, and print what is pasted behind them."""

import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))

import blocks  # noqa: E402  lies beside the documents


@pytest.mark.parametrize("name", [name for name in blocks.pages() if blocks.blocks((ROOT / name).read_text("utf-8"))])
def test_blocks_print_what_the_page_says(name, tmp_path):
    blocks.prepare(tmp_path)
    stale = []
    with blocks.Session(tmp_path) as session:
        for block in blocks.blocks((ROOT / name).read_text(encoding="utf-8")):
            printed = session.run(block)
            if block.expected is not None:
                stale += [f"{name}:{block.line}: {line}" for line in blocks.differences(printed, block.expected)]
    assert not stale, "refresh with `make docs`:\n" + "\n".join(stale)


@pytest.mark.parametrize("name", blocks.pages())
def test_a_block_that_is_not_run_says_why(name):
    page = (ROOT / name).read_text(encoding="utf-8")
    for match, reason in blocks.fences(page):
        assert reason or not match["info"], f"{name} has a block of another kind: {match[0].splitlines()[0]}"
    assert "console" not in {match["language"] for match in blocks.FENCE.finditer(page)}, "write sh"
    lines = [line for line in blocks.FENCE.sub("", page).splitlines() if line.lstrip().startswith(("```", "~~~"))]
    assert lines == [], "a fence within a list is not seen"


def page_of(*parts):
    return "\n".join(parts) + "\n"


def test_blocks_of_a_page_share_names_and_files_and_errors_are_noticed(tmp_path):
    page = page_of(
        "```python", "a = 3", "```", "```python", "print(a)", "```", "```text", "3", "```", "```sh", "echo b", "```"
    )
    found = blocks.blocks(page)
    assert [block.expected for block in found] == [None, "3\n", None]
    with blocks.Session(tmp_path) as session:
        assert [session.run(block) for block in found] == ["\n", "3\n", "b\n"]
        for wrong in ("```python\n1 / 0\n```\n", "```sh\nfalse\n```\n"):
            with pytest.raises(AssertionError, match="line 1 failed"):
                session.run(blocks.blocks(wrong)[0])


def test_a_block_that_is_marked_is_not_run_and_text_after_prose_is_not_its_output():
    marked = page_of('```sh title="Not run by the tests: a board is needed"', "false", "```")
    assert blocks.blocks(marked) == []
    assert [reason for _, reason in blocks.fences(marked)] == ["a board is needed"]
    apart = page_of("```sh", "true", "```", "Prose.", "```text", "a", "```")
    assert blocks.blocks(apart)[0].expected is None


def test_a_block_that_hangs_is_stopped_with_what_it_started(tmp_path, monkeypatch):
    monkeypatch.setattr(blocks, "LONGEST", 0.5)
    with blocks.Session(tmp_path) as session:
        for hanging in ("```sh\nsleep 60 &\n```\n", "```python\nimport time; time.sleep(60)\n```\n"):
            with pytest.raises(AssertionError, match="stopped after"):
                session.run(blocks.blocks(hanging)[0])


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
