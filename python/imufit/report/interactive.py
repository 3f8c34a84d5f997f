"""The traces as a chart with zoom, values under the pointer and switches for effects, drawn by Bokeh inside the page.

Bokeh's code travels in the page, packed with gzip: 1.3 MB become 0.5 MB. Plotly's code would take 2.0 MB.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from imufit.figures import quantity, style
from imufit.report.inline_svg import PALETTE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from imufit.results import ResidualTrace

LINES: Final = {
    "measured": (style.GREY, "solid", 2.4),
    "predicted": (style.BLUE, "dashed", 1.2),
    "before": (style.ORANGE, "solid", 1.2),
    "residual": (style.BLUE, "solid", 1.2),
}
"""Colour, dashes and width (pixels) of each line, as in the still figure."""
MISSING: Final = -32768
"""Stands for a missing value where values are whole steps."""
_PAPER: Final = "#fefefe"
"""Stands for the page's own colour; Bokeh leaves its default, pure white, out of the chart's JSON."""
_WORDS: Final = {"before": "residual before", "residual": "residual now"}


@dataclass(frozen=True)
class Interactive:
    """Parts of the page that make the traces interactive.

    Attributes
    ----------
    library, view, data : str
        Bokeh's code and the data, packed; the page's own script.
    scripts : tuple of str
        These two scripts, as the page's policy names them.
    channels, effects : tuple of str
        Choices of the reader: channels, the worst first, and effects of the model.
    """

    library: str
    view: str
    data: str
    scripts: tuple[str, ...]
    channels: tuple[str, ...]
    effects: tuple[str, ...]


STILL: Final = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
"""Content security policy of a page without a script."""


def policy(scripts: Sequence[str]) -> str:
    """Return the content security policy: these scripts and nothing else may run, and nothing is fetched.

    Parameters
    ----------
    scripts : sequence of str
        Hashes of the scripts.
    """
    allowed = " ".join(f"'sha256-{each}'" for each in scripts)
    return f"{STILL}; script-src {allowed}; img-src data:" if scripts else STILL


def interactive(traces: Sequence[ResidualTrace]) -> Interactive | None:
    """Make the chart of traces; None without any.

    Parameters
    ----------
    traces : sequence of ResidualTrace
        The channels, the worst first.
    """
    if not traces:
        return None
    packed, library_hash = _library()
    view = files("imufit.report").joinpath("templates/view.js").read_text(encoding="utf-8")
    effects = tuple(dict.fromkeys(effect for trace in traces for effect in trace.parts))
    data = {
        "palette": {colour: f"--{name}" for colour, name in {**PALETTE, _PAPER: "paper"}.items()},
        "item": _chart(traces[0]),
        "channels": {trace.channel: _channel(trace) for trace in traces},
    }
    return Interactive(
        library=packed,
        view=view,
        data=_packed(json.dumps(data, allow_nan=False).encode()),
        scripts=(hash_of(view), library_hash),
        channels=tuple(trace.channel for trace in traces),
        effects=effects,
    )


@cache
def _library() -> tuple[str, str]:
    """Return Bokeh's code, packed, and its hash."""
    code = files("bokeh").joinpath("server/static/js/bokeh.min.js").read_text(encoding="utf-8")
    return _packed(code.encode()), hash_of(code)


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def hash_of(script: str) -> str:
    """Return the hash by which a policy allows a script.

    Parameters
    ----------
    script : str
        Its code.
    """
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _numbers(values: NDArray[np.float64], kind: str = "<f4") -> str:
    return base64.b64encode(np.asarray(values, dtype=kind).tobytes()).decode()


def _channel(trace: ResidualTrace) -> dict[str, Any]:
    """Return the samples of one channel in its shown unit; single precision is finer than any pixel."""
    factor, unit = quantity.shown_unit(trace.unit)
    return {
        "unit": unit,
        "floor": factor * trace.noise_floor if np.isfinite(trace.noise_floor) else 0.0,
        "t": _numbers(trace.t, "<f8"),
        "measured": _numbers(factor * trace.measured),
        "residual": _numbers(factor * trace.residual),
        "before": None if trace.before is None else _numbers(factor * trace.before),
        "parts": {effect: _steps(factor * part) for effect, part in trace.parts.items()},
    }


