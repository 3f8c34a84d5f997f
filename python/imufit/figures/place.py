"""Where a figure is drawn: on a figure of its own, or on given Axes.

The rule of ``ax`` for every ``plot`` of this package:

- nothing: a new figure, which shows itself in a notebook; ``plot`` returns this figure;
- an Axes: a figure of one panel is drawn on this Axes. A figure of several panels is drawn in its place;
- Axes side by side (a list, or the array of ``plt.subplots``): one for each panel, in the order of the panels;
- a Figure or a SubFigure: the panels are laid out on it.

With ``ax`` given, ``plot`` returns the Axes that it drew on: one for one panel, else a list. A notebook then shows only
the figure of the user, once. A figure without a layout gets matplotlib's constrained one, so that no words overlap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from imufit.errors import InputError
from imufit.figures import style

if TYPE_CHECKING:
    from numpy.typing import NDArray

Place: TypeAlias = "Axes | Sequence[Axes] | NDArray[Any] | Figure | SubFigure"
"""Where to draw, see the module."""

NARROW: Final = 5.0
"""Width under which a figure is narrow, inches at 96 pixels: a phone has 3.75 of them, a column of a page 6."""


@dataclass(frozen=True)
class Drawing:
    """Panels that are drawn on.

    Attributes
    ----------
    axes : list of Axes
        One for each panel, in the order of the panels.
    whole : Figure, SubFigure or None
        What holds these panels and nothing else; None where they are Axes of the user.
    own : bool
        Whether the figure was made here.
    """

    axes: list[Axes]
    whole: Figure | SubFigure | None
    own: bool

    @property
    def root(self) -> Figure:
        """The whole figure with everything else on it."""
        figure = self.axes[0].get_figure(root=True)
        assert isinstance(figure, Figure)
        return figure

    @property
    def result(self) -> Figure | Axes | list[Axes]:
        """The value of ``plot``: its own figure, else the Axes."""
        if self.own:
            return self.root
        return self.axes[0] if len(self.axes) == 1 else self.axes

    @property
    def narrow(self) -> bool:
        """Whether the figure is made for a phone, so that legends stand in one column and words beside panels go."""
        return self.whole is not None and self.root.get_figwidth() < NARROW

    def headline(self, sentence: str, size: float = 11.0) -> None:
        """Put a sentence above all panels; Axes of the user's own have no place for one.

        Parameters
        ----------
        sentence : str
            What the figure shows.
        size : float
            Of the letters, points.
        """
        if self.whole is not None:
            self.whole.suptitle(sentence, x=0.01, ha="left", fontsize=size, color=style.INK)

    def legend(self, *named: Any, loc: Any, ncols: int) -> Any:
        """Put a legend beside the panels, or into the first of the user's own Axes.

        Parameters
        ----------
        *named
            Handles and labels; without them those of the panels.
        loc : str
            Where beside the panels, such as ``outside lower center``.
        ncols : int
            Columns of the legend.

        Returns
        -------
        Legend
        """
        given: dict[str, Any] = dict(zip(("handles", "labels"), named, strict=False))
        if self.whole is not None:
            return self.whole.legend(**given, loc=loc, ncols=ncols, frameon=False, fontsize=9)
        return self.axes[0].legend(**given, loc="best", framealpha=0.85, edgecolor="none", fontsize=8)


def panels(
    ax: Place | None,
    size: tuple[float, float],
    mosaic: Sequence[Sequence[int]] = ((0,),),
    *,
    sharex: bool = False,
    sharey: bool = False,
    grid: Callable[[], tuple[Figure, list[Axes]]] | None = None,
) -> Drawing:
    """Make or take the Axes that a figure draws on.

    Parameters
    ----------
    ax : Axes, sequence of Axes, Figure, SubFigure or None
        Where to draw, see the module.
    size : (float, float)
        Width and height of a figure of its own, inches.
    mosaic : sequence of sequences of int
        Number of the panel at each place of a grid, row by row; a panel over several places stands there several times.
    sharex, sharey : bool
        Whether all panels have one axis.
    grid : callable, optional
        Makes a figure of its own with its Axes in another way.

    Raises
    ------
    InputError
        `ax` is nothing to draw on, or has another number of Axes.
    """
    count = 1 + max(max(row) for row in mosaic)
    if ax is None:
        if grid is not None:
            figure, made = grid()
            return Drawing(made[:count], figure, own=True)
        figure = style.new_figure(*size)
        return Drawing(_laid_out(figure, mosaic, sharex, sharey), figure, own=True)
    if isinstance(ax, Figure | SubFigure):
        return Drawing(_laid_out(_with_layout(ax), mosaic, sharex, sharey), ax, own=False)
    given = list(np.ravel(np.asarray(ax, dtype=object)))
    if not given or not all(isinstance(each, Axes) for each in given):
        raise InputError(
            "ax is not a matplotlib Axes, Figure or SubFigure, and no sequence of Axes",
            remedy="Give ax=plt.gca(), or leave ax away for a new figure.",
        )
    if isinstance(ax, Axes) and count > 1:
        within = _within(ax, count)
        return Drawing(_laid_out(within, mosaic, sharex, sharey), within, own=False)
    if len(given) != count:
        raise InputError(
            f"this figure has {_counted(count)}, and ax has {len(given)} Axes",
            remedy=f"Give {count} Axes, or a Figure or SubFigure to draw all panels on.",
        )
    for each in given:
        _with_layout(each.get_figure(root=False))
    return Drawing(given, None, own=False)


def empty(sentence: str, ax: Place | None) -> Drawing:
    """Say in words why there is nothing to draw.

    Parameters
    ----------
    sentence : str
        The words.
    ax : Axes, sequence of Axes, Figure, SubFigure or None
        Where to draw; of several Axes on the first.
    """
    first = ax if ax is None or isinstance(ax, Axes | Figure | SubFigure) else np.ravel(np.asarray(ax, object))[:1]
    drawing = panels(first, (8.0, 1.2))
    drawing.axes[0].set_axis_off()
    drawing.axes[0].text(
        0.5, 0.5, sentence, transform=drawing.axes[0].transAxes, ha="center", va="center", fontsize=11, color=style.INK
    )
    return drawing


def rows_of(count: int, columns: int) -> list[list[int]]:
    """Return the mosaic of a number of panels in rows of a length; the last row is filled up with its last panel.

    Parameters
    ----------
    count, columns : int
        Panels in all, and in a row.
    """
    return [[min(row + column, count - 1) for column in range(columns)] for row in range(0, count, columns)]


def _laid_out(figure: Figure | SubFigure, mosaic: Sequence[Sequence[int]], sharex: bool, sharey: bool) -> list[Axes]:
    made = figure.subplot_mosaic([list(row) for row in mosaic], sharex=sharex, sharey=sharey)
    return [made[place] for place in sorted(made)]


def _with_layout(figure: Figure | SubFigure | None) -> Figure | SubFigure:
    """Return the figure with a layout in which parts never overlap, where its user has chosen none."""
    assert figure is not None, "an Axes that was removed from its figure"
    root = figure.get_figure(root=True)
    if isinstance(root, Figure) and root.get_layout_engine() is None:
        root.set_layout_engine("constrained")
    return figure


def _within(ax: Axes, count: int) -> SubFigure:
    """Return a figure in the place of an Axes, which stays there without its frame."""
    spec = ax.get_subplotspec()
    if spec is None:
        raise InputError(
            f"this figure has {_counted(count)}, and ax is one Axes outside of a grid",
            remedy=f"Give {count} Axes, or a Figure or SubFigure to draw all panels on.",
        )
    ax.set_axis_off()
    return _with_layout(ax.get_figure(root=False)).add_subfigure(spec)


def _counted(count: int) -> str:
    return "1 panel" if count == 1 else f"{count} panels"
