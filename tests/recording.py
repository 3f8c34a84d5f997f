"""Where the real recordings lie."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("IMUFIT_DATA", Path(__file__).resolve().parents[1] / ".." / "shared" / "data"))


def recording(name: str) -> Path:
    """Path of a recording; without it a test fails in CI and is skipped elsewhere."""
    path = DATA / name
    if not path.exists():
        if os.environ.get("CI") == "true":
            pytest.fail(f"the recordings are missing: {path}; set IMUFIT_DATA")
        pytest.skip("the recordings are missing")
    return path
