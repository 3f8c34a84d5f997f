"""Attitude error of a filter 20 s after bad samples, on seeds outside the tests; writes into docs/reliability.md.

Every filter that holds on to a vector replays a motion by hand (`moving` in tests/test_mekf.py) with and without bad
samples of one sensor: one, two, or those of a second (all the same, noise, zeros), of each size in
tests/test_bad_samples.py. The measure is the largest angle between both attitudes from 20 s after the last bad sample
on; of the vertical where nothing shows the heading.

Run: ``python benches/bad_samples.py [--seeds N] [--first SEED] [--write]``. With `--write` the table goes between the
marks of the page, otherwise to standard output. Twenty-two logs take two minutes on one core.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from imufit.replaying import replay
from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from test_bad_samples import AT, FILTERS, KINDS, LEFT, SIZES, apart, hand, with_bad  # noqa: E402  lies beside the tests

PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- bad samples -->", "<!-- end of bad samples -->"
NAMES = {
    "one": "one",
    "two": "two",
    "const": "a second, all the same",
    "noise": "a second of noise",
    "zero": "a second of zeros",
}


def left(seeds: range) -> dict[str, dict[str, list[float]]]:
    """Return what is left, deg, by kind and filter."""
    found: dict[str, dict[str, list[float]]] = {kind: {name: [] for name in FILTERS} for kind in KINDS}
    for seed in seeds:
        log = hand(seed)
        after = log.t - log.t[0] >= AT + 21.0
        undisturbed = replay(log, list(FILTERS)).attitude
        for sensor, sizes in SIZES.items():
            for kind in KINDS:
                for size in sizes if kind != "zero" else (0.0,):
                    disturbed = replay(with_bad(log, sensor, kind, size, seed), list(FILTERS)).attitude
                    for name in FILTERS:
                        angles = apart(log, name, disturbed[name][after], undisturbed[name][after])
                        found[kind][name].append(float(angles.max()))
    return found


def row(what: str, by_filter: dict[str, list[float]]) -> tuple[str, ...]:
    """Write runs, runs beyond the limit, the most and the filter that it is of."""
    values = np.concatenate(list(by_filter.values()))
    worst = max(by_filter, key=lambda name: max(by_filter[name]))
    return what, str(len(values)), str(int((values > LEFT).sum())), f"{values.max():.2f}", f"`{worst}`"


def page(found: dict[str, dict[str, list[float]]], command: str) -> str:
    """Write the table, and the command that made it."""
    rows = [row(NAMES[kind], found[kind]) for kind in KINDS]
    header = ("bad samples of one sensor", ">runs", f">beyond {LEFT:g} deg", ">most, deg", "by")
    table = Table(title="", header=header, rows=tuple(rows))
    return f"{markdown(table)}\n\n`{command}`"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=22, help="logs")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first one")
    parser.add_argument("--write", action="store_true", help="write into docs/reliability.md")
    given = parser.parse_args()
    text = page(
        left(range(given.first, given.first + given.seeds)),
        f"python benches/bad_samples.py --seeds {given.seeds} --first {given.first}",
    )
    if given.write:
        write_between(PAGE, BEGIN, END, text)
    else:
        print(text)


if __name__ == "__main__":
    main()
