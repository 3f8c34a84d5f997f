"""Findings of imufit in real recordings, and their confirmation by other parts; writes docs/recordings.md.

Each sensor of the recordings is asked on several parts (halves of a recording, stretches of a flight, groups of short
recordings): the ladder climbs each part alone, and every effect it finds is looked up on the others (`confirmed.py`).
Recordings without a reference attitude are calibrated and confirmed by the poses that had no part in it
(`halves_of_poses.py`). The models that the ladder found are applied to trials that had no part in them, and the
attitude error of a filter is judged with and without (`applied.py`).

Run: ``python benches/recordings.py [FOLDER] [--write] [--sensor NAME]... [--from FILE]... [--json FILE]``. Without
`--write` the tables go to standard output only; with it they go between the marks of the page. `--from` takes what an
earlier run wrote with `--json`; `--sensor` along with it measures these besides. `attitude` takes its models from the
sensors of the same run and of earlier ones.
"""

import argparse
import itertools
import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from applied import Applied, applied, every_trial, trials_of
from confirmed import CHANCE, Climbed, Climber, Found, Part, Sensor, halves
from halves_of_poses import Calibrated, calibrated
from imufit.figures import quantity
from imufit.results import Parameter, Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
FOLDER, PAGE = ROOT / ".." / "shared" / "data", ROOT / "docs" / "recordings.md"
BEGIN, END = "<!-- measured by benches/recordings.py -->", "<!-- end of what was measured -->"


def arm(sensor: str) -> tuple[Part, ...]:
    """Return the recordings of the robot arm by speed: one alone lasts 10 to 60 s."""
    speeds = {150: (1, 2, 3), 300: (1, 3, 4), 800: (1, 3, 4)}
    return tuple(
        Part(
            f"{speed} mm/s, {len(paths)} paths", tuple(f"robot_arm/{sensor}_path{n}_{speed}mms.parquet" for n in paths)
        )
        for speed, paths in speeds.items()
    )


def quarters(file: str, name: str) -> tuple[Part, ...]:
    """Return the two middle quarters of a trial of BROAD, in which it moves: 46 s, 13,000 rows each."""
    return tuple(
        Part(f"{name}, {quarter} quarter", (f"broad/{file}.parquet",), begin, begin + 0.25)
        for quarter, begin in (("2nd", 0.25), ("3rd", 0.5))
    )


def rig(*names: str) -> tuple[Part, ...]:
    """Return a hundred seconds of each half of the recordings of the encoder rig."""
    return tuple(
        part for name in names for part in halves(f"encoder_rig/{name}.parquet", name.replace("_", " "), 2 / 15)
    )


def flight(*cuts: float) -> tuple[Part, ...]:
    file = "uav_motor_current/thor75_part1.parquet"
    return tuple(
        Part(f"{340 * begin:.0f} to {340 * end:.0f} s", (file,), begin, end) for begin, end in itertools.pairwise(cuts)
    )


SENSORS = {
    "broad": Sensor(
        "BROAD, myon aktos-t",
        (*quarters("07_undisturbed_fast_rotation_B", "07"), *quarters("21_undisturbed_fast_combined", "21")),
    ),
    "broad-beside": Sensor("BROAD, a magnet stands beside", quarters("29_disturbed_stationary_magnet_B", "29")),
    "broad-on": Sensor("BROAD, a magnet 2 cm off moves along", quarters("33_disturbed_attached_magnet_2cm", "33")),
    "arm-9150": Sensor("robot arm, MPU9150", arm("MPU9150")),
    "arm-6050": Sensor("robot arm, MPU6050 + RM3100", arm("MPU6050RM3100")),
    "rig": Sensor("encoder rig, MPU6050", rig("roll_slow", "pitch_medium", "yaw_medium")),
    "flight": Sensor("aircraft, IMU and magnetometer", flight(0.25, 0.5, 0.75, 1.0)),
    "phone": Sensor(
        "phone in the hand, Nexus 5",
        tuple(
            part
            for name in ("Texting", "AR")
            for part in halves(f"phone_qualisys/Thibaud_Nexus5_NoDist_{name}.parquet", name)
        ),
    ),
}
BROAD_TRIALS = "broad/*.parquet"
APPLIED = {
    "BROAD, myon aktos-t": ("broad", "broad-beside", "broad-on"),
    "robot arm, MPU9150": ("arm-9150",),
    "robot arm, MPU6050 + RM3100": ("arm-6050",),
    "encoder rig, MPU6050": ("rig",),
    "aircraft, IMU and magnetometer": ("flight",),
    "phone in the hand, Nexus 5": ("phone",),
}
"""Sensors, and the owners of the parts that test their models."""
RESTS = tuple(
    f"mpu6050_hmc5883l/set-2_unmoved-with-{name}.parquet"
    for name in ("x-pointing-forward-10min", "z-pointing-front-and-x-up", "z-pointing-front-and-y-down")
)
CALIBRATED = {
    "many_positions/mpu6050_poses.parquet": ("many positions, MPU6050", ()),
    "many_positions/mpu9150_unit0.parquet": ("many positions, MPU9150 unit 0", ()),
    "many_positions/mpu9150_unit1.parquet": ("many positions, MPU9150 unit 1", ()),
    "many_positions/mpu9150_unit3.parquet": ("many positions, MPU9150 unit 3", ()),
    "many_positions/xsens_mti_37_poses.parquet": ("many positions, Xsens MTi", ()),
    "six_positions/ferraris_session_A.parquet": ("six positions, session A", ()),
    "mpu6050_hmc5883l/set-2_full-sphere.parquet": ("MPU6050 + HMC5883L, turned freely", RESTS),
}


