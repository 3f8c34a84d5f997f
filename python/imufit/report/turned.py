"""Figures in space that a reader turns: the lines, points and words of the drawing, projected anew by a script.

The script needs no library. Without it the figure stays as it was drawn.
"""

from __future__ import annotations

import json
import math
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup
from matplotlib.colors import to_hex

from imufit.figures.style import GREY, INK
from imufit.report.inline_svg import themed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from imufit.figures.style import PlainFigure


def script() -> str:
    """Return the script that turns every figure in space of a page."""
    return files("imufit.report").joinpath("templates/space.js").read_text(encoding="utf-8")


def turned(figure: PlainFigure, still: Markup) -> Markup:
    """Return a figure in space with the contents that the script turns.

    Parameters
    ----------
    figure : PlainFigure
        The figure; its first axes are in space.
    still : Markup
        The figure as it was drawn.
    """
    data = json.dumps(scene(figure.axes[0]), allow_nan=False).replace("<", "\\u003c")
    block = f'<script type="application/json">{data}</script>'
    return Markup('<div class="space" tabindex="0">{}{}</div>').format(still, Markup(block))


def scene(axes: Any) -> dict[str, Any]:
    """Return lines, points and words of axes in space, in parts of half the width of their cube.

    Parameters
    ----------
    axes : Axes3D
        Drawn and complete.
    """
    ends = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], dtype=float)
    middle, half = ends.mean(axis=1), 0.5 * np.ptp(ends, axis=1)

    def placed(points: Any) -> list[list[float]]:
        found: NDArray[np.float64] = (np.asarray(points, dtype=float) - middle) / half
        return [[round(float(value), 4) for value in row] for row in found]

    lines = [
        {
            "at": placed(np.stack(line.get_data_3d(), axis=1)),
            "colour": themed(to_hex(line.get_color())),
            "width": line.get_linewidth() if line.get_linestyle() != "None" else 0.0,
            "dashed": line.get_linestyle() == "--",
            "dot": line.get_markersize() if line.get_marker() not in ("None", "", None) else 0.0,
        }
        for line in axes.lines
    ]
    words = [
        {"at": placed([text.get_position_3d()])[0], "text": text.get_text(), "colour": themed(to_hex(text.get_color()))}
        for text in axes.texts
    ]
    if axes.get_xlabel():
        corner = -np.ones(3)
        for k, axis in enumerate((axes.xaxis, axes.yaxis, axes.zaxis)):
            end = corner + 2.0 * np.eye(3)[k]
            edge = [corner.tolist(), end.tolist()]
            lines.append({"at": edge, "colour": themed(to_hex(GREY)), "width": 0.8, "dashed": False})
            words.append({"at": end.tolist(), "text": axis.get_label_text(), "colour": themed(to_hex(INK))})
    view = [math.radians(axes.elev), math.radians(axes.azim)]
    return {"view": view, "lines": lines, "words": words}
