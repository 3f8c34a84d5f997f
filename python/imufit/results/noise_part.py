"""One part of the noise floor of a channel, and which instrument it belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from imufit.figures import quantity
from imufit.results.json_value import json_fields
from imufit.results.part import Part
from imufit.results.table import Table

if TYPE_CHECKING:
    from imufit.figures.place import Drawing, Place


@dataclass(frozen=True, repr=False)
class NoisePart(Part):
    """A component of the noise of one channel.

    Attributes
    ----------
    channel : str
        For instance ``gyr_x``.
    component : str
        ``white``, ``random_walk``, ``block_scatter``, ``quantisation``, ``reference`` or ``line``.
    value : float
        Its size in `unit`.
    unit : str
        Of a density, of a walk per root of time, or of the channel.
    share : float
        Its variance over the floor's. Those of the floor sum to 1; a walk or a scatter of the zero comes on top.
    """

    channel: str
    component: str
    value: float
    unit: str
    share: float

    @property
    def beyond(self) -> bool:
        """Whether it moves the zero from one part of the log to the next, and so stands beside the floor."""
        return self.component in ("random_walk", "block_scatter")

    def to_dict(self) -> dict[str, Any]:
        """JSON of one component."""
        return json_fields(self)


def noise_table(parts: Sequence[NoisePart]) -> Table:
    """List the components of the noise of every channel.

    Parameters
    ----------
    parts : sequence of NoisePart
        The components.
    """

    def row(part: NoisePart) -> tuple[str, ...]:
        component = part.component.replace("_", " ")
        share = f"{'+ ' if part.beyond else ''}{quantity.share(part.share)}"
        return part.channel, component, quantity.quantity(part.value, part.unit), share

    rows = tuple(row(part) for part in parts)
    return Table("Noise", ("channel", "component", ">size", ">share of the floor"), rows)


def drawn_noise(parts: Sequence[NoisePart], ax: Place | None = None) -> Drawing:
    """Draw the components of the noise of every channel.

    Parameters
    ----------
    parts : sequence of NoisePart
        The components.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.
    """
    from imufit.figures.noise_parts import noise_parts  # noqa: PLC0415

    return noise_parts(parts, ax)
