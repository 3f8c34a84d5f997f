"""The page of other makers' files is what imufit answers to them."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

import pytest
from recording import DATA, recording

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def bench() -> dict[str, Any]:
    sys.path.insert(0, str(ROOT / "benches"))
    try:
        return runpy.run_path(str(ROOT / "benches" / "foreign_files.py"))
    finally:
        sys.path.remove(str(ROOT / "benches"))


def written(bench: dict[str, Any], marks: str) -> str:
    begin, end = bench[marks]
    return str(bench["PAGE"].read_text(encoding="utf-8")).partition(begin)[2].partition(end)[0].strip()


def test_table_of_layouts(bench: dict[str, Any]) -> None:
    assert written(bench, "LAYOUTS") == bench["table_of_layouts"](), "refresh with benches/foreign_files.py --write"


def test_table_of_recordings(bench: dict[str, Any]) -> None:
    for name in bench["NATIVE"]:
        recording(name)
    found = bench["table_of_recordings"](DATA)
    assert written(bench, "RECORDED") == found, "refresh with benches/foreign_files.py --write"
    assert "refused with the mapping" not in found
