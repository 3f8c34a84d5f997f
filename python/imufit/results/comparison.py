"""Where the model fails: by channel, by covariate, by segment, by frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np
from numpy.typing import NDArray

from imufit.figures import quantity
from imufit.results.data_fault import DataFault, fault_table
from imufit.results.json_value import json_fields, json_value
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from imufit.figures.place import Drawing, Place
    from imufit.results.attitude import AttitudeComparison

MAIN_CAUSES = 5
"""Covariates that stand under the answer: as many as channels of two sensors can have on one screen of 24 lines."""


@dataclass(frozen=True, repr=False)
class ChannelResidual(Part):
    """Residual (measured - modelled) of one channel over the whole log.

    Attributes
    ----------
    channel : str
        For instance ``gyr_x``.
    rms, mean, noise_floor : float
        In `unit`.
    ratio : float
        RMS over noise floor.
    unit : str
        SI unit.
    n : int
        Samples used.
    """

    channel: str
    rms: float
    mean: float
    noise_floor: float
    ratio: float
    unit: str
    n: int

    def to_dict(self) -> dict[str, Any]:
        """JSON of one channel."""
        names = ("rms", "mean", "noise_floor", "ratio", "unit", "n")
        return {name: json_value(getattr(self, name)) for name in names}


@dataclass(frozen=True, eq=False, repr=False)
class Panel(Plotted, Part):
    """Binned residual of one channel against one covariate.

    Attributes
    ----------
    channel, covariate, channel_unit, covariate_unit : str
        Names and SI units.
    centre, mean, band : ndarray
        (k,) centre of each bin in the covariate's unit; mean residual and half width of its 95 % band in the channel's.
    noise_floor : float
        Noise of one sample, channel's unit.
    share : float
        Fraction of the excess variance that the covariate explains.
    """

    channel: str
    covariate: str
    channel_unit: str
    covariate_unit: str
    centre: NDArray[np.float64]
    mean: NDArray[np.float64]
    band: NDArray[np.float64]
    noise_floor: float
    share: float

    def to_dict(self) -> dict[str, Any]:
        """JSON with the arrays as lists."""
        return json_fields(self)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per bin: centre, mean, band."""
        import pandas as pd  # noqa: PLC0415

        return pd.DataFrame({"centre": self.centre, "mean": self.mean, "band": self.band})

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw this panel alone."""
        return drawn_panels((self,), ax)


FAILS: Final = 1.05
"""Residual over noise floor from which on a channel fails: below, the excess is a tenth of the noise's variance."""
OFFSET: Final = "constant"
"""Name of what a channel's excess depends on where its residual is an offset."""
NEARLY_WHOLE: Final = 0.9
"""Part of a log: a stretch of so much of it says no more than the whole log does."""
MOST_PANELS: Final = 12
"""Panels of a figure: three rows of four fill a screen."""


def drawn_panels(panels: Sequence[Panel], ax: Place | None = None, limit: int = MOST_PANELS) -> Drawing:
    """Draw the worst panels side by side."""
    from imufit.figures.residuals import residual_panels  # noqa: PLC0415

    return residual_panels(panels, limit=limit, ax=ax)


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Plotted, Part):
    """Density of one channel's residual.

    Attributes
    ----------
    channel, unit : str
        Name and unit of the density.
    frequency, density : ndarray
        (k,) Hz and `unit`.
    floor : float
        Density of the noise floor, `unit`.
    """

    channel: str
    unit: str
    frequency: NDArray[np.float64]
    density: NDArray[np.float64]
    floor: float

    def to_dict(self) -> dict[str, Any]:
        """JSON with the arrays as lists."""
        return json_fields(self)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per frequency: frequency, density."""
        import pandas as pd  # noqa: PLC0415

        return pd.DataFrame({"frequency": self.frequency, "density": self.density})

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw this spectrum alone."""
        from imufit.figures.spectrum import residual_spectra  # noqa: PLC0415

        return residual_spectra([self], ax)


