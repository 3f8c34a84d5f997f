"""Figures of the studio, as Plotly takes them: residual against covariate, spectrum, the fall of the error.

Names of channels, columns and effects may come from files. `words` makes them text: Plotly reads part of HTML.
Colours of text and grid stand in the page's style sheet, which knows whether the page is light or dark.
"""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.figures import quantity
from imufit.figures.style import AXES, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from imufit.printable import NAME, printable
from imufit.results import Spectrum
from imufit.results.comparison import Panel
from imufit.studio.names import channel_name, covariate_name

if TYPE_CHECKING:
    from imufit.figures.allan import ChannelLike

HOVER: Final = "%{fullData.name}<br>%{xaxis.title.text}: %{x:.5g}<br>%{yaxis.title.text}: %{y:.4g}<extra></extra>"
"""Name of the trace, and place of a point with quantities and units, as the axes name them."""
LABEL: Final[dict[str, Any]] = {"bgcolor": "#333333", "font": {"color": "#ffffff"}, "align": "left"}
"""Look of the label at a point: white on dark grey, contrast 12.6, whatever the colour of the trace."""

SYMBOL: Final = '<span style="font-size: 85%">({})</span>'
"""Symbol behind the words of a quantity in a title, a little smaller than these."""

Figure = dict[str, Any]
Array = NDArray[np.float64]

HEIGHT: Final = 240
"""Height of a figure, px: two of them and the sentence fit on a laptop's screen."""
NEXT: Final = "next"
"""Mark under the bar of the effect that is missing."""
NOW: Final = "now"
"""Mark over the bar of the present step."""
FALL_HEIGHT: Final = 200
"""Height of the fall of the error, px: numbers under the bars and a legend of three lines leave half of it to them."""
SMALL: Final = 11
"""Size of the letters of an axis' title and of the figure of the falling error, px: the titles fit beside the plots."""
SLOTS: Final = 6
"""Bars that have room in the fall of the error at least: as many steps as most logs take."""
WRITTEN_OUT: Final = 1e5
"""Number of an axis from which on its power stands in its place."""
TWO_STEPS: Final = math.log10(5.0)
"""Decades that hold two of the numbers 1, 2, 5, 10 at least: from 2 to 5 and from 5 to 10 is the longest way."""
EVEN_STEPS: Final = 5
"""Numbers of a logarithmic axis in even steps at most: those at its upper end stand closest, and must not touch."""
DECADES: Final = 6
"""Numbers that the logarithmic axis of the fall has room for."""
ROOM: Final = 1.6
"""Length of the fall's axis over that of its highest bar: mark and number of the present bar have 30 px of 80 px on a
phone, whether the axis is logarithmic or not."""
UNDONE: Final = 0.35
"""Opacity of the bar of a step that was undone: far paler than the others, and still seen."""
UNDER: Final = 22
"""Room under the bars for their numbers, px: the axis has no title."""
LINE: Final = 1.6
"""Width of a line, px."""
LOGARITHMIC_ABOVE: Final = 8.0
"""Fall of the error, as a ratio, from which on the axis is logarithmic: smaller steps can be seen then as well."""


def words(text: str) -> str:
    """Return text from a file as text for a figure: no markup, no marks of direction, no formula.

    Parameters
    ----------
    text : str
        For instance the name of a column.
    """
    return html.escape(printable(text, NAME), quote=False).replace("$", "&#36;")


def _figure(traces: list[dict[str, Any]], x: str, y: str, **more: Any) -> Figure:
    """Lay out traces with a title on each axis."""
    axis = {"zeroline": False, "automargin": True, "fixedrange": False, "exponentformat": "power"}
    layout = {
        "height": HEIGHT,
        "margin": {"l": 56, "r": 12, "t": 8, "b": 44},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "xaxis": {**axis, "title": {"text": x, "standoff": 6, "font": {"size": SMALL}}, **more.pop("xaxis", {})},
        "yaxis": {**axis, "title": {"text": y, "standoff": 6, "font": {"size": SMALL}}, **more.pop("yaxis", {})},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "hoverlabel": LABEL,
        "showlegend": True,
        **more,
    }
    # The page says how to zoom: Plotly's own hint would lie over what stands beside the figure.
    return {"data": traces, "layout": layout, "config": {"displaylogo": False, "responsive": True, "showTips": False}}


