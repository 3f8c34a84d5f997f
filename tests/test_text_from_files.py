"""Text that stands in a file is only text: no formula in a figure, no order to a terminal, and not without end."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from imufit.cli.app import main
from imufit.errors import InputError
from imufit.figures.style import new_figure, new_grid
from imufit.log import read
from imufit.printable import printable

HOSTILE = "a\x1b[31mred\x1b]0;title\x07\x9b2J\u202ecba\u2028\ud800"


def table(**more: object) -> pd.DataFrame:
    t = np.arange(60) / 100
    return pd.DataFrame({"t": t, "acc_x": 0.1 * t, "acc_y": 0.0 * t, "acc_z": 9.8 + 0.0 * t, **more})


def test_what_a_terminal_would_obey_is_escaped():
    shown = printable(HOSTILE)
    assert shown.isascii()
    assert shown.isprintable()
    assert printable("°²µ –") == "°²µ –"
    assert printable(shown) == shown


def test_long_text_keeps_both_ends():
    shown = printable("begin" + "x" * 65_000 + "end", 100)
    assert len(shown) == 100
    assert shown.startswith("begin")
    assert shown.endswith("end")


def test_name_of_a_column_is_printable_wherever_it_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "a.parquet"
    name = HOSTILE.rstrip("\ud800")
    table(**{name: 1.0, "y" * 65_000: 2.0}).to_parquet(path)
    log = read(path)
    assert all(each.isascii() and each.isprintable() and len(each) <= 100 for each in log.covariates)
    assert len(log.covariates) == 2
    assert read(path, {"vbat": printable(name, 100)}).covariates["vbat"][0] == 1.0
    assert main(["convert", str(path), "-o", str(tmp_path / "b.csv")]) == 0
    told = capsys.readouterr()
    assert not set(told.out + told.err) & set("\x1b\x07\x9b\u202e\u2028")
    assert max(map(len, told.out.splitlines())) < 1000


def test_labels_of_a_log_are_printable_where_they_are_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "a.parquet"
    table(state="\x1b[2J" + "z" * 65_000).to_parquet(path)
    assert main(["convert", str(path), "-o", str(tmp_path / "b.parquet")]) == 0
    told = capsys.readouterr().out
    assert "\x1b" not in told
    assert len(told) < 10_000


@pytest.mark.parametrize("column", ["acc_x", "pose"])
def test_message_about_a_cell_is_printable_and_bounded(tmp_path: Path, capsys, column: str):
    path = tmp_path / "a.csv"
    table(**{column: ["1"] * 59 + ["\x1b]0;evil\x07" + "y" * 65_000]}).to_csv(path, index=False)
    assert main(["replay", str(path)]) == 2
    told = capsys.readouterr().err
    assert len(told) < 1000
    assert told.rstrip("\n").isprintable()


def test_error_is_printable_and_bounded():
    error = InputError(HOSTILE * 1000, file="/tmp/" + HOSTILE, column="x" * 65_000, remedy=HOSTILE * 1000)
    assert str(error).isprintable()
    assert len(str(error)) < 3000


@pytest.mark.parametrize("name", [r"$\href{http://x}$", r"$\frac{$", "$a$", r"\$"])
def test_dollars_in_a_name_begin_no_formula(name: str):
    single = new_figure(4.0, 3.0)
    grid, (cell,) = new_grid(1, 1, 4.0, 3.0)
    for figure, axes in ((single, single.subplots()), (grid, cell)):
        axes.plot([1.0, 10.0, 100.0], [0.0, 1.0, 2.0], label=name)
        axes.set_xscale("log")
        axes.set_yticks([0.0, 1.0], [name, name])
        axes.set_title(name)
        axes.annotate(name, (1.0, 1.0))
        axes.legend()
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg")
        assert drawn.tell() > 0
        assert all(not text.get_parse_math() for text in axes.get_yticklabels())
        # powers of ten along an axis stay formulas
        assert all(text.get_parse_math() for text in axes.get_xticklabels())
