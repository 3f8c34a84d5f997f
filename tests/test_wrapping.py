"""A line of prose never ends within a quantity."""

import pytest
from imufit.cli.output import Output
from imufit.wrapping import lines_of

PROSE = (
    "Gyroscope bias: quadrature and offset leave a rate at standstill. Here y = 1.50 ± 0.29 deg/s (typically 2.86 "
    "deg/s), at the longest 4.83 s. It depends by 0.0200 ± 0.0004 deg/s per g on the force, 12.5 % of all, at 21.5 °C."
)
WHOLE = ("1.50 ± 0.29 deg/s", "2.86 deg/s", "4.83 s", "0.0200 ± 0.0004 deg/s per g", "12.5 %", "21.5 °C")


@pytest.mark.parametrize("width", range(30, 121))
def test_quantities_stay_whole_at_every_width(width):
    lines = lines_of(PROSE, width)
    assert all(len(line) <= width for line in lines)
    assert all(any(quantity in line for line in lines) for quantity in WHOLE)
    assert " ".join(lines) == PROSE


def test_the_terminal_shows_plain_blanks(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    Output().say(PROSE, "two\nlines")
    out = capsys.readouterr().out
    assert "1.50 ± 0.29 deg/s" in out
    assert out.splitlines()[-2:] == ["two", "lines"]
    assert not set(out) & {"\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}"}


@pytest.mark.parametrize("length", [20, 38, 41, 90])
def test_the_name_of_a_file_stays_whole_in_the_terminal(monkeypatch, capsys, length):
    monkeypatch.setenv("COLUMNS", "40")
    name = "/" + "n" * (length - 5) + ".png"
    Output().say(f"wrote {name}")
    assert name in capsys.readouterr().out.split()


def test_a_list_of_numbers_is_broken_and_indents_are_kept():
    lines = lines_of("16384 " * 20, 40, first="  a ", later="    ")
    assert [line[:5] for line in lines] == ["  a 1", "    1", "    1", "    1"][: len(lines)]
    assert len(lines) > 2
