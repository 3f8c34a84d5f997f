"""Figures of the last seconds of a device, one panel a sensor, as Plotly takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from imufit.figures import quantity
from imufit.figures.style import AXES, GREY
from imufit.log.columns import GROUPS, SENSOR_NAMES, SENSORS, UNITS
from imufit.printable import NAME, printable
from imufit.studio import charts
from imufit.studio.charts import LABEL, words
from imufit.studio.live.listening import Rest
from imufit.studio.live.rolling import Rolling

PIXELS: Final = 300
"""Points of a trace: half the pixels of a wide panel, which is what an eye follows on a moving trace."""
HEIGHT: Final = 190
"""Height of a panel, px: three of them fit beside the body."""
DIGITS: Final = 5
"""Decimal places of values on their way to the browser: a tenth of the noise of the quietest of these sensors."""
MOST: Final = 8
"""Panels at most: a device may send any number of columns."""


def groups(columns: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Return the panels of a device: title and columns of each.

    Parameters
    ----------
    columns : sequence of str
        Columns of the device.
    """
    found = [
        (SENSOR_NAMES[sensor], GROUPS[sensor]) for sensor in SENSORS if all(axis in columns for axis in GROUPS[sensor])
    ]
    grouped = {name for _, names in found for name in names}
    reference = {name for group in ("ref_q", "ref_p") for name in GROUPS[group]}
    single = [name for name in columns if name not in grouped and name not in reference]
    titles = {"temp": "temperature"}
    return [*found, *((titles.get(name, printable(name, NAME)), (name,)) for name in single)][:MOST]


def panel(rolling: Rolling, title: str, names: Sequence[str], seconds: float, rests: Sequence[Rest]) -> dict[str, Any]:
    """Draw the last seconds of some columns.

    Parameters
    ----------
    rolling : Rolling
        The last rows.
    title : str
        Name of the sensor.
    names : sequence of str
        Its columns.
    seconds : float
        Length of the window, s.
    rests : sequence of Rest
        Times at rest, drawn behind the traces.
    """
    unit = UNITS.get(names[0], "")
    factor, shown = quantity.shown_unit(unit) if unit not in ("", "1") else (1.0, "")
    found = rolling.window(names, seconds, PIXELS)
    span = rolling.span or (0.0, seconds)
    edge = [max(span[1] - seconds, min(span[0], 0.0)), max(span[1], seconds)]
    traces = []
    for name, points in found.items():
        t, values = points.line()
        axis = name[-1] if len(names) > 1 else ""
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": np.round(t, 3).tolist(),
                "y": np.round(factor * values, DIGITS).tolist(),
                "name": axis or words(name),
                "line": {"color": AXES.get(axis, GREY), "width": 1.4},
                "hovertemplate": f"%{{fullData.name}}: %{{y:.4g}} {shown}<extra></extra>",
            }
        )
    # One margin for all panels: their times stand over one another.
    axis_look = {"zeroline": False, "fixedrange": True, "exponentformat": "power"}
    layout = {
        "height": HEIGHT,
        "margin": {"l": 60, "r": 10, "t": 26, "b": 34},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "xaxis": {**axis_look, "range": edge, "title": {"text": "time, s", "standoff": 4}, "nticks": 6},
        "yaxis": {**axis_look, "title": {"text": shown or "value", "standoff": 4}, "nticks": 5},
        "title": {"text": words(title), "x": 0.0, "xanchor": "left", "y": 0.98, "font": {"size": 13}},
        "legend": {"orientation": "h", "x": 1.0, "xanchor": "right", "y": 1.0, "yanchor": "bottom"},
        "hoverlabel": LABEL,
        "showlegend": len(names) > 1,
        "shapes": charts.rests([(rest.begin, rest.end) for rest in rests], *edge),
        "uirevision": "live",
    }
    return {"data": traces, "layout": layout, "config": {"displayModeBar": False, "responsive": True}}
