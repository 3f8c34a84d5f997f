"""The command line, run as a user runs it."""

from __future__ import annotations

import subprocess
import sys

LONGEST = 300
"""Longest time that a command may take, s: ten times the slowest that was seen."""


def imufit(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `imufit` with this interpreter."""
    command = [sys.executable, "-m", "imufit.cli.app", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
