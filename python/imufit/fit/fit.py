"""A model fitted to a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from imufit.errors import InputError
from imufit.fit.analysis import Analysis, Estimate
from imufit.model.sensor_model import SensorModel
from imufit.progress import Progress, silent
from imufit.results import Parameter
from imufit.results.parameter import by_effect, parameter_frame, parameter_table, plot_parameters

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from imufit.log import LogSource
    from imufit.results import Addition, Comparison, Diagnosis


class Fit:
    """A sensor model fitted to a log, with the evidence that answers further questions.

    Attributes
    ----------
    model : SensorModel
        The model with its fitted parameters.
    log : LogSource
        The log it was fitted to.
    ratio : float
        Held-out residual RMS over the noise floor, all channels (1 = at the floor).
    training_ratio : float
        The same on the data of the fit.
    analysis : Analysis
        Evidence of the log around the fitted parameters.
    estimate : Estimate
        Parameters, standard errors and held-out error that the evidence gives.
    """

    def __init__(self, analysis: Analysis, estimate: Estimate) -> None:
        self.analysis = analysis
        self.estimate = estimate
        self.model, self.unnamed = analysis.moved_to(estimate)
        self.ratio = estimate.held_out
        self.training_ratio = estimate.training

    @classmethod
    def of(cls, model: SensorModel, log: LogSource, progress: Progress | None = None) -> Fit:
        """Fit a model to a log; see :meth:`imufit.SensorModel.fit`.

        Parameters
        ----------
        model : SensorModel
            Effects, and the values to start from.
        log : Log or LogStream
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).
        """
        return cls(*Analysis.of(model, log, progress or silent).solved())

    def moved(self, model: SensorModel) -> Fit:
        """Fit another stack of effects to the same log, starting from this one's values.

        Parameters
        ----------
        model : SensorModel
            The other stack.
        """
        return Fit(*self.analysis.solved_for(model, self.unnamed))

    @property
    def log(self) -> LogSource:
        """The log."""
        return self.analysis.passes.log

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Every parameter with its standard error, unit and typical size."""
        return self.model.listed()

    def compare(self, log: LogSource | None = None, progress: Progress | None = None) -> Comparison:
        """Say where the model fails on a log (default: its own); parameters stay as they are.

        Parameters
        ----------
        log : Log or LogStream, optional
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        Comparison
            Residuals by channel, against every covariate, by segment and by frequency.
        """
        from imufit.diagnose.compare import compare  # noqa: PLC0415

        return compare(self, log, progress or silent)

    def diagnose(self, log: LogSource | None = None, progress: Progress | None = None) -> Diagnosis:
        """Say which effect is missing from the model, judged on a log (default: its own); fitted parameters move along.

        Parameters
        ----------
        log : Log or LogStream, optional
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).
        """
        from imufit.diagnose.diagnose import diagnose  # noqa: PLC0415

        return diagnose(self.on(log, progress or silent))

    def add(self, effect: str, log: LogSource | None = None, progress: Progress | None = None) -> Addition:
        """Add an effect to the model and refit.

        Parameters
        ----------
        effect : str
            Id such as ``gyr.g_sensitivity``.
        log : Log or LogStream, optional
            Log to fit to; default: its own.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        Addition
            Held-out error before, expected and after; ``.fit`` is the better fit.

        Raises
        ------
        InputError
            The effect is unknown, in the model already, or cannot be tested on this log.
        """
        from imufit.diagnose.add import add  # noqa: PLC0415

        return add(self.on(log, progress or silent), effect)

    def on(self, log: LogSource | None, progress: Progress) -> Fit:
        """Return this fit if `log` is its own log, else the model refitted to `log`.

        Parameters
        ----------
        log : Log or LogStream, optional
            The log in question; None is its own.
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        if log is None or log is self.log:
            return self
        return Fit.of(self.model, log, progress)

    def save(self, path: str | Path) -> None:
        """Write the fitted model as a TOML file.

        Parameters
        ----------
        path : str or Path
            The file; one that exists is replaced.
        """
        self.model.save(path)

    def to_dict(self) -> dict[str, Any]:
        """JSON of the fit: model, parameters by effect, held-out and training ratio, number of rows."""
        return {
            "model": list(self.model.effects),
            "parameters": by_effect(self.parameters),
            "ratio": self.ratio,
            "training_ratio": self.training_ratio,
            "n": self.log.n,
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per parameter."""
        return parameter_frame(self.parameters)

    def plot(self) -> Figure:
        """Draw the parameters beside their typical sizes."""
        if not self.parameters:
            raise InputError("the ideal sensor has no parameters to draw", remedy="Fit at least one effect.")
        return plot_parameters(self.parameters)

    def _repr_html_(self) -> str:
        return parameter_table(self.parameters, str(self)).html()

    def __repr__(self) -> str:
        stack = " + ".join(self.model.effects) or "the ideal sensor"
        return f"{stack}: {self.ratio:.3f} times the noise floor (held out)"
