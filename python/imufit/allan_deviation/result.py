"""Noise figures of each channel, from its Allan deviation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.allan_deviation.terms import TERMS, Term, basis, dominant
from imufit.figures import quantity
from imufit.log import Log
from imufit.results import Table
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]

_NAMES: Final = {
    "quantisation": "quantisation",
    "white": "noise density",
    "flicker": "bias instability",
    "walk": "random walk of the bias",
}
_POWERS: Final = {"quantisation": "·s", "white": "/√Hz", "flicker": "", "walk": "/√s"}
_LOWEST: Final = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""Deviation over bias instability where nothing else adds to it."""


@dataclass(frozen=True, eq=False, repr=False)
class Channel(Part):
    """Allan deviation of one channel at k averaging times.

    Parameters
    ----------
    name : str
        For instance ``gyr_x``.
    unit : str
        Of the readings and of the deviation.
    step : float
        Time between two readings, s.
    n : int
        Readings.
    scatter : float
        Standard deviation of one reading without slow drift: the noise of one sample.
    tau : (k,) array
        Averaging times, s.
    deviation : (k,) array
        Overlapping Allan deviation.
    low, high : (k,) array
        Ends of its 68 % confidence interval.
    freedom : (k,) array
        Equivalent degrees of freedom of the variance.
    terms : dict of Term
        What was read off, by kind of noise: quantisation Q, white N, flicker B, walk K of IEEE Std 952.
    squares : dict of float or None
        Squares of the coefficients as fitted; None where the log is too short for a fit.
    tau_start : float or None
        Shortest averaging time of the fit, s: at shorter ones the sensor's own filter shapes the curve.
    probability : float or None
        That noise of these four kinds alone misfits as much.
    """

    name: str
    unit: str
    step: float
    n: int
    scatter: float
    tau: Array
    deviation: Array
    low: Array
    high: Array
    freedom: Array
    terms: dict[str, Term]
    squares: dict[str, float] | None
    tau_start: float | None
    probability: float | None

    @property
    def noise_density(self) -> float | None:
        """One-sided noise density as in data sheets, unit/sqrt(Hz): sqrt(2) N; None where it is not visible."""
        value = self.terms["white"].value
        return None if value is None else float(np.sqrt(2.0) * value)

    @property
    def lowest(self) -> tuple[float, float]:
        """Least deviation and its averaging time, s."""
        at = int(np.nanargmin(self.deviation))
        return float(self.deviation[at]), float(self.tau[at])

    @property
    def still_falling(self) -> bool:
        """Whether white noise is most of the deviation at the longest averaging time: a longer log would show less."""
        if self.squares is None:
            return int(np.nanargmin(self.deviation)) >= len(self.tau) - 2
        visible = [self.terms[kind].value or 0.0 for kind in self.squares]
        return dominant(np.square(visible), self.tau[-1:]) == ["white"]

    def fitted(self, tau: Array) -> Array | None:
        """Return the deviation that the fitted terms give, (k,); None without a fit.

        Parameters
        ----------
        tau : (k,) array
            Averaging times, s.
        """
        return None if self.squares is None else np.sqrt(basis(tau) @ np.array(list(self.squares.values())))

    def to_dict(self) -> dict[str, Any]:
        """JSON of one channel."""
        least, at = self.lowest
        return {
            "unit": self.unit,
            "step_s": self.step,
            "n": self.n,
            "sample_noise": json_value(self.scatter),
            "noise_density": json_value(self.noise_density),
            "terms": {
                name: {**term.to_dict(), "unit": TERMS[name][1].format(self.unit)} for name, term in self.terms.items()
            },
            "lowest": {"deviation": json_value(least), "tau_s": at, "still_falling": self.still_falling},
            "fit": None if self.squares is None else {"tau_start_s": self.tau_start, "probability": self.probability},
            "tau_s": json_value(self.tau),
            "deviation": json_value(self.deviation),
            "low": json_value(self.low),
            "high": json_value(self.high),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Allan(Plotted, Result):
    """Allan deviations of a log's sensors at rest.

    Parameters
    ----------
    channels : dict of Channel
        By name, such as ``gyr_x``.
    duration : float
        Length of the rest that was used, s.
    rows : int
        Rows of it.
    gravity : float
        Of the log, m/s^2.
    field : float or None
        Length of the measured magnetic flux density, uT.
    notes : tuple of str
        What was noticed.
    """

    channels: dict[str, Channel]
    duration: float
    rows: int
    gravity: float
    field: float | None
    notes: tuple[str, ...] = ()

    def mean(self, sensor: str, read: Callable[[Channel], float | None]) -> float | None:
        """Root mean square over a sensor's axes of a figure of its channels; None where an axis lacks it.

        Parameters
        ----------
        sensor : str
            "acc", "gyr" or "mag".
        read : callable
            The figure of a channel.
        """
        values = [read(channel) for name, channel in self.channels.items() if name.startswith(f"{sensor}_")]
        known = [value for value in values if value is not None and np.isfinite(value)]
        return float(np.sqrt(np.mean(np.square(known)))) if known and len(known) == len(values) else None

    def term(self, sensor: str, kind: str) -> float | None:
        """Root mean square over a sensor's axes of a term's coefficient; None where an axis does not show it.

        Parameters
        ----------
        sensor : str
            "acc", "gyr" or "mag".
        kind : str
            Kind of noise, as in `TERMS`.
        """
        return self.mean(sensor, lambda channel: channel.terms[kind].value)

    @property
    def sample_noise(self) -> dict[str, float]:
        """Standard deviation of one reading per sensor: the metadata `noise`, the noise floor of the loop."""
        values = {sensor: self.mean(sensor, lambda channel: channel.scatter) for sensor in ("acc", "gyr", "mag")}
        return {sensor: value for sensor, value in values.items() if value is not None and value > 0.0}

    def to_log(self, log: Log) -> Log:
        """Return the log with the measured noise of one sample in its metadata.

        Parameters
        ----------
        log : Log
            The log that was measured, or another one of the same sensor at the same settings.
        """
        return log.with_fields(metadata=replace(log.metadata, noise={**log.metadata.noise, **self.sample_noise}))

    @property
    def sentence(self) -> str:
        """The measurement in one sentence."""
        return f"Allan deviation over {self.duration:.1f} s at rest, {self.rows} rows."

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes, and what this log cannot show."""
        hidden = [name for name, channel in self.channels.items() if channel.terms["flicker"].value is None]
        remarks = list(self.notes)
        if hidden:
            remarks.append(
                f"No bias instability in {', '.join(hidden)}: the curve has no floor within {self.duration:.0f} s. "
                "The printed value is an upper limit (95 %); a longer log at rest shows it."
            )
        late = [
            name
            for name, channel in self.channels.items()
            if channel.tau_start is not None and channel.tau_start > 1.5 * channel.step
        ]
        if late:
            remarks.append(
                f"The shortest averaging times of {', '.join(late)} are left out of the fit: there a filter of the "
                "sensor, or noise of another colour, shapes the curve."
            )
        return tuple(remarks)

    def tables(self) -> list[Table]:
        """Figures of each channel as a table."""
        header = ("channel", *(f">{_NAMES[kind]}" for kind in ("white", "flicker", "walk", "quantisation")))
        rows = tuple(
            (
                name,
                *(
                    _cell(channel.terms[kind], channel.unit, kind)
                    for kind in ("white", "flicker", "walk", "quantisation")
                ),
            )
            for name, channel in self.channels.items()
        )
        second = tuple(
            (
                name,
                quantity.quantity(channel.scatter, channel.unit),
                quantity.quantity(channel.lowest[0], channel.unit),
                f"{quantity.number(channel.lowest[1])} s" + (", still falling" if channel.still_falling else ""),
            )
            for name, channel in self.channels.items()
        )
        return [
            Table("Read off the curve; < is the most that a term can be which this log does not show", header, rows),
            Table("", ("channel", ">noise of one sample", ">least deviation", ">at"), second),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return what goes into JSON."""
        return {
            "duration_s": self.duration,
            "n": self.rows,
            "gravity": self.gravity,
            "field": self.field,
            "noise": self.sample_noise,
            "channels": {name: channel.to_dict() for name, channel in self.channels.items()},
            "notes": list(self.remarks),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """Table with one row for each channel and averaging time: channel, tau, deviation, low, high, freedom."""
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        frames = [
            pd.DataFrame(
                {
                    "channel": name,
                    "tau": channel.tau,
                    "deviation": channel.deviation,
                    "low": channel.low,
                    "high": channel.high,
                    "freedom": channel.freedom,
                }
            )
            for name, channel in self.channels.items()
        ]
        return pd.concat(frames, ignore_index=True)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Deviation over averaging time, one panel a sensor, with confidence band and fit."""
        from imufit.figures.allan import allan_figure  # noqa: PLC0415

        return allan_figure(list(self.channels.values()), ax)

    def sentences(self) -> list[str]:
        """Return the result as text, the answer first."""
        return [self.sentence, *self.remarks]


def _cell(term: Term, unit: str, kind: str) -> str:
    """Value with its error, or the most that it can be; the white term as a one-sided density."""
    factor, shown = quantity.shown_unit(unit)
    scale = factor * (np.sqrt(2.0) if kind == "white" else 1.0)
    shown += _POWERS[kind]
    if term.value is None or term.standard_error is None:
        return f"< {quantity.number(scale * term.at_most, 2)} {shown}" if np.isfinite(term.at_most) else "-"
    error = scale * term.standard_error
    if 1e-4 <= error < 1e5:
        places = max(0, 1 - int(np.floor(np.log10(error))))
        return f"{scale * term.value:.{places}f} ± {error:.{places}f} {shown}"
    return f"{quantity.number(scale * term.value)} ± {quantity.number(error, 2)} {shown}"