def in_words(parameters: tuple[Parameter, ...], limit: int = 3) -> str:
    """Write the parameters that stand out most from their errors, with two standard errors."""

    def weight(p: Parameter) -> float:
        return abs(p.value) / p.standard_error if p.standard_error > 0.0 else 0.0

    chosen = sorted((p for p in parameters if p.told), key=weight, reverse=True)[:limit]
    shown = [
        f"{p.name} {quantity.with_error(p.value, CHANCE * p.standard_error, p.unit)}" for p in parameters if p in chosen
    ]
    return ", ".join(shown) or "not determined"


def answer(verdict: str, best: str | None, rivals: tuple[str, ...]) -> str:
    named = " or ".join(f"`{each}`" for each in dict.fromkeys([*([best] if best else []), *rivals]))
    return f"{verdict} {named}".strip()


def part_row(climbed: Climbed, part: Part) -> list[str]:
    if part.title in climbed.failures:
        return [climbed.sensor.title, part.title, "-", "-", climbed.failures[part.title], "-"]
    ladder = climbed.ladders[part.title]
    first = ladder.first
    steps = ", ".join(f"`{step.effect}` {quantity.ratio(step.after)}" for step in ladder.steps)
    return [
        climbed.sensor.title,
        part.title,
        "-" if first is None else answer(first.verdict, first.best, first.ambiguous_with),
        f"{quantity.ratio(ladder.ratio_start)} → {quantity.ratio(ladder.ratio_end)}",
        steps or "-",
        answer(ladder.verdict, ladder.diagnosis.best, ladder.diagnosis.ambiguous_with),
    ]


def found_row(climbed: Climbed, found: Found) -> list[str]:
    ratios = [f"{ratio.part}: {ratio}" for ratio in found.ratios]
    return [
        climbed.sensor.title,
        f"`{found.effect}`",
        f"{len(found.on)} of {len(climbed.ladders)}",
        f"{in_words(found.parameters)} ({found.best})",
        "; ".join(ratios) or "-",
        found.answer,
        ", ".join(found.first_answer_of) or "-",
    ]


def calibrated_row(found: Calibrated) -> list[str]:
    errors = [quantity.quantity(value, found.unit) for value in (found.before, found.held_out)]
    return [
        found.recording,
        f"`{found.effect}`",
        in_words(found.parameters),
        f"{errors[0]} → {errors[1]}",
        found.confirmed_by,
        "-" if found.ratio is None else str(found.ratio),
    ]


def applied_row(sensor: str, found: Applied) -> list[str]:
    return [
        sensor,
        found.trial,
        ", ".join(f"`{effect}`" for effect in found.effects),
        found.part,
        f"{found.without:.2f}",
        f"{found.with_model:.2f}",
        "yes" if found.no_worse else "no",
    ]


HEADERS = {
    "parts": ("sensor", "part", "first answer", ">error over floor", "added, error after", "ends as"),
    "effects": (
        "sensor",
        "effect",
        ">found on",
        "size ± 2 SE, where it shows best",
        "ratio elsewhere",
        "confirmed",
        "first answer of",
    ),
    "calibrated": (
        "recording",
        "effect",
        "size ± 2 SE",
        ">error before → held out",
        "held out",
        ">second half / first",
    ),
    "attitude": (
        "sensor",
        "trial",
        "model of the other trials",
        "error",
        ">without, deg",
        ">with it, deg",
        "less, or within 5 %",
    ),
}
MODELS = "models"
"""Rows (sensor's name, part, effects with their parameters): no table, but what `attitude` is measured with."""


def measured(folder: Path, names: list[str], models: Sequence[list[Any]] = ()) -> dict[str, list[list[Any]]]:
    rows: dict[str, list[list[Any]]] = {name: [] for name in (*HEADERS, MODELS)}
    climber = Climber(folder)
    for name in names:
        if name == "calibrated":
            for file, (title, rests) in CALIBRATED.items():
                rows["calibrated"] += [calibrated_row(each) for each in calibrated(folder, file, title, rests)]
        elif name == "attitude":
            rows["attitude"] += attitude_rows(folder, [*models, *rows[MODELS]])
        else:
            climbed = climber.climb(SENSORS[name])
            rows["parts"] += [part_row(climbed, part) for part in climbed.sensor.parts]
            rows["effects"] += [found_row(climbed, each) for each in climbed.found]
            rows[MODELS] += [[name, title, each.fit.model.parameters] for title, each in climbed.ladders.items()]
    return rows