@dataclass(frozen=True, repr=False)
class Where(Part):
    """A covariate that explains part of a channel's excess.

    Attributes
    ----------
    channel, covariate : str
        Names.
    share : float
        Fraction of the excess variance over the noise floor.
    t_start, t_end : float
        Where in time most of it lies, s.
    """

    channel: str
    covariate: str
    share: float
    t_start: float
    t_end: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of one line."""
        return json_fields(self)

    def __str__(self) -> str:
        dependence = "is constant" if self.covariate == OFFSET else f"depends on {self.covariate}"
        return f"{quantity.share(self.share)} of the excess of {self.channel} {dependence}"


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Plotted, Result):
    """A model held against a log.

    Attributes
    ----------
    n : int
        Rows.
    duration_s : float
        Length of the log, s.
    model : tuple of str
        Effects of the model; empty is the ideal sensor.
    channels : tuple of ChannelResidual
        Residual by channel.
    sensors : dict
        Ratio by sensor.
    attitude : AttitudeComparison or None
        How far an attitude filter is off, where the log determines this.
    where : tuple of Where
        Covariates that explain the excess, largest share first.
    panels : tuple of Panel
        Residual against covariates.
    spectra : tuple of Spectrum
        Residual by frequency.
    segments : tuple
        (t_start, t_end, channel, ratio), worst first.
    notes : tuple of str
        What the reader should know about these figures.
    data_faults : tuple of DataFault
        What is wrong with the data themselves.
    """

    n: int
    duration_s: float
    model: tuple[str, ...]
    channels: tuple[ChannelResidual, ...]
    sensors: dict[str, float]
    attitude: AttitudeComparison | None
    where: tuple[Where, ...]
    panels: tuple[Panel, ...]
    spectra: tuple[Spectrum, ...]
    segments: tuple[tuple[float, float, str, float], ...]
    notes: tuple[str, ...]
    data_faults: tuple[DataFault, ...] = ()

    @property
    def sentence(self) -> str:
        """The result in one or two sentences."""
        name = " + ".join(self.model) or "the ideal sensor"
        if not self.channels:
            return f"No channel of this log can be held against {name}."
        worst = max(self.channels, key=lambda channel: channel.ratio if np.isfinite(channel.ratio) else -1.0)
        text = f"With {name}, {worst.channel} stands at {quantity.ratio(worst.ratio)} times its noise floor"
        text += ", the worst of the channels." if len(self.channels) > 1 else "."
        if worst.ratio > FAILS:
            causes = [where for where in self.where if where.channel == worst.channel]
            cause = causes[0] if causes else self.where[0] if self.where else None
            if cause is not None:
                within = (
                    "" if self._throughout(cause) else f", most of it at {quantity.span(cause.t_start, cause.t_end)}"
                )
                text += f" {cause}{within}."
        return text

    @property
    def failing(self) -> tuple[str, ...]:
        """Names of the channels whose residual stands above the noise floor."""
        return tuple(item.channel for item in self.channels if item.ratio > FAILS)

    def _throughout(self, cause: Where) -> bool:
        """Whether a cause lies in nearly the whole log."""
        return cause.t_end - cause.t_start >= NEARLY_WHOLE * self.duration_s

    def to_dict(self) -> dict[str, Any]:
        """JSON of `compare`; worst segments, notes and faults of the data besides."""
        return {
            "n": int(self.n),
            "duration_s": json_value(self.duration_s),
            "model": list(self.model),
            "channels": {channel.channel: channel.to_dict() for channel in self.channels},
            "sensors": {name: {"ratio": json_value(ratio)} for name, ratio in self.sensors.items()},
            "attitude": None if self.attitude is None else self.attitude.to_dict(),
            "where": [where.to_dict() for where in self.where],
            "segments": [
                {
                    "t_start": json_value(t_start),
                    "t_end": json_value(t_end),
                    "channel": channel,
                    "ratio": json_value(ratio),
                }
                for t_start, t_end, channel, ratio in self.segments
            ],
            "notes": list(self.notes),
            "data_faults": [fault.to_dict() for fault in self.data_faults],
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per channel, SI units."""
        import pandas as pd  # noqa: PLC0415

        columns = ["channel", "rms", "mean", "noise_floor", "ratio", "unit", "n"]
        return pd.DataFrame([[getattr(item, name) for name in columns] for item in self.channels], columns=columns)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Residual against the covariates, worst first."""
        return drawn_panels(self.panels, ax)

    @overload
    def plot_spectra(self, ax: None = None) -> Figure: ...

    @overload
    def plot_spectra(self, ax: Place) -> Axes | list[Axes]: ...

    def plot_spectra(self, ax: Place | None = None) -> Figure | Axes | list[Axes]:
        """Draw the spectrum of the residual over its noise floor, a panel for each sensor.

        Parameters
        ----------
        ax : Axes, sequence of Axes, Figure or SubFigure, optional
            As for `plot`.
        """
        from imufit.figures.spectrum import residual_spectra  # noqa: PLC0415

        return residual_spectra(self.spectra, ax).result

    def channel_table(self) -> Table:
        """Residual by channel in shown units, the worst channel first."""
        rows = tuple(
            (
                item.channel,
                quantity.ratio(item.ratio),
                quantity.quantity(item.rms, item.unit),
                quantity.mean(item.mean, item.unit, item.noise_floor / math.sqrt(item.n)),
                quantity.quantity(item.noise_floor, item.unit),
                f"{item.n}",
            )
            for item in sorted(self.channels, key=lambda item: -item.ratio if np.isfinite(item.ratio) else math.inf)
        )
        header = ("channel", ">over floor", ">residual RMS", ">mean", ">noise floor", ">samples")
        return Table("Residual by channel (measured - modelled)", header, rows)

    def where_table(self, limit: int = 10) -> Table:
        """Covariates that explain the excess.

        Parameters
        ----------
        limit : int
            Rows at most.
        """
        rows = tuple(
            (
                item.channel,
                item.covariate,
                quantity.share(item.share),
                "the whole log" if self._throughout(item) else quantity.span(item.t_start, item.t_end),
            )
            for item in self.where[:limit]
        )
        return Table("Dependences of the excess", ("channel", "covariate", ">share", ">mostly at"), rows)

    def segment_table(self, limit: int = 5) -> Table:
        """Worst segments.

        Parameters
        ----------
        limit : int
            Rows at most.
        """
        rows = tuple(
            (quantity.span(t_start, t_end), channel, quantity.ratio(ratio))
            for t_start, t_end, channel, ratio in self.segments[:limit]
        )
        return Table("Worst segments", (">time", "channel", ">over floor"), rows)

    def tables(self) -> tuple[Table, ...]:
        """Every table, most important first."""
        tables = (self.channel_table(), self.where_table(), self.segment_table(), fault_table(self.data_faults))
        return tables if self.attitude is None else (*tables, self.attitude.table())

    def answer_tables(self) -> tuple[Table, ...]:
        """Residual by channel, and what most of the excess depends on."""
        return self.channel_table(), self.where_table(MAIN_CAUSES)

    def sentences(self) -> list[str]:
        """Return the result, what it does to the attitude, faults of the data, and the notes."""
        attitude = [] if self.attitude is None else [self.attitude.sentence]
        return [self.sentence, *attitude, *map(str, self.data_faults), *self.notes]