def empty(sentence: str, height: int = HEIGHT) -> Figure:
    """Return a figure that states why there is nothing to draw.

    Parameters
    ----------
    sentence : str
        The reason.
    height : int
        Height, px.
    """
    note = {"text": words(sentence), "showarrow": False, "x": 0.5, "y": 0.5, "xref": "paper", "yref": "paper"}
    hidden = {"visible": False}
    return _figure([], "", "", annotations=[note], xaxis=hidden, yaxis=hidden, showlegend=False, height=height)


def residual_panel(
    panel: Panel,
    after: Panel | None = None,
    other: Panel | None = None,
    *,
    effect: str = "",
    explained: bool = False,
) -> Figure:
    """Draw the residual of one channel against one covariate.

    Parameters
    ----------
    panel : Panel
        With the present model.
    after : Panel, optional
        With one effect more: the one that is looked at.
    other : Panel, optional
        With the second of two models.
    effect : str
        The effect that is looked at, in words.
    explained : bool
        Whether the panel stands against the part of the residual that the covariate explains.
    """
    channel = words(channel_name(panel.channel))
    cause = words(covariate_name(panel.covariate))
    symbol = words(panel.covariate)
    name = cause if cause == symbol else f"{cause} {SYMBOL.format(symbol)}"
    name = f"part of {channel} that {cause} explains" if explained else name
    x_factor, x_title = quantity.axis(name, panel.covariate_unit)
    factor, unit = quantity.shown_unit(panel.channel_unit)
    x, mean = x_factor * panel.centre, factor * panel.mean
    band = factor * np.nan_to_num(panel.band)
    floor = factor * panel.noise_floor
    known = np.isfinite(mean)
    reach = float(np.max(np.abs(mean[known]) + band[known])) if known.any() else 0.0
    limit = 1.15 * max(reach, min(floor, 3.0 * reach)) or 1.0
    traces = [
        _area(x[[0, -1]], np.array([-floor, -floor]), np.array([floor, floor]), GREY, 0.18, "noise"),
        _area(x[known], (mean - band)[known], (mean + band)[known], SKY, 0.4, "95 % band"),
        _line(x, mean, BLUE, "now", mode="lines+markers"),
    ]
    if explained:
        traces.append(_line(x[[0, -1]], x[[0, -1]], GREY, "if it explained all", dash="dot"))
    if other is not None:
        traces.append(_line(x_factor * other.centre, factor * other.mean, GREEN, "kept model", dash="dashdot"))
    if after is not None:
        traces.append(_line(x_factor * after.centre, factor * after.mean, ORANGE, f"with {words(effect)}", dash="dash"))
    y_title = f"residual of {channel}, {unit}"
    return _figure([trace for part in traces for trace in part], x_title, y_title, yaxis={"range": [-limit, limit]})


def _line(
    x: Array, y: Array, colour: str, name: str, *, mode: str = "lines", dash: str = "solid", width: float = LINE
) -> list[Figure]:
    line = {"color": colour, "width": width, "dash": dash}
    points = {"x": _numbers(x), "y": _numbers(y), "mode": mode, "name": name}
    shown = {"hovertemplate": HOVER}
    return [{"type": "scatter", **points, **shown, "line": line, "marker": {"color": colour, "size": 5}}]


