"""Colours that colour-blind readers distinguish (Okabe and Ito), and the look that all figures share."""

from __future__ import annotations

import logging
from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.category import StrCategoryFormatter
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter, LogLocator

from imufit.wrapping import lines_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.backend_bases import RendererBase

# Fonts that figures do not use do not concern the reader.
logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)

BLUE = "#0072B2"
SKY = "#56B4E9"
ORANGE = "#E69F00"
VERMILION = "#D55E00"
GREEN = "#009E73"
GREY = "#8C8C8C"
PALE = "#E6E6E6"
INK = "#222222"

LETTER: Final = 0.55
"""Mean width of a letter of matplotlib's font over its size, measured over the titles of all figures."""
FINE: Final = 1e4
"""Span of a logarithmic axis, highest over lowest value, up to which three ticks to a decade find room: they are 12
then, and the smallest figure, 2.4 inches high, has room for 13 lines of 8 points."""
PALETTE: Final = 256
"""Colours of a picture in a notebook: as many as one byte encodes, at a third of the bytes of all colours."""

AXES = {"x": BLUE, "y": VERMILION, "z": GREEN}
LINES = {"x": "-", "y": "--", "z": "-."}


class PlainFigure(Figure):
    """Figure in which text is text: a dollar in the name of a column begins no formula.

    Only the numbers along an axis, which matplotlib itself writes as powers of ten, stay formulas.
    """

    is_laid_out = False
    """Whether the layout is found and kept."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw it.

        Parameters
        ----------
        renderer : RendererBase
            Where to.
        """
        if not self.is_laid_out:
            self._keep_text()
        super().draw(renderer)

    def lay_out(self) -> None:
        """Find the layout of a complete figure and keep it.

        Finding it takes longer than drawing, and each saving would find it anew.
        """
        if self.is_laid_out:
            return
        self._keep_text()
        self.is_laid_out = True
        engine = self.get_layout_engine()
        if engine is not None:
            engine.execute(self)
            self.set_layout_engine(None)

    def _keep_text(self) -> None:
        numbers = set[Text]()
        for axes in self.axes:
            for axis in (axes.xaxis, axes.yaxis):
                for formatter, ticks in (
                    (axis.get_major_formatter(), axis.get_major_ticks()),
                    (axis.get_minor_formatter(), axis.get_minor_ticks()),
                ):
                    if not isinstance(formatter, FixedFormatter | FuncFormatter | StrCategoryFormatter):
                        numbers.update(label for tick in ticks for label in (tick.label1, tick.label2))
        for text in self.findobj(Text):
            if text not in numbers:
                text.set_parse_math(False)

    def _repr_png_(self) -> bytes:
        """Show the figure in a notebook, where only figures of pyplot show themselves."""
        from PIL import Image  # noqa: PLC0415  comes with matplotlib, and is only needed here
        from scipy.spatial import cKDTree  # noqa: PLC0415

        held, small = BytesIO(), BytesIO()
        self.savefig(held, format="png")
        drawn = np.asarray(Image.open(held).convert("RGB"))
        colours, place, count = np.unique(drawn.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True)
        # The most frequent colours stay as they are: means of colours would tint white and thin lines.
        kept = np.argsort(-count, kind="stable")[:PALETTE]
        nearest = np.asarray(cKDTree(colours[kept]).query(colours)[1])
        picture = Image.fromarray(nearest[place.ravel()].reshape(drawn.shape[:2]).astype(np.uint8))
        picture.putpalette(colours[kept].ravel().tolist())
        picture.save(small, "png", optimize=True)
        return small.getvalue()

    def _repr_mimebundle_(self, **_: object) -> dict[str, bytes]:
        """Show the same picture where pyplot would draw every Figure in its own, larger way."""
        return {"image/png": self._repr_png_()}


def new_figure(width: float, height: float) -> PlainFigure:
    """Empty figure on white whose parts never overlap.

    Parameters
    ----------
    width, height : float
        Inches; 10 inches are 1000 px at 100 dots per inch.

    Returns
    -------
    PlainFigure
        Not registered with pyplot: nothing keeps it alive but its user.
    """
    figure = PlainFigure(figsize=(width, height), dpi=100, layout="constrained")
    figure.patch.set_facecolor("white")
    return figure


def new_grid(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Axes of one size on a figure of their own, with room for their labels and for a title of the figure.

    A fixed layout: finding one for many axes takes longer than drawing them.

    Parameters
    ----------
    rows, columns : int
        How many axes beneath and beside each other.
    width, height : float
        Of each with its labels, inches.

    Returns
    -------
    PlainFigure
        Not registered with pyplot.
    list of Axes
        Row by row.
    """
    left, right, top, bottom, head = 0.74, 0.12, 0.3, 0.48, 0.5
    whole, tall = width * columns, height * rows + head
    figure = PlainFigure(figsize=(whole, tall), dpi=100)
    figure.patch.set_facecolor("white")
    inner, high = width - left - right, height - top - bottom
    figure.subplots_adjust(
        left=left / whole,
        right=1.0 - right / whole,
        top=1.0 - (head + top) / tall,
        bottom=bottom / tall,
        wspace=(left + right) / inner,
        hspace=(top + bottom) / high,
    )
    return figure, list(figure.subplots(rows, columns, squeeze=False).flat)


def tidy(axes: Axes) -> None:
    """Take away what carries no information: the box's upper and right edge."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.tick_params(colors=INK, labelsize=9)


def decades(axis: Axis) -> None:
    """Put ticks on a logarithmic axis at 1, 2 and 5 of each decade, or at each decade where these would touch."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < FINE * low else (1.0,)))


def title(axes: Axes, sentence: str, size: float = 11.0, **options: Any) -> None:
    """Put a sentence above the axes, flush left.

    On a figure of the user it is broken to the width of the axes, and ``axes.set_title`` replaces it.

    Parameters
    ----------
    axes : Axes
        Below the sentence.
    sentence : str
        The words.
    size : float
        Of the letters, points.
    **options
        Of ``set_title``, where the figure is of this package.
    """
    if isinstance(axes.get_figure(root=True), PlainFigure):
        axes.set_title(sentence, loc="left", fontsize=size, color=INK, **options)
        return
    figure = axes.get_figure(root=True)
    assert figure is not None
    width = 72.0 * axes.get_window_extent().width / figure.dpi
    broken = "\n".join(lines_of(sentence, max(20, int(width / (LETTER * size)))))
    axes.set_title(broken, fontsize=min(size, 10.0), color=INK)
