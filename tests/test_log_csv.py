"""Text tables as they come: separators, comments, preambles, quoting, encodings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, read

ROWS = [("0", "20", "0", "-40.5"), ("0.5", "21", "", "-4.1e1"), ("1", "22", "NaN", "-41")]


def text(separator: str, header: str = "t,mag_x,mag_y,mag_z") -> str:
    return "\n".join(separator.join(line) for line in (header.split(","), *ROWS)) + "\n"


def check(log: Log) -> None:
    assert log.mag is not None
    np.testing.assert_array_equal(log.t, [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(log.mag, [[20, 0, -40.5], [21, np.nan, -41], [22, np.nan, -41]])


@pytest.mark.parametrize("separator", [",", ";", "\t", " , ", "; "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_separators_and_line_ends(tmp_path: Path, separator: str, end: str) -> None:
    (tmp_path / "a.csv").write_bytes(text(separator).replace("\n", end).encode())
    check(read(tmp_path / "a.csv"))


@pytest.mark.parametrize("separator", [" ", "   ", " \t "])
def test_blanks_between_columns(tmp_path: Path, separator: str) -> None:
    lines = text(separator).replace(separator * 2, f"{separator}nan{separator}").splitlines()
    (tmp_path / "a.txt").write_text("".join(f"  {line}  \n" for line in lines))
    check(read(tmp_path / "a.txt"))


def test_comments_blank_lines_and_byte_order_mark(tmp_path: Path) -> None:
    lines = text(",").splitlines()
    lines[2:2] = ["# a remark", "", "   "]
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + "\n".join(["% made by hand", "", *lines]).encode())
    check(read(tmp_path / "a.csv"))


def test_quoted_numbers_and_last_line_without_end(tmp_path: Path) -> None:
    lines = text(",").splitlines()
    lines[1:] = [",".join(f'"{cell}"' for cell in line.split(",")) for line in lines[1:]]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    check(read(tmp_path / "a.csv"))


def test_trailing_separator(tmp_path: Path) -> None:
    lines = text(",").splitlines()
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *(line + "," for line in lines[1:])]))
    check(read(tmp_path / "a.csv"))


def test_preamble_is_skipped_and_noted(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Rate,100\nRange,2\n" + text(","))
    log = read(tmp_path / "a.csv")
    check(log)
    assert log.notes[:1] == ("a.csv: 2 lines before the header skipped",)


def test_header_in_a_comment(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("# " + text(","))
    check(read(tmp_path / "a.csv"))


def test_no_header_gives_numbered_columns(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text(",").split("\n", 1)[1])
    log = read(tmp_path / "a.csv", {"t": "c1", "mag_x": "c2", "mag_y": "c3", "mag_z": "c4"})
    check(log)
    assert log.notes[:1] == ("a.csv: no header: the columns are called c1 to c4",)


def test_header_of_another_length(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,mag_x\n0,1,2,3\n1,1,2,3\n")
    with pytest.raises(InputError) as caught:
        read(tmp_path / "a.csv")
    assert str(caught.value) == (
        "a.csv: line 1: the header has 2 names, but the rows have 4 fields. Give every column one name."
    )


def test_western_code_page(tmp_path: Path) -> None:
    lines = text(",").splitlines()
    lines = [lines[0] + ",Temp (°C),note", *(line + ",25,naïve" for line in lines[1:])]
    (tmp_path / "a.csv").write_bytes("\n".join(lines).encode("cp1252"))
    log = read(tmp_path / "a.csv", {"temp": "Temp (°C)"})
    check(log)
    assert log.temp is not None
    assert log.temp[0] == 25.0
    assert log.labels["note"][2] == "naïve"


def test_text_that_begins_as_numbers_is_kept(tmp_path: Path) -> None:
    n = 200_000
    lines = [f"{i / 100},20,0,-40,{i if i < n - 1 else 'end'},{'True' if i % 2 else 'false'}" for i in range(n)]
    (tmp_path / "a.csv").write_text("\n".join(["t,mag_x,mag_y,mag_z,mark,armed", *lines]))
    log = read(tmp_path / "a.csv")
    assert (log.labels["mark"][0], log.labels["mark"][-1]) == ("0", "end")
    assert list(log.covariates["armed"][:2]) == [0.0, 1.0]
