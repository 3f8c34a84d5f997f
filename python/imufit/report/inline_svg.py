"""Figures as SVG elements inside a page: text stays text, and colours follow the page's light or dark palette."""

from __future__ import annotations

import io
import re
from html import escape
from typing import Final

from markupsafe import Markup
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from imufit.figures import style

_ID = re.compile(r'(\bid="|href="#|url\(#)')
_OPENING = re.compile(r"<svg\b[^>]*>")
_STYLE = re.compile(r'style="[^"]*"')
_COLOUR = re.compile(r"#[0-9a-f]{6}")
_FONT = re.compile(r" font-family: [^;\"]*;?")
_GLOBAL = re.compile(r"<style\b.*?</style>", re.DOTALL)
_DIGITS = re.compile(r' (?:d|x|y|width|height|transform)="[^"]*"')
_LONG = re.compile(r"(\.\d)\d+")
_NEXT = re.compile(r"\s*\nL ")
_BLANK = re.compile(r"\s*\n\s*")

PALETTE: Final = {
    style.BLUE: "blue",
    style.SKY: "sky",
    style.ORANGE: "orange",
    style.VERMILION: "vermilion",
    style.GREEN: "green",
    style.GREY: "grey",
    style.PALE: "pale",
    style.INK: "ink",
    "#000000": "ink",
    "#555555": "soft",
    "#cccccc": "line",
    "#b0b0b0": "line",
    "#ffffff": "paper",
}
"""Colours of the figures and the variables of the page's style sheet that stand for them."""
_VARIABLES: Final = {colour.lower(): f"var(--{name})" for colour, name in PALETTE.items()}


def untitled(figure: style.PlainFigure) -> tuple[str, Bbox]:
    """Take the title out of a figure: words of a page wrap where those of a picture do not.

    Parameters
    ----------
    figure : PlainFigure
        The figure; the titles of several panels stay.

    Returns
    -------
    str
        The title.
    Bbox
        The part of the figure below it, inches: all of a figure that is not laid out.
    """
    shown = [axes for axes in figure.axes if axes.get_visible()]
    title = figure.get_suptitle()
    if len(shown) == 1:
        title = title or shown[0].get_title(loc="left") or shown[0].get_title()
    width, height = figure.get_size_inches()
    holders = (figure, *shown) if len(shown) == 1 else (figure,)
    for text in (child for holder in holders for child in holder.get_children() if isinstance(child, Text)):
        if title and text.get_text() == title:
            if figure.is_laid_out:
                height = min(height, text.get_window_extent().y0 / figure.dpi)
            text.set_text("")
    return " ".join(title.split()), Bbox.from_bounds(0.0, 0.0, width, height)


def inline_svg(figure: style.PlainFigure, name: str, description: str, part: Bbox) -> Markup:
    """Figure as one ``<svg>`` element that scales with the page.

    Parameters
    ----------
    figure : PlainFigure
        The figure, complete.
    name : str
        Prefix of all ids, unique in the page.
    description : str
        Contents of the figure, for readers who cannot see it.
    part : Bbox
        The part of the figure that is shown, inches.

    Returns
    -------
    Markup
        SVG without XML header, metadata or outside reference.
    """
    import matplotlib as mpl  # noqa: PLC0415

    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.lay_out()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata=nothing, bbox_inches=part)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = _GLOBAL.sub("", text, count=1)
    text = _ID.sub(rf"\g<1>{name}-", text)
    text = _STYLE.sub(_themed, text)
    # A digit behind the point is a tenth of a point, and lines go on to the next point by themselves.
    text = _DIGITS.sub(lambda found: _NEXT.sub(" ", _LONG.sub(r"\1", found.group())), text)
    text = _BLANK.sub("\n", text)
    box = re.search(r'viewBox="([^"]+)"', text)
    numbers = box.group(1) if box else "0 0 750 400"
    width = float(numbers.split()[2]) * 96.0 / 72.0
    opening = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" role="img" '
        f'aria-label="{escape(description, quote=True)}" viewBox="{numbers}" '
        f'style="width:100%;max-width:{width:.0f}px;height:auto">'
    )
    return Markup(_OPENING.sub(lambda _: opening, text, count=1))


def themed(colour: str) -> str:
    """Return the page's variable that stands for a colour, or the colour itself.

    Parameters
    ----------
    colour : str
        Such as ``#0072b2``.
    """
    return _VARIABLES.get(colour, colour)


def _themed(found: re.Match[str]) -> str:
    """Replace the colours of one style by the page's variables, and the font by the page's own."""
    style_text = _COLOUR.sub(lambda colour: themed(colour.group()), found.group())
    return _FONT.sub("", style_text)
