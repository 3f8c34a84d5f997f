"""The one ``plot`` of all results."""

from __future__ import annotations

from typing import TYPE_CHECKING, overload

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from imufit.figures.place import Drawing, Place


class Plotted:
    """A result that can be drawn, on a figure of its own or on given axes."""

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw it, see :mod:`imufit.figures.place`."""
        raise NotImplementedError

    @overload
    def plot(self, ax: None = None) -> Figure: ...

    @overload
    def plot(self, ax: Place) -> Axes | list[Axes]: ...

    def plot(self, ax: Place | None = None) -> Figure | Axes | list[Axes]:
        """Draw this, on a new figure or where `ax` states.

        Parameters
        ----------
        ax : Axes, sequence of Axes, Figure or SubFigure, optional
            One Axes for one panel; of several panels one Axes each, or a Figure or SubFigure for all of them. One Axes
            in a grid gives its place to several panels.

        Returns
        -------
        Figure, Axes or list of Axes
            A new figure, which shows itself in a notebook; with `ax` the Axes that were drawn on.

        Raises
        ------
        InputError
            There is nothing to draw, or `ax` has another number of Axes.
        """
        return self._drawn(ax).result
