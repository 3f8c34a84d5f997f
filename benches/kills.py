"""A recorder is killed at random instants, from the first sample on: how much of what was sent `imufit recover` has.

One emulated device runs all the time on a pty, 500 samples a second. `imufit record`, a process of its own, is killed
(SIGKILL) so long after the first sample that it was sent as chance has it, evenly from 0 s to `--span`; then the log is
recovered and held against what the device sent, value by value. Printed: how many logs were recovered, how many
recorders were killed before they had read anything, and the time before the kill from which on samples were lost.

Run: ``python benches/kills.py [--kills N] [--span S] [--seed N] [--write]``; ``--write`` puts the figures into
docs/reliability.md.
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
import tempfile
from pathlib import Path

import numpy as np
from marked import write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from killed_recorder import RATE, Kill, kill_one, running_device  # noqa: E402  lies beside the tests

PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- kills -->", "<!-- end of kills -->"


def killed(kills: int, span: float, seed: int) -> list[Kill]:
    """Kill so many recorders, one after another, each within `span` (s) of its first sample."""
    found = []
    with running_device() as device:
        for wait in np.random.default_rng(seed).uniform(0.0, span, kills):
            with tempfile.TemporaryDirectory() as folder:
                found.append(kill_one(device, float(wait), Path(folder)))
            print(f"\r{len(found)} of {kills}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return found


def section(found: list[Kill], span: float, seed: int) -> str:
    """Return the figures as a table."""
    lost = np.array([kill.lost for kill in found])
    unread = [kill for kill in found if not kill.recovered]
    early = max((kill.after for kill in unread), default=0.0)
    rows = [
        ("kills", f"{len(found)}, within {span:g} s of the first sample"),
        ("logs recovered", f"{len(found) - len(unread)}"),
        (
            "killed before anything was read",
            f"{len(unread)}" + (f", at most {early:.3f} s after the first sample" if unread else ""),
        ),
        (
            "lost at the end: median, 95 %, most",
            ", ".join(f"{x:.3f} s" for x in (np.median(lost), np.quantile(lost, 0.95), lost.max())),
        ),
    ]
    table = "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    command = f"`python benches/kills.py --kills {len(found)} --span {span:g} --seed {seed}`"
    return f"{table}\n\n{command}, {RATE:.0f} samples a second, load of the machine {load:.1f} per core."


def main() -> None:
    """Kill, recover, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200, help="recorders to kill")
    parser.add_argument("--span", type=float, default=3.0, help="latest kill after the first sample, s")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6), help="of the instants; fresh without it")
    parser.add_argument("--write", action="store_true", help="put the figures into docs/reliability.md")
    given = parser.parse_args()
    text = section(killed(given.kills, given.span, given.seed), given.span, given.seed)
    print(text)
    if given.write:
        write_between(PAGE, BEGIN, END, text)


if __name__ == "__main__":
    main()
