"""Draw the pictures of the documents: an error falling, six sides, three frames, a calibration, two experiments.

python docs/pictures/make.py [FOLDER]
"""

import runpy
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import imufit
import numpy as np
from imufit.figures.style import AXES, GREY, INK, PALE, new_figure
from numpy.typing import NDArray
from PIL import Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HIDDEN = ("acc.lever_arm", "acc.scale", "gyr.g_sensitivity", "gyr.bias_temperature", "mag.hard_iron")

EDGES = np.array([1.5, 1.1, 0.5])
"""Lengths of the drawn box along its x, y and z."""
LYING = {
    "+z": ("+x", "+y", "+z"),
    "+x": ("+z", "+y", "-x"),
    "-z": ("-x", "+y", "-z"),
    "-x": ("-z", "+y", "+x"),
    "+y": ("+x", "+z", "-y"),
    "-y": ("+x", "-z", "+y"),
}
"""For each side that is up: where the box's x, y and z point in the room (x right, y away, z up)."""
WIDTH = 1100
"""Width of a picture that a page wrote, pixels: twice that of a page's text on a desk's screen at most."""
FRAMES = {
    "NED": {"x": (0.0, 1.0, 0.0), "y": (1.0, 0.0, 0.0), "z": (0.0, 0.0, -1.0)},
    "ENU": {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)},
    "NWU": {"x": (0.0, 1.0, 0.0), "y": (-1.0, 0.0, 0.0), "z": (0.0, 0.0, 1.0)},
}
"""Axes of the reference frames in the room: east to the right, north away, up."""
SENSOR = {
    "acc.bias": {"x": 0.15, "y": -0.1, "z": 0.2},
    "acc.scale": {"x": 0.02, "y": -0.015, "z": 0.01},
    "acc.misalignment": {"xy": 0.01, "xz": -0.005},
    "gyr.bias": {"x": 0.01, "y": -0.02, "z": 0.005},
    "gyr.scale": {"x": 0.01, "y": -0.01, "z": 0.02},
    "mag.hard_iron": {"x": 20.0, "y": -10.0, "z": 5.0},
}
"""Errors of the sensor in docs/calibration.md."""


def ladder() -> imufit.Ladder:
    """Find five effects, each three times as strong as the noise, in two minutes on a robot arm."""
    log = imufit.simulate("arm", dict.fromkeys(HIDDEN), size="large").to_log()
    return imufit.ladder(log)


