"""Figures as SVG elements that stand inside a page."""

from __future__ import annotations

import io
import re
from html import escape
from typing import TYPE_CHECKING

from markupsafe import Markup

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ID = re.compile(r'(\bid="|href="#|url\(#)')
_SIZE = re.compile(r'<svg[^>]*?\swidth="[^"]*pt"[^>]*>')


def inline_svg(figure: Figure, name: str, description: str) -> Markup:
    """Figure as one ``<svg>`` element that scales with the page.

    Parameters
    ----------
    figure : Figure
        Any matplotlib figure.
    name : str
        Prefix of all ids, unique in the page.
    description : str
        What the figure shows, for readers who cannot see it.

    Returns
    -------
    Markup
        SVG without XML header, metadata or outside reference.
    """
    import matplotlib as mpl  # noqa: PLC0415

    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = _ID.sub(rf"\g<1>{name}-", text)
    box = re.search(r'viewBox="([^"]+)"', text)
    width = float(box.group(1).split()[2]) * 96.0 / 72.0 if box else 1000.0
    opening = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" role="img" '
        f'aria-label="{escape(description, quote=True)}" viewBox="{box.group(1) if box else ""}" '
        f'style="width:100%;max-width:{width:.0f}px;height:auto">'
    )
    return Markup(_SIZE.sub(lambda _: opening, text, count=1))
