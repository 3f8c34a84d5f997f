"""The table of docs/conventions.md on other packages: every line is run and leads to the attitude it should."""

import re
from pathlib import Path
from typing import Any

import ahrs
import imufusion
import numpy as np
import pytest
import vqf
from imufit.replaying import convert_frame
from scipy.spatial.transform import Rotation
from test_filters import UP, G, angles, rotation_of, scalar_first

PAGE = Path(__file__).resolve().parent.parent / "docs" / "conventions.md"
TABLE = "## The way to and from other packages"
MADE_OF = {"NED": ("north", "east", "down"), "ENU": ("east", "north", "up"), "NWU": ("north", "west", "up")}


def lines() -> dict[str, list[str]]:
    """First cell of each row, and the code in the last three."""
    section = PAGE.read_text(encoding="utf-8").split(TABLE)[1].split("\n#")[0]
    rows = [row.strip("|").split("|") for row in section.splitlines() if row.startswith("| ")][1:]
    return {row[0].strip(): [(re.findall("`(.*)`", cell) or [""])[0] for cell in row[2:]] for row in rows}


def standing(truth: Rotation, n: int) -> dict[str, Any]:
    """n rows of a sensor that stands at an attitude of NED."""
    back = truth.inv()
    return {
        "acc": np.tile(back.apply(np.array(UP["NED"]) * G), (n, 1)),
        "mag": np.tile(back.apply([20.0, 0.0, 44.0]), (n, 1)),
        "gyr": np.zeros((n, 3)),
        "dt": 0.01,
        "np": np,
        "ahrs": ahrs,
        "vqf": vqf,
        "imufusion": imufusion,
        "convert_frame": convert_frame,
        "Rotation": Rotation,
    }


def test_the_table_has_its_packages() -> None:
    assert list(lines()) == ["scipy", "vqf", "imufusion (default)", "ahrs, `Mahony`", "ahrs, `Madgwick`"]


def test_scipys_lines_are_inverse_to_each_other_and_turn_the_same_vectors() -> None:
    _, from_it, to_it = lines()["scipy"]
    truth = Rotation.random(50, rng=np.random.default_rng(0))
    names: dict[str, Any] = {"Rotation": Rotation, "rotation": truth}
    exec(from_it, names)
    np.testing.assert_array_equal(names["q"], scalar_first(truth))
    exec(to_it, names)
    assert angles(names["rotation"], truth).max() < 1e-15


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("package", [name for name in lines() if name != "scipy"])
def test_a_packages_filter_finds_the_attitude_that_our_readings_have(package: str, seed: int) -> None:
    run, from_it, to_it = lines()[package]
    truth = Rotation.from_rotvec(Rotation.random(rng=np.random.default_rng(seed)).as_rotvec() * 0.6)
    names = standing(truth, 2500)
    if package.startswith("imufusion"):
        names["ahrs_"] = imufusion.Ahrs()
        for k in range(2500):
            exec(run, names | {"k": k})
    else:
        exec(run, names)
    exec(from_it, names)
    assert np.degrees(angles(truth, rotation_of(names["q"][-1:])[0])) < 0.1
    # And back: what it found is what it would have been given.
    found = names["ahrs_"].get_quaternion() if "ahrs_" in names else names["out"][-1]
    exec(to_it, names)
    given = names["ahrs_"].get_quaternion() if "ahrs_" in names else names["out"][-1]
    assert min(np.abs(given - found).max(), np.abs(given + found).max()) < 1e-6


@pytest.mark.parametrize("frame", MADE_OF)
def test_the_table_of_frames_says_where_the_axes_point(frame: str) -> None:
    row = next(line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| `{frame}`"))
    assert tuple(cell.strip() for cell in row.strip("|").split("|")[1:4]) == MADE_OF[frame]


@pytest.mark.parametrize(("side", "start"), [("z up", "NWU"), ("z down", "NED")])
def test_the_table_of_readings_is_what_a_sensor_at_rest_reads(side: str, start: str) -> None:
    row = next(line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {side} |"))
    force, field = (np.array(eval(code)) for code in re.findall("`(.*?)`", row))
    up, down = np.array(UP[start]), -np.array(UP[start])
    np.testing.assert_allclose(force, 9.8 * up)
    np.testing.assert_allclose(field, [20.0, 0.0, 0.0] + 44.0 * down)
