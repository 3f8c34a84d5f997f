"""A stack of effects fitted to a log."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.fitting.analysis import Analysis, Estimate, KeptAnalysis
from imufit.fitting.row_residuals import row_residuals
from imufit.log import whole
from imufit.log.columns import SENSOR_NAMES
from imufit.log.several import Logs, logs_of, name_of
from imufit.model.catalogue import each_log_has_its_own, find_effect
from imufit.model.effect_stack import EffectStack
from imufit.progress import Progress, silent
from imufit.results import LogParameters, Parameter, Params
from imufit.results.log_parameters import logs_json
from imufit.results.parameter import by_effect, drawn_parameters, parameter_frame, parameter_table
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place
    from imufit.log import Log, LogSource

Array = NDArray[np.float64]


class FittedStack(Plotted, Result):
    """A stack of effects fitted to a log, or to several of one sensor, with the evidence for further questions.

    Attributes
    ----------
    model : EffectStack
        The model with its fitted parameters; what each log has for itself (its bias) stands with its mean.
    own : tuple of dict
        For each log the values of the effects that it has for itself, unnamed ones among them.
    logs : tuple of LogSource
        The logs it was fitted to.
    ratio : float
        Held-out residual RMS over the noise floor, all channels (1 = at the floor).
    training_ratio : float
        The same on the data of the fit.
    analysis : Analysis
        Evidence of the logs around the fitted parameters.
    estimate : Estimate
        Parameters, standard errors and held-out error that the evidence gives.
    """

    def __init__(self, analysis: Analysis, estimate: Estimate) -> None:
        self._analysis: Analysis | KeptAnalysis = analysis
        self._logs = tuple(each.surveyed.log for each in analysis.logs)
        self.estimate = estimate
        self.model, self.own = analysis.moved_to(estimate)
        self._covariance = analysis.covariance_of(estimate)
        self.ratio = estimate.held_out
        self.training_ratio = estimate.training

    @classmethod
    def of(cls, model: EffectStack, log: Logs, progress: Progress | None = None) -> Self:
        """Fit a model to a log or to several of one sensor; see :meth:`imufit.SensorModel.fit`.

        Parameters
        ----------
        model : EffectStack
            Effects, and the values to start from.
        log : Log, LogStream or a sequence of them
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).
        """
        return cls(*Analysis.of(model, logs_of(log), progress or silent).solved())

    def moved(self, model: EffectStack, only: Collection[str] | None = None) -> Self:
        """Fit another stack of effects to the same logs, starting from this one's values.

        Parameters
        ----------
        model : EffectStack
            The other stack.
        only : collection of str, optional
            Effects about which the new fit will be asked; by default all that the logs can show.
        """
        return type(self)(*self.analysis.solved_for(model, self.own, only=only))

    def of_logs(self, chosen: Sequence[int]) -> Self:
        """Fit the same effects to some of the logs alone, from the evidence that there is.

        Parameters
        ----------
        chosen : sequence of int
            Numbers of the logs.
        """
        analysis = self.analysis.of_logs(chosen)
        return type(self)(analysis, analysis.estimate())

    @property
    def analysis(self) -> Analysis:
        """Evidence of the logs around the fitted parameters; a fit that was pickled takes it from its logs again."""
        if isinstance(self._analysis, KeptAnalysis):
            self._analysis = self._analysis.restored()
        return self._analysis

    def without_evidence(self) -> Self:
        """Return the same fit without its evidence, which the logs give again when it is requested.

        The results stay as they are and take little memory; the evidence of one fit takes megabytes.
        """
        light = copy(self)
        light.__dict__.update(self.__getstate__())
        return light

    @property
    def has_evidence(self) -> bool:
        """Whether questions are answered without another pass over the logs."""
        return not isinstance(self._analysis, KeptAnalysis)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the evidence, which the logs give again when it is requested."""
        kept = self._analysis if isinstance(self._analysis, KeptAnalysis) else KeptAnalysis.of(self._analysis)
        return {**self.__dict__, "_analysis": kept}

    @property
    def logs(self) -> tuple[LogSource, ...]:
        """The logs."""
        return self._logs

    @property
    def by_log(self) -> tuple[LogParameters, ...]:
        """Each log's own parameters, and its ratio to the noise floor; empty for one log."""
        if len(self.logs) == 1:
            return ()
        return tuple(
            LogParameters(name_of(log, k), self._own_parameters(k), self.log_ratio(k))
            for k, log in enumerate(self.logs)
        )

    def _own_parameters(self, log: int) -> tuple[Parameter, ...]:
        found: list[Parameter] = []
        for slot, key in enumerate(self.model.effects):
            if not each_log_has_its_own(key) or log not in self.analysis.having(key):
                continue
            effect = find_effect(key)
            at = self.analysis.having(key).index(log) * len(effect.parameters)
            errors = self.estimate.errors[slot][at : at + len(effect.parameters)]
            found += [
                Parameter(key, name, value, float(error), unit, typical, limits.fixed, limits.lower, limits.upper)
                for (name, unit, typical), value, error, limits in zip(
                    effect.parameters, self.own[log][key], errors, self.model.limits_of(key), strict=True
                )
            ]
        return tuple(found)

    @property
    def worst(self) -> int:
        """Number of the log that stands highest above its noise floor."""
        return max(range(len(self.logs)), key=self.log_ratio) if len(self.logs) > 1 else 0

    def log_ratio(self, log: int) -> float:
        """Return the residual RMS of one log over its noise floor, all channels.

        Parameters
        ----------
        log : int
            Number of the log.
        """
        channels = self.analysis.problem.residual(self.estimate.step, log)["channels"]
        floors = self.analysis.logs[log].floors
        square = sum(item["n"] * (item["rms"] / floors[item["index"]]) ** 2 for item in channels)
        return float(np.sqrt(square / sum(item["n"] for item in channels)))

    def model_of(self, log: int) -> EffectStack:
        """Return the model with the values that one log has for itself.

        Parameters
        ----------
        log : int
            Number of the log.
        """
        own = {key: values for key, values in self.own[log].items() if key in self.model.effects}
        return self.model.starting_at(own)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Every parameter with its standard error, unit and typical size."""
        return self.model.listed()

    @property
    def params(self) -> Params:
        """Fitted parameters by name: ``fit.params["acc.bias.x"].value``, ``.stderr``, ``.unit``, ``.typical``."""
        return Params(self.parameters)

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the fitted parameters, rows and columns ``EFFECT.PARAM``, in the products of their SI units.

        The square roots of its diagonal are the standard errors. Parameters that are fixed, at a bound, or found by a
        search of whole numbers have no row. A log's own parameters stand with their mean over the logs.
        """
        import pandas as pd  # noqa: PLC0415

        keys, matrix = self._covariance
        size = np.diag(matrix)
        chosen = np.flatnonzero(np.isfinite(size) & (size > 0.0))
        labels = [keys[k] for k in chosen]
        return pd.DataFrame(matrix[np.ix_(chosen, chosen)], index=labels, columns=labels)

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlation of the fitted parameters, from -1 to 1, rows and columns as those of `covariance`."""
        import pandas as pd  # noqa: PLC0415

        covariance = self.covariance
        size = np.sqrt(np.diag(covariance))
        found = np.clip(covariance.to_numpy() / np.outer(size, size), -1.0, 1.0)
        # Rounding aside, every parameter is correlated with itself by 1.
        np.fill_diagonal(found, 1.0)
        return pd.DataFrame(found, index=covariance.index, columns=covariance.columns)

    def residuals(self, sensor: str, log: int | str | LogSource | None = None) -> Array:
        """Return the readings of one sensor minus what the fitted model makes of the reference, row by row.

        Parameters
        ----------
        sensor : str
            ``acc``, ``gyr`` or ``mag``.
        log : int, str or Log, optional
            Of a fit of several logs the one that is meant: its number, its file's name, or the log itself.

        Returns
        -------
        ndarray
            (n, 3) of the rows of the log, m/s^2, rad/s or uT; NaN where nothing is judged: no reading, no reference
            around it, or a sample that is certain to be wrong.

        Raises
        ------
        InputError
            The log has no such sensor or no reference, or it is open which log is meant.
        """
        if sensor not in SENSOR_NAMES:
            raise InputError(f"unknown sensor {sensor!r}", remedy=f"Use one of {', '.join(SENSOR_NAMES)}.")
        number = self._number(log)
        found = row_residuals(self.analysis.logs[number], self.analysis.own_step(number, self.estimate.step))
        if sensor not in found:
            raise InputError(
                f"the log has no {sensor} that is judged",
                file=self.logs[number].path,
                remedy=f"Ask for {' or '.join(found)}.",
            )
        return found[sensor]

    def _number(self, log: int | str | LogSource | None) -> int:
        """Return the number of one of the logs."""
        names = [name_of(each, k) for k, each in enumerate(self.logs)]
        listed = ", ".join(f"{k} ({name})" for k, name in enumerate(names))
        if log is None:
            if len(names) > 1:
                raise InputError(f"the fit is of {len(names)} logs", remedy=f"Say which one: log= one of {listed}.")
            return 0
        if isinstance(log, int) and not isinstance(log, bool) and -len(names) <= log < len(names):
            return log % len(names)
        same = [k for k, each in enumerate(self.logs) if log == names[k] or (not isinstance(log, int) and log == each)]
        if len(same) != 1:
            raise InputError(f"{log!r} is not one of the logs of the fit", remedy=f"Use one of {listed}.")
        return same[0]

    def predicted(self, log: LogSource, progress: Progress) -> Log:
        """Return a log with the readings that the fitted model makes of its reference; see :meth:`imufit.Fit.predict`.

        Parameters
        ----------
        log : LogSource
            The log.
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        known = next((k for k, each in enumerate(self.logs) if each == log), None)
        if known is not None:
            evidence, step = self.analysis.logs[known], self.analysis.own_step(known, self.estimate.step)
        else:
            analysis = Analysis.of(self.model, (log,), progress, keep_constants=True)
            evidence, step = analysis.logs[0], analysis.own_step(0, analysis.estimate_unnamed().step)
        residuals = row_residuals(evidence, step)
        held = whole(log)
        measured = {sensor: getattr(held, sensor) for sensor in SENSOR_NAMES}
        return held.with_fields(
            **{
                sensor: None if values is None else values - residuals.get(sensor, np.nan)
                for sensor, values in measured.items()
            }
        )

    def on(self, log: Logs | None, progress: Progress) -> Self:
        """Return this fit if `log` is what it was fitted to, else the model refitted to `log`.

        Parameters
        ----------
        log : Log, LogStream or a sequence of them, optional
            The logs in question; None is its own.
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        if log is None or logs_of(log) == self.logs:
            return self
        return type(self).of(self.model, log, progress)

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
            "n": sum(log.n for log in self.logs),
            **logs_json(self.by_log),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per parameter."""
        return parameter_frame(self.parameters)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw the parameters beside their typical sizes."""
        if not self.parameters:
            raise InputError("the ideal sensor has no parameters to draw", remedy="Fit at least one effect.")
        return drawn_parameters(self.parameters, ax)

    def sentences(self) -> list[str]:
        """Return the fit as text: its effects, and how far its residual is above the noise floor."""
        stack = " + ".join(self.model.effects) or "the ideal sensor"
        return [f"{stack}: {self.ratio:.3f} times the noise floor (held out)"]

    def tables(self) -> tuple[Table, ...]:
        """Return the parameters."""
        return (parameter_table(self.parameters),)

    def __str__(self) -> str:
        return self.sentences()[0]
