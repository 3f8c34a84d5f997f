"""Parts of the noise floor of each channel, as shares of its variance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol

from imufit.figures import place, quantity, style

COLOURS: Final = {
    "white": style.BLUE,
    "reference": style.ORANGE,
    "quantisation": style.GREEN,
    "line": style.VERMILION,
    "random_walk": style.GREY,
    "block_scatter": style.SKY,
}
"""Colours of the components (Okabe and Ito), those beyond the floor last."""

LEAST_SHARE: Final = 0.002
"""Share that is a pixel of a bar of 500; smaller parts stand in the table alone."""


class NoisePartLike(Protocol):
    """The input of one piece of a bar; `imufit.results.NoisePart` has it."""

    @property
    def channel(self) -> str:
        """Channel, such as ``gyr_x``."""

    @property
    def component(self) -> str:
        """Kind of noise."""

    @property
    def share(self) -> float:
        """Its variance over the floor's."""

    @property
    def beyond(self) -> bool:
        """Whether it stands beside the floor."""


def noise_parts(parts: Sequence[NoisePartLike], ax: place.Place | None = None) -> place.Drawing:
    """Draw a bar for each channel, cut into the parts of its noise floor.

    Parameters
    ----------
    parts : sequence of NoisePartLike
        Components of all channels.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        A bar of length 1 is the floor's variance. Hatched pieces stand beside the floor.
    """
    channels = list(dict.fromkeys(part.channel for part in parts))
    if not channels:
        return place.empty("The parts of the noise floor are not known.", ax)
    drawing = place.panels(ax, (8.0, 1.4 + 0.28 * len(channels)))
    axes = drawing.axes[0]
    ends = dict.fromkeys(channels, 0.0)
    for component, colour in COLOURS.items():
        chosen = [part for part in parts if part.component == component]
        if max((part.share for part in chosen), default=0.0) < LEAST_SHARE:
            continue
        axes.barh(
            [channels.index(part.channel) for part in chosen],
            [part.share for part in chosen],
            left=[ends[part.channel] for part in chosen],
            height=0.66,
            color=colour,
            hatch="////" if chosen[0].beyond else None,
            edgecolor="#ffffff",
            linewidth=0.6,
            label=component.replace("_", " "),
        )
        for part in chosen:
            ends[part.channel] += part.share
    axes.axvline(1.0, color=style.INK, linewidth=1.0)
    axes.set_xlim(0.0, 1.05 * max(1.0, *ends.values()))
    axes.set_yticks(range(len(channels)), channels)
    axes.set_ylim(len(channels) - 0.5, -0.5)
    beyond = any(part.beyond and part.share >= LEAST_SHARE for part in parts)
    between = "\n" if drawing.narrow else " "
    note = f"{between}(hatched: beside the floor)" if beyond else ""
    axes.set_xlabel(f"share of the floor's variance{note}", fontsize=9)
    drawing.legend(loc="outside lower center", ncols=2 if drawing.narrow else 5)
    style.title(axes, _sentence(parts))
    style.tidy(axes)
    return drawing


def _sentence(parts: Sequence[NoisePartLike]) -> str:
    """Name the largest part of the floor over all channels."""
    sums: dict[str, float] = {}
    for part in parts:
        if not part.beyond:
            sums[part.component] = sums.get(part.component, 0.0) + part.share
    if not sums:
        return "Parts of the noise floor"
    largest = max(sums, key=sums.__getitem__)
    mean = sums[largest] / sum(sums.values())
    owner = {"white": "white noise of the sensor", "reference": "noise of the reference"}.get(largest, largest)
    return f"The noise floor is {quantity.share(mean)} {owner.replace('_', ' ')}"