def _steps(values: NDArray[np.float64]) -> dict[str, Any]:
    """Return values in steps of a 32767th of the largest: finer than any pixel, in half the bytes."""
    step = float(np.nanmax(np.abs(values), initial=0.0)) / 32767.0 or 1.0
    whole = np.where(np.isfinite(values), np.round(np.nan_to_num(values) / step), MISSING)
    return {"step": step, "values": _numbers(whole, "<i2")}


def _chart(trace: ResidualTrace) -> Any:
    """Return the chart as Bokeh's own JSON; the page's script fills in the samples."""
    from bokeh.embed import json_item  # noqa: PLC0415
    from bokeh.layouts import gridplot  # noqa: PLC0415
    from bokeh.models import BoxAnnotation, BoxZoomTool, ColumnDataSource, HoverTool, PanTool, ResetTool, WheelZoomTool  # noqa: PLC0415  # noqa: PLC0415
    from bokeh.plotting import figure  # noqa: PLC0415

    names = [name for name in LINES if name != "before" or trace.before is not None]
    source = ColumnDataSource({name: [0.0] for name in ("t", *names)}, name="samples")
    panels: list[Any] = []
    for group in (names[:2], names[2:]):
        zoom = BoxZoomTool()
        panel = figure(
            height=230,
            sizing_mode="stretch_width",
            tools=[zoom, PanTool(), WheelZoomTool(dimensions="width"), ResetTool()],
            active_drag=zoom,
            **({"x_range": panels[0].x_range} if panels else {}),
        )
        drawn = [
            panel.line(
                "t",
                name,
                source=source,
                color=LINES[name][0],
                line_dash=LINES[name][1],
                line_width=LINES[name][2],
                legend_label=_WORDS.get(name, name),
            )
            for name in group
        ]
        values = [(_WORDS.get(name, name), f"@{name}{{%.4g}}") for name in names]
        panel.add_tools(
            HoverTool(
                renderers=drawn[-1:],
                mode="vline",
                tooltips=[("time, s", "@t{%.3f}"), *values],
                formatters={f"@{name}": "printf" for name in ("t", *names)},
            )
        )
        panel.legend.click_policy = "hide"
        _look(panel)
        panels.append(panel)
    band = BoxAnnotation(fill_color=style.PALE, fill_alpha=1.0, level="underlay", name="floor", line_color=None)
    panels[1].add_layout(band)
    for panel, name in zip(panels, ("readings", "residuals"), strict=True):
        panel.yaxis.name = name
    panels[1].xaxis.axis_label = "time, s"
    panels[0].xaxis.visible = False
    grid = gridplot([[panel] for panel in panels], sizing_mode="stretch_width", merge_tools=True)
    grid.toolbar.logo = None
    return json_item(grid)


def _look(panel: Any) -> None:
    """Give a panel the colours and letters of the still figures."""
    panel.background_fill_color = panel.border_fill_color = None
    panel.outline_line_color = None
    panel.grid.grid_line_color = "#cccccc"
    panel.grid.grid_line_alpha = 0.5
    panel.yaxis.axis_label = "value"
    panel.axis.axis_label_text_color = panel.axis.major_label_text_color = style.INK
    panel.axis.axis_label_text_font_style = "normal"
    panel.axis.axis_line_color = panel.axis.major_tick_line_color = panel.axis.minor_tick_line_color = style.GREY
    panel.legend.background_fill_color = _PAPER
    panel.legend.border_line_color = None
    panel.legend.label_text_color = style.INK
    panel.legend.label_text_font_size = "12px"
    panel.legend.orientation = "horizontal"
    panel.legend.padding = panel.legend.margin = 2
    panel.add_layout(panel.legend[0], "above")
