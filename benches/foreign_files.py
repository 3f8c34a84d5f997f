"""Answers of imufit to other makers' files (tests/foreign_files.py); writes into docs/foreign_files.md.

Run: ``IMUFIT_DATA=... python benches/foreign_files.py [--write]``. It takes half a minute on one core.
"""

import argparse
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from imufit.errors import InputError
from imufit.log import parse_mapping, read
from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from foreign_files import WRITERS, sound, write  # noqa: E402  lies beside the tests

PAGE = ROOT / "docs" / "foreign_files.md"
LAYOUTS = ("<!-- layouts -->", "<!-- /layouts -->")
RECORDED = ("<!-- recorded -->", "<!-- /recorded -->")
SEEDS = {"arm": 774102, "rest": 774104}
"""Seeds of the logs that the layouts are written from, as in tests/test_foreign_files.py."""
NATIVE = (
    "many_positions/mpu6050_poses_raw_counts.csv",
    "many_positions/mpu9150_unit0.log",
    "nine_axis_no_reference/xio_sensor_data.csv",
    "phone_qualisys/native/Thibaud_Nexus5_NoDist_Texting",
    "phone_qualisys/native/Thibaud_Nexus5_NoDist_Texting/accelerometer.txt",
    "px4_ulog/sample.ulg",
    "rocket_messy_csv/government_work_2_airbrakes.csv",
    "serial_transcripts/sixface.log",
    "serial_transcripts/stationary-60s.log",
    "six_positions/ferraris_session_A.csv",
    "uav_motor_current/thor75_motor_log_part1.csv",
)
"""Files of the recordings as their makers' programs wrote them; the rest of the sets is logs of imufit already."""
FIELDS = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer", "temp": "temperature"}


@cache
def body(kind):
    return sound(kind, SEEDS[kind])


def answer(path: Path) -> str:
    """Read a file with no option: what came of it, or what is asked and what the pasted mapping gives."""
    try:
        return f"read: {held(read(path))}"
    except InputError as error:
        maps = re.findall(r"--map (?:'([^']*)'|(\S+?)\.?(?:\s|$))", error.shell_remedy or "")
        # a message without a proposal shows how a mapping is written
        maps = [one or other for one, other in maps if "COLUMN" not in other]
        if len(maps) != 1:
            return f"refused: {cell(error.problem)}"
        mapping = parse_mapping(maps[0])
    try:
        made = held(read(path, mapping))
    except InputError as again:
        return f"asked, and refused with the mapping: {cell(again.problem)}"
    return f"asked: `{cell(shown(mapping))}` gives {made}"


def held(log) -> str:
    names = [words for name, words in FIELDS.items() if getattr(log, name) is not None]
    return ", ".join([*names, *(["reference"] if log.ref_q is not None else [])]) or "nothing"


def shown(mapping: dict[str, str]) -> str:
    """Write a mapping with the x axis of each sensor alone."""
    return ",".join(f"{target}={text}" for target, text in mapping.items() if not target.endswith(("_y", "_z")))


def cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def layouts() -> Iterator[tuple[str, str, str]]:
    for name in sorted(WRITERS):
        with TemporaryDirectory() as folder:
            answers = [answer(write(name, Path(folder) / kind, body(kind)).path) for kind in ("arm", "rest")]
        yield name, answers[0], "the same" if answers[1] == answers[0] else answers[1]


def table_of_layouts() -> str:
    return markdown(Table("", ("layout", "of a robot arm", "at rest"), tuple(layouts())))


def table_of_recordings(data: Path) -> str:
    return markdown(Table("", ("file", "answer"), tuple((name, answer(data / name)) for name in NATIVE)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    data = Path(os.environ.get("IMUFIT_DATA", ROOT / ".." / "shared" / "data"))
    for marks, text in ((LAYOUTS, table_of_layouts()), (RECORDED, table_of_recordings(data))):
        if given.write:
            write_between(PAGE, *marks, text)
        else:
            print(text)


if __name__ == "__main__":
    main()