def attitude_rows(folder: Path, models: Sequence[list[Any]]) -> list[list[str]]:
    found = {(name, title): parameters for name, title, parameters in models}
    rows = []
    for sensor, names in APPLIED.items():
        every = [(part, (name, part.title)) for name in names for part in SENSORS[name].parts]
        parts = {part: found[key] for part, key in every if key in found}
        trials = every_trial(folder, BROAD_TRIALS) if "broad" in names else trials_of(list(parts))
        rows += [applied_row(sensor, each) for each in applied(folder, parts, trials if parts else ())]
    return rows


def no_worse(rows: list[list[str]]) -> str:
    """Count the trials that a model of the others does not make worse."""
    good = sum(row[-1] == "yes" for row in rows)
    less = sum(float(row[5]) < float(row[4]) for row in rows)
    return (
        f"The error is less, or within 5 %, in {good} of {len(rows)} trials ({100.0 * good / len(rows):.0f} %), "
        f"and less in {less}."
    )


def summary(rows: dict[str, list[list[str]]]) -> list[tuple[str, ...]]:
    """One row for each sensor: errors of its parts, what other parts confirm of what was found, and what not."""
    found = []
    for sensor in dict.fromkeys(row[0] for row in rows["parts"]):
        effects = [row for row in rows["effects"] if row[0] == sensor]
        by_answer = [
            ", ".join(row[1] for row in effects if row[5] == answer) or "-" for answer in ("yes", "no", "not seen")
        ]
        named = [f"{row[1]} ({'confirmed' if row[5] == 'yes' else row[5]})" for row in effects if row[6] != "-"]
        errors = "; ".join(row[3] for row in rows["parts"] if row[0] == sensor)
        found.append((sensor, errors, ", ".join(named) or "-", *by_answer))
    return found


def counted(rows: dict[str, list[list[str]]]) -> str:
    """State how many effects other parts determine, and how many they confirm."""
    answers = Counter(row[5] for row in rows["effects"])
    first = Counter(row[5] for row in rows["effects"] if row[6] != "-")
    told, ends = answers["yes"] + answers["no"], Counter(row[5].split()[0] for row in rows["parts"])
    return (
        f"Other parts determine {told} of the {answers.total()} effects above: {answers['yes']} of them "
        f"({100.0 * answers['yes'] / max(told, 1):.0f} %) are confirmed, {answers['no']} are not. Of those that are "
        f"the first answer of some part, {first['yes']} are confirmed and {first['no']} are not. The ladders end as "
        f"{', '.join(f'`{end}` ({n})' for end, n in ends.most_common())}."
    )


def section(rows: dict[str, list[list[str]]]) -> str:
    titles = {
        "parts": "### What the ladder adds, part by part",
        "effects": "### What other parts say of each effect",
        "calibrated": "### Without a reference",
        "attitude": "### What the model is worth on a trial that had no part in it",
    }
    heads = (
        "sensor",
        "error over floor, part by part",
        "first answer `missing`",
        "confirmed",
        "not confirmed",
        "not seen elsewhere",
    )
    parts = [markdown(Table("", heads, tuple(summary(rows)))), counted(rows)] if rows["parts"] else []
    parts += [
        f"{titles[name]}\n\n{markdown(Table('', HEADERS[name], tuple(map(tuple, rows[name]))))}"
        for name in HEADERS
        if rows[name]
    ]
    if rows["attitude"]:
        parts.append(no_worse(rows["attitude"]))
    return "\n\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--write", action="store_true", help="put what was measured into docs/recordings.md")
    names = [*SENSORS, "calibrated", "attitude"]
    parser.add_argument("--sensor", dest="sensors", action="append", choices=names, help="only these; repeatable")
    parser.add_argument("--from", dest="files", action="append", type=Path, help="rows of an earlier run; repeatable")
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    given = parser.parse_args()
    before = time.perf_counter()
    rows: dict[str, list[list[Any]]] = {name: [] for name in (*HEADERS, MODELS)}
    sources: list[dict[str, Any]] = [json.loads(file.read_text(encoding="utf-8")) for file in given.files or []]
    if given.sensors or not sources:
        known = [row for source in sources for row in source.get(MODELS, [])]
        sources.append(measured(given.folder, given.sensors or names, known))
    for source in sources:
        for name, more in source.items():
            rows[name] += more
    text = section(rows)
    print(text)
    print(f"{time.perf_counter() - before:.0f} s", file=sys.stderr)
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    if given.write:
        write_between(PAGE, BEGIN, END, text)


if __name__ == "__main__":
    main()
