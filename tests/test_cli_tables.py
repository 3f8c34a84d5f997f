"""Tables on a screen of eighty columns: as a table wherever one of its forms fits."""

import pytest
from imufit.cli.output import Output
from imufit.results import Table


@pytest.fixture
def shown(monkeypatch, capsys):
    """Print a table on a screen so wide and return its lines."""

    def show(table, width=80):
        monkeypatch.setenv("COLUMNS", str(width))
        Output().table(table)
        lines = capsys.readouterr().out.splitlines()
        assert all(len(line) <= width for line in lines)
        return [line.split() for line in lines if line.strip() and not set(line) <= set(" ─")]

    return show


def numbered(header, rows):
    return Table("", header, tuple(tuple(f"{k}.{place}" for place in range(len(header))) for k in range(rows)))


def test_a_column_without_a_cell_does_not_make_a_table_fall_apart(shown):
    table = Table("", (">pose", "up", ">" + "w" * 60, "remark"), (("1", "+z", "3", ""), ("2", "-z", "4", "")))
    assert shown(table) == [["pose", "up", "w" * 60], ["1", "+z", "3"], ["2", "-z", "4"]]


def test_long_names_over_narrow_cells_are_broken(shown):
    table = numbered(("axis", *(f">residual of axis {k}" for k in range(5))), 3)
    lines = shown(table)
    assert [f"2.{place}" for place in range(6)] in lines
    assert lines[0] == ["residual"] * 5


def test_a_wide_table_of_few_rows_is_turned_and_a_wide_one_of_many_becomes_blocks(shown):
    header = ("figure", *(f">{'method' * 2}{k}" for k in range(7)))
    turned = shown(numbered(header, 3))
    assert turned[0] == ["figure", "0.0", "1.0", "2.0"]
    assert turned[1] == ["methodmethod0", "0.1", "1.1", "2.1"]
    blocks = shown(numbered(header, 30))
    assert blocks[:2] == [["0.0"], ["methodmethod0", "0.1"]]


def test_a_block_with_a_bare_number_at_its_head_names_it(shown):
    table = Table("", (">pose", *(f">{'w' * 30}{k}" for k in range(3))), (("1", "2", "3", "4"),) * 2)
    assert shown(table)[0] == ["pose", "1"]
