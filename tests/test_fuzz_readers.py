"""The targets of tests/fuzz/readers.py read what they begin with; that no bytes break them is for `make fuzz`."""

import importlib.util
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("fuzz_readers", Path(__file__).parent / "fuzz" / "readers.py")
assert SPEC
assert SPEC.loader
READERS = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(READERS)


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    READERS.lay_seeds(folder)
    return folder


@pytest.mark.parametrize("target", READERS.TARGETS)
def test_target_reads_the_whole_file_it_begins_with(seeds: Path, tmp_path: Path, target: str) -> None:
    READERS.TARGETS[target](tmp_path)((seeds / target / "0").read_bytes())