def _area(x: Array, low: Array, high: Array, colour: str, opacity: float, name: str) -> list[Figure]:
    """Fill between two lines: one closed outline, so that the legend has one entry."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    outline = {"x": _numbers(np.concatenate([x, x[::-1]])), "y": _numbers(np.concatenate([high, low[::-1]]))}
    fill = {"fill": "toself", "fillcolor": f"rgba({red},{green},{blue},{opacity})", "line": {"width": 0}}
    return [{"type": "scatter", "mode": "lines", **outline, **fill, "name": name, "hoverinfo": "skip"}]


def _entry(name: str, mark: Figure) -> Figure:
    """Return an entry of the legend for something without a trace of its own."""
    return {"type": "scatter", "mode": "markers", "name": name, "x": [None], "y": [None], "marker": mark}


def _numbers(values: Array) -> list[float | None]:
    """Return numbers for JSON; None interrupts a line."""
    return [float(value) if math.isfinite(value) else None for value in values]


def spectrum(found: Spectrum, other: Spectrum | None = None) -> Figure:
    """Draw the density of one channel's residual over its noise floor.

    Parameters
    ----------
    found : Spectrum
        With the present model.
    other : Spectrum, optional
        With the second of two models.
    """
    base = found.unit.removeprefix("(").partition(")^2/Hz")[0]
    factor, unit = quantity.shown_unit(base)
    # The amplitude density has the unit in which sensors are specified.
    lines = _line(found.frequency, factor * np.sqrt(found.density), BLUE, "residual now")
    if other is not None:
        lines += _line(other.frequency, factor * np.sqrt(other.density), GREEN, "kept model", dash="dashdot")
    ends = found.frequency[[0, -1]]
    lines += _line(ends, np.full(2, factor * math.sqrt(found.floor)), GREY, "noise floor", dash="dash")
    # Decades alone carry numbers: the others would lie upon one another on a phone.
    ticks = {"type": "log", "dtick": 1, "tickformat": "~g"}
    title = f"residual of {words(channel_name(found.channel))}, {unit}/√Hz"
    return _figure(lines, "frequency, Hz, of the residual less its mean", title, xaxis=ticks, yaxis=_logarithmic(lines))


def _logarithmic(lines: Sequence[Figure]) -> Figure:
    """Return a logarithmic axis whose numbers are written out and do not touch: at 1, 2 and 5, or at decades."""
    seen = [value for line in lines for value in line["y"] if value is not None and value > 0.0]
    decades = math.log10(max(seen) / min(seen)) if seen else 0.0
    if decades >= DECADES / 2:
        # Plotly writes out what is short, and the power of the others.
        return {"type": "log", "dtick": math.ceil(decades / DECADES)}
    # In a window shorter than two of the steps 1, 2, 5, Plotly's even steps name more than one number.
    return {"type": "log", "tickformat": "~g", **({"nticks": EVEN_STEPS} if decades < TWO_STEPS else {"dtick": "D2"})}


def allan(sensor: str, channels: Sequence[ChannelLike]) -> Figure:
    """Draw the Allan deviation of one sensor's channels with their confidence bands and fits.

    Parameters
    ----------
    sensor : str
        Its name.
    channels : sequence of ChannelLike
        One per curve.
    """
    drawn: list[Figure] = []
    shown = ""
    for channel in channels:
        axis = channel.name.rpartition("_")[2]
        factor, shown = quantity.shown_unit(channel.unit)
        colour = AXES.get(axis, GREY)
        band = _area(channel.tau, factor * channel.low, factor * channel.high, colour, 0.15, f"68 % band of {axis}")
        drawn += [trace | {"showlegend": False} for trace in band]
        drawn += _line(channel.tau, factor * channel.deviation, colour, axis)
        fitted = channel.fitted(channel.tau)
        if fitted is not None:
            fit = _line(channel.tau, factor * fitted, GREY, f"noise of four kinds, {axis}", dash="dot")
            drawn += [trace | {"showlegend": False} for trace in fit]
    return _figure(
        drawn,
        "averaging time, s",
        f"Allan deviation, {shown}",
        xaxis={"type": "log", "dtick": "D2", "tickformat": "~g"},
        yaxis=_logarithmic(drawn),
        title={"text": words(sensor), "x": 0.0, "xanchor": "left", "y": 0.98, "font": {"size": 13}},
        margin={"l": 56, "r": 12, "t": 26, "b": 44},
        legend={"orientation": "h", "x": 1.0, "xanchor": "right", "y": 1.0, "yanchor": "bottom"},
    )


def fall(
    labels: Sequence[str],
    ratios: Sequence[float],
    expected: Sequence[float | None],
    position: int,
    *,
    best: tuple[str, float] | None = None,
) -> Figure:
    """Draw the held-out error of every step over the noise floor.

    Parameters
    ----------
    labels : sequence of str
        (k,) steps, for the one who points at a bar: their numbers alone stand under the bars.
    ratios : sequence of float
        (k,) held-out error over the noise floor after each step; NaN where it is not known yet.
    expected : sequence of float or None
        (k,) error that was predicted before the step.
    position : int
        Number of the present step; later ones were undone.
    best : (str, float), optional
        The step that adds the effect that is missing, and the error that is expected with it.
    """
    places = list(range(len(ratios)))
    names = [words(label) for label in labels]
    texts = [quantity.ratio(value) if math.isfinite(value) else "…" for value in ratios]
    texts[position] = f"{NOW}<br>{texts[position]}"
    colours = [VERMILION if k == 0 else BLUE for k in places]
    bars: list[Figure] = [
        {
            "type": "bar",
            "name": "held-out error",
            "x": places,
            "y": _numbers(np.array(ratios, dtype=float)),
            "width": 0.62,
            "marker": {"color": colours, "opacity": [1.0 if k <= position else UNDONE for k in places]},
            "hovertemplate": "%{customdata}<br>%{y:.3f} times the noise floor<extra></extra>",
            "customdata": [*names],
            "showlegend": False,
        }
    ]
    if position < len(ratios) - 1:
        # The bars are one trace: their paleness has an entry of the legend of its own.
        mark = {"symbol": "square", "size": 11, "color": BLUE, "opacity": UNDONE}
        bars.append(_entry("undone", mark))
    known = [(k, value) for k, value in enumerate(expected) if value is not None]
    if best is not None:
        # One mark for what is expected, of a step that was made and of the next one.
        places.append(len(ratios))
        known.append((len(ratios), best[1]))
        names.append(words(best[0]))
        texts.append(quantity.ratio(best[1]))
    if known:
        bars.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "expected",
                "x": [k for k, _ in known],
                "y": [value for _, value in known],
                "marker": {"symbol": "diamond-open", "size": 11, "color": ORANGE, "line": {"width": 2}},
                "cliponaxis": False,
                "hovertemplate": "%{customdata}<br>%{y:.3f} expected<extra></extra>",
                "customdata": [names[k] for k, _ in known],
            }
        )
    marks = dict(known)
    heights = [*ratios, *([] if best is None else [best[1]])]
    tops = [max(value, marks.get(k, 0.0)) if math.isfinite(value) else 0.0 for k, value in enumerate(heights)]
    # The number stands over the bar and over its diamond.
    above = {"x": places, "y": tops, "text": texts, "textposition": "top center", "showlegend": False}
    unseen = {"size": 13, "opacity": 0.0}
    above["cliponaxis"] = False
    bars.append({"type": "scatter", "mode": "markers+text", **above, "marker": unseen, "hoverinfo": "skip"})
    drawn = [value for value in [*ratios, *marks.values()] if math.isfinite(value) and value > 0.0]
    top, low = max([*drawn, 1.0]), min([*drawn, 1.0])
    logarithmic = top / low > LOGARITHMIC_ABOVE
    scale: dict[str, Any] = {"range": [0.0, ROOM * top]}
    if logarithmic:
        # The bars stand on the noise floor: one that reaches it has no height left.
        begin, end = math.log10(low), math.log10(top)
        ticks_at = _decades(low, top)
        shown = [f"{value:g}" if value < WRITTEN_OUT else f"10<sup>{math.log10(value):.0f}</sup>" for value in ticks_at]
        scale = {"type": "log", "range": [begin, begin + ROOM * (end - begin)]}
        scale |= {"tickvals": ticks_at, "ticktext": shown}
    # A bar is never wider than a sixth of the figure, so that the next ones do not change its look.
    edge = [-0.6, max(len(places), SLOTS) - 0.4]
    floor = _line(np.array(edge), np.ones(2), GREY, "noise floor", dash="dash")
    under = [str(k) if k < len(ratios) else NEXT for k in places]
    ticks = {"tickvals": places, "ticktext": under, "range": edge}
    ticks |= {"fixedrange": True, "tickangle": 0, "tickfont": {"size": SMALL}}
    figure = _figure([*bars, *floor], "", "error / noise floor", xaxis=ticks, yaxis={**scale, "fixedrange": True})
    # Numbers stand over the bars: lines of a grid would cross them.
    figure["layout"]["xaxis"]["showgrid"] = figure["layout"]["yaxis"]["showgrid"] = False
    figure["layout"]["bargap"] = 0.3
    figure["layout"]["height"] = FALL_HEIGHT
    figure["layout"]["margin"]["b"] = UNDER
    figure["layout"]["legend"]["font"] = {"size": SMALL}
    return figure


def _decades(low: float, top: float) -> list[float]:
    """Return 1 and 10 and so on, with 3 between them where there is room, over the range of a logarithmic axis."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(top))
    if last - first <= DECADES // 2:
        return [value for power in range(first, last + 1) for value in (10.0**power, 3.0 * 10.0**power)]
    return [10.0**power for power in range(first, last + 1, -(-(last - first) // DECADES))]


LOOKS: Final = {axis: (colour, "solid", LINE) for axis, colour in AXES.items()} | {
    "kept model": (GREEN, "dashdot", LINE),
    "now": (BLUE, "solid", LINE),
    "measured": (GREY, "solid", 2.0 * LINE),
    "predicted": (BLUE, "dot", 0.6 * LINE),
}
"""Looks of the lines of a trace by name, the others grey: dashes let the line beneath be seen where two agree, and a
prediction is a third as wide as the reading beneath."""


LEFT: Final = 72
"""Margin for the name of the value's axis and for seven characters beside each tick, px."""


REST: Final = "rgba(0, 158, 115, 0.14)"
"""Fill of a time at rest, the green of the figures, so pale that lines stay readable on either background."""
MOST_RESTS: Final = 200
"""Times at rest that are drawn at most: as many have six pixels each on a wide screen."""


def rests(spans: Iterable[tuple[float, float]], begin: float, end: float) -> list[Figure]:
    """Return the shapes of times at rest behind the lines of a window; none where more would fall into it than fit.

    Parameters
    ----------
    spans : iterable of (float, float)
        Begin and end of each rest, s.
    begin, end : float
        The window, s.
    """
    seen = [(max(a, begin), min(b, end)) for a, b in spans if b > begin and a < end]
    across = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1}
    look = {"fillcolor": REST, "line": {"width": 0}, "layer": "below"}
    return [{**across, "x0": a, "x1": b, **look} for a, b in seen] if len(seen) <= MOST_RESTS else []


def trace(
    channel: str,
    unit: str,
    lines: Sequence[tuple[str, Array, Array]],
    window: tuple[float, float],
    *,
    title: str = "residual",
    at_rest: Iterable[tuple[float, float]] = (),
) -> Figure:
    """Draw quantities of one channel over time.

    Parameters
    ----------
    channel, unit : str
        Channel, or sensor, and its SI unit.
    lines : sequence of (str, ndarray, ndarray)
        Name, times in s, and values in `unit` of each line.
    window : (float, float)
        Begin and end of what is drawn, s.
    title : str
        The quantity.
    at_rest : iterable of (float, float), optional
        Begin and end of each time at rest, s.
    """
    factor, shown = quantity.shown_unit(unit)
    drawn: list[Figure] = []
    for name, t, values in lines:
        colour, dash, width = LOOKS.get(name, (GREY, "solid", LINE))
        drawn += _line(t, factor * values, colour, name, dash=dash, width=width)
    shapes = rests(at_rest, *window)
    if shapes:
        mark = {"symbol": "square", "size": 11, "color": REST}
        drawn.append(_entry("at rest", mark))
    figure = _figure(drawn, "time, s", f"{title} of {words(channel_name(channel))}, {shown}")
    # Margins that follow the labels may call for other labels, and these for other margins, without an end.
    for name in ("xaxis", "yaxis"):
        figure["layout"][name] |= {"automargin": False, "tickangle": 0}
    figure["layout"]["margin"]["l"] = LEFT
    figure["layout"]["shapes"] = shapes
    figure["layout"]["xaxis"]["range"] = list(window)
    return figure
