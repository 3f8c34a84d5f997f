"""The blind protocol at full length, its power curve, and the page with both.

Every set of `imufit.grade` with as many logs as acceptance asks for (or `--logs` of each), then the same effects at
growing sizes. Fresh seeds unless `--seed` is given. Without `--write` the tables go to standard output only; with it
they go between the marks of docs/blind.md, and the curve to docs/pictures/blind_power.png.

Run: ``python benches/blind.py [--write] [--seed N] [--logs N] [--power N] [--processes N] [--set NAME]...
[--from FILE]... [--json FILE]``. On two processors it takes about an hour. `--from` takes marks and power curve of
earlier runs (`imufit grade --json FILE`, or `--json` here) in place of new ones.
"""

import argparse
import json
import platform
import secrets
import sys
from pathlib import Path

from imufit.lab.grade import SETS, BlindGrade, PowerCurve, grade, power_curve
from imufit.results import Table
from marked import markdown, write_between

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE, PICTURE = DOCS / "blind.md", DOCS / "pictures" / "blind_power.png"
BEGIN, END = "<!-- measured by benches/blind.py -->", "<!-- end of what was measured -->"


def told(done: int, of: int, what: str) -> None:
    print(f"\r{what}: {done} of {of} ", end="", file=sys.stderr, flush=True)


def judged(sets: list[str], logs: int | None, seed: int, processes: int | None) -> BlindGrade:
    trials = []
    for name in sets:
        print(f"\n{name}", file=sys.stderr)
        found = grade([name], logs=logs or SETS[name].logs, seed=seed, processes=processes, progress=told)
        trials += found.trials
    return BlindGrade(tuple(trials))


def together(files: list[Path]) -> tuple[BlindGrade, PowerCurve | None]:
    found = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    points = [point for each in found for point in (each.get("power") or {}).get("points", [])]
    trials = [trial for each in found for trial in BlindGrade.from_dict(each).trials]
    return BlindGrade(tuple(trials)), PowerCurve.from_dict({"points": points}) if points else None


def demands(result: BlindGrade) -> Table:
    """Demand beside what was reached."""
    rows = []
    for row in result.rows():
        for mark, demanded in SETS[row["set"]].demands.items():
            reached = row[mark]
            least = mark in ("named", "covariate")
            met = reached["share"] >= demanded if least else reached["share"] <= demanded
            rows.append(
                (
                    SETS[row["set"]].title,
                    f"`{row['set']}`",
                    mark,
                    f"{'at least' if least else 'at most'} {100 * demanded:g} %",
                    f"{reached['count']} of {reached['of']}",
                    f"{100 * reached['share']:.1f} % ({100 * reached['low']:.1f} to {100 * reached['high']:.1f})",
                    "yes" if met else "no",
                )
            )
    return Table(
        "", ("what is hidden", "set", "mark", ">demanded", ">logs", ">reached (95 % interval)", "met"), tuple(rows)
    )


def ends(result: BlindGrade) -> Table:
    rows = tuple(
        tuple(f"`{cell}`" if k == 0 else cell for k, cell in enumerate(row)) for row in result.tables()[1].rows
    )
    return Table("", result.tables()[1].header, rows)


def power_table(curve: PowerCurve) -> Table:
    rows = []
    for white, real in zip(curve.shares(False), curve.shares(True), strict=True):
        cells = [f"{100 * each[key]['share']:.0f} %" for each in (white, real) for key in ("named", "alone", "wrong")]
        rows.append((f"{white['size']:g}", f"{white['named']['of']}", *cells))
    names = [f">{noise}: {what}" for noise in ("white", "realistic") for what in ("named", "alone", "wrong")]
    return Table("", (">size", ">logs", *names), tuple(rows))


def seeds(result: BlindGrade) -> str:
    first = {trial.blind_set: min(t.seed for t in result.of(trial.blind_set)) for trial in result.trials}
    if len(set(first.values())) == 1:
        return f"Seeds from {next(iter(first.values()))} on,"
    return "First seeds " + ", ".join(f"{seed} (`{name}`)" for name, seed in first.items()) + ";"


def section(result: BlindGrade, curve: PowerCurve | None) -> str:
    parts = [
        f"{seeds(result)} {len(result.trials)} logs, {platform.machine()}, CPython {platform.python_version()}.",
        markdown(demands(result)),
        "At the end of the ladder:",
        markdown(ends(result)),
    ]
    if result.failures:
        lines = "\n".join(result.lines())
        parts += [
            "Every answer with a fault, with what repeats that log alone after `imufit grade`:",
            f"```text\n{lines}\n```",
        ]
    if curve is not None:
        parts += [
            "### How small may an effect be?",
            "![Share of logs whose effect is named, over the effect's size](pictures/blind_power.png)",
            markdown(power_table(curve)),
        ]
    return "\n\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="put what was measured into docs/blind.md")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6), help="first seed; fresh without it")
    parser.add_argument("--logs", type=int, help="logs of each set; as many as acceptance asks for without it")
    parser.add_argument("--power", type=int, default=44, help="effects of the power curve; 0 leaves it out")
    parser.add_argument("--processes", type=int, help="logs at a time")
    parser.add_argument("--set", dest="sets", action="append", choices=list(SETS), help="only these sets; repeatable")
    parser.add_argument("--from", dest="files", action="append", type=Path, help="marks of an earlier run; repeatable")
    parser.add_argument("--json", type=Path, help="write every figure to this file")
    given = parser.parse_args()
    print(f"seed {given.seed}", file=sys.stderr)
    curve = None
    if given.files:
        result, curve = together(given.files)
    else:
        result = judged(given.sets or list(SETS), given.logs, given.seed, given.processes)
    if given.power and curve is None:
        print("\npower curve", file=sys.stderr)
        curve = power_curve(logs=given.power, seed=given.seed, processes=given.processes, progress=told)
    print(file=sys.stderr)
    text = section(result, curve)
    print(text)
    if given.json:
        found = {"seed": given.seed, **result.to_dict(), "power": None if curve is None else curve.to_dict()}
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if given.write:
        write_between(PAGE, BEGIN, END, text)
        if curve is not None:
            curve.plot().savefig(PICTURE, dpi=90)


if __name__ == "__main__":
    main()