def sides() -> "Figure":
    """Draw a box on a table with each of its six sides up."""
    figure = new_figure(9.0, 5.4)
    grid = figure.add_gridspec(2, 3)
    for place, up in enumerate(LYING):
        _box(figure.add_subplot(grid[place // 3, place % 3]), up)
    return figure


def frames() -> "Figure":
    """Draw the axes of the three reference frames over a map: x of the room is east, y is north."""
    figure = new_figure(9.0, 2.6)
    for place, (name, axes_of) in enumerate(FRAMES.items()):
        _frame(figure.add_subplot(1, 3, place + 1), name, axes_of)
    return figure


def calibration() -> "Figure":
    """Calibrate the sensor of docs/calibration.md."""
    log = imufit.simulate("poses", SENSOR, duration=60.0, seed=1).to_log()
    return imufit.calibrate(log).plot(log)


def tilt(folder: Path) -> None:
    """Draw the pictures of docs/tilt.md: the example does."""
    example = Path(__file__).resolve().parents[2] / "examples" / "paper_b_tilt.py"
    runpy.run_path(str(example))["main"](str(folder), "5")


def hybrid(folder: Path) -> None:
    """Draw the pictures of docs/hybrid.md: the example does."""
    example = Path(__file__).resolve().parents[2] / "examples" / "paper_c_hybrid.py"
    runpy.run_path(str(example))["main"](str(folder))


OF_PAGES = {
    "tutorial_first_log": {
        "readings": "tutorial_readings",
        "residual": "tutorial_residual",
        "ladder": "tutorial_ladder",
    },
    "tutorial_own_effect": {"parabola": "tutorial_parabola", "supply_ladder": "tutorial_supply"},
    "tutorial_real_sensor": {"calibration": "tutorial_calibration", "angles": "tutorial_angles"},
    "join": {"rates": "join_rates"},
}
"""Pictures that the blocks of a page write: what they are called there, and here."""


def of_pages(folder: Path) -> None:
    """Draw the pictures of tutorials: the blocks of these pages do."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    import blocks  # noqa: PLC0415  lies beside the documents

    for page, pictures in OF_PAGES.items():
        text = (Path(__file__).resolve().parents[1] / f"{page}.md").read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as name, blocks.Session(Path(name)) as session:
            blocks.prepare(Path(name))
            for block in blocks.blocks(text):
                session.run(block)
            for there, here in pictures.items():
                _smaller(Path(name) / f"{there}.png", folder / f"{here}.png")


def _smaller(source: Path, target: Path) -> None:
    """Store a picture of the width of a page in 128 colours."""
    with Image.open(source) as picture:
        height = round(picture.height * WIDTH / picture.width)
        scaled = picture.convert("RGB").resize((WIDTH, height)) if picture.width > WIDTH else picture.convert("RGB")
        scaled.quantize(128).save(target, optimize=True)


def _seen(point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Project a point of the room on the paper: what is further away lies further up and to the right."""
    return np.array([point[0] + 0.40 * point[1], point[2] + 0.30 * point[1]])


def _on_map(point: tuple[float, float, float]) -> tuple[float, float]:
    """Project a point of the room as seen from steeply above: north lies up and to the right."""
    return point[0] + 0.55 * point[1], point[2] + 0.45 * point[1]


def _frame(axes: "Axes", name: str, axes_of: dict[str, tuple[float, float, float]]) -> None:
    corners = [_on_map((x, y, 0.0)) for x, y in ((-1.2, -1.2), (1.2, -1.2), (1.2, 1.2), (-1.2, 1.2))]
    axes.fill(*np.transpose(corners), color=PALE, linewidth=0)
    for word, x, y in (("N", 0.0, 1.5), ("E", 1.45, 0.0), ("S", 0.0, -1.4), ("W", -1.45, 0.0)):
        axes.text(*_on_map((x, y, 0.0)), word, color=GREY, fontsize=11, ha="center", va="center")
    for axis, (x, y, z) in axes_of.items():
        axes.annotate(
            "", _on_map((0.95 * x, 0.95 * y, 0.95 * z)), (0.0, 0.0),
            arrowprops={"arrowstyle": "-|>", "color": AXES[axis], "linewidth": 2.2, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        place = _on_map((1.12 * x, 1.12 * y, 1.12 * z))
        axes.text(*place, axis, color=AXES[axis], fontsize=13, weight="bold", ha="center", va="center")
    axes.plot(0.0, 0.0, "o", color=INK, markersize=5)
    force = 9.8 * axes_of["z"][2]
    axes.set_title(name, fontsize=13, color=INK, weight="bold", pad=2)
    axes.text(0.0, -1.5, f"at rest: 0, 0, {force:+.1f} m/s²", fontsize=10, color=INK, ha="center")
    axes.set_xlim(-1.95, 1.95)
    axes.set_ylim(-1.55, 1.3)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _box(axes: "Axes", up: str) -> None:
    room = {
        sign + name: s * row
        for sign, s in (("+", 1.0), ("-", -1.0))
        for name, row in zip("xyz", np.eye(3), strict=True)
    }
    turned = np.stack([room[name] for name in LYING[up]], axis=1)
    half = 0.5 * np.abs(turned @ EDGES)
    floor = -half[2]
    corners = [_seen(np.array([x, y, floor])) for x, y in ((-1.6, -1.1), (1.6, -1.1), (1.6, 1.1), (-1.6, 1.1))]
    axes.fill(*np.transpose(corners), color=PALE, linewidth=0)
    axes.plot(*np.transpose([corners[0], corners[1]]), color=GREY, linewidth=2.5, solid_capstyle="butt")
    for k, sign, shade in ((1, -1.0, "#C9D3DA"), (2, 1.0, "#F7F9FA"), (0, 1.0, "#AEBBC4")):
        i, j = [n for n in range(3) if n != k]
        face = []
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            point = np.zeros(3)
            point[k], point[i], point[j] = sign * half[k], a * half[i], b * half[j]
            face.append(_seen(point))
        axes.fill(*np.transpose(face), facecolor=shade, edgecolor=INK, linewidth=0.9)
    for name, direction, edge in zip("xyz", turned.T, EDGES, strict=True):
        tip, label = _seen((0.5 * edge + 0.60) * direction), _seen((0.5 * edge + 0.82) * direction)
        axes.annotate(
            "", tip, (0.0, 0.0),
            arrowprops={"arrowstyle": "-|>", "color": AXES[name], "linewidth": 2.2, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        axes.text(*label, name, color=AXES[name], fontsize=13, weight="bold", ha="center", va="center")
    axes.plot(0.0, 0.0, "o", color=INK, markersize=5)
    axes.annotate("", (-2.35, -0.55), (-2.35, 0.55), arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.6})
    axes.text(-2.2, 0.0, "g", color=INK, fontsize=12, style="italic", va="center")
    reading = ", ".join(f"{9.8 * value:+.1f}" if value else "0" for value in turned[2])
    axes.set_title(f"{up} up", fontsize=13, color=INK, weight="bold", pad=2)
    axes.text(0.0, -2.05, f"reads {reading} m/s²", fontsize=10, color=INK, ha="center")
    axes.set_xlim(-2.6, 2.4)
    axes.set_ylim(-2.1, 1.75)
    axes.set_aspect("equal")
    axes.set_axis_off()


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    ladder().plot().savefig(folder / "ladder.png", dpi=110)
    sides().savefig(folder / "sides.png", dpi=90)
    frames().savefig(folder / "frames.png", dpi=90)
    calibration().savefig(folder / "calibration.png", dpi=90)
    tilt(folder)
    hybrid(folder)
    of_pages(folder)
