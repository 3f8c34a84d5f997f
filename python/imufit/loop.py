"""The loop as its users hold it: a sensor model that is fitted, compared and applied, and its fit.

The steps themselves are functions of the packages below, which know a model as a stack of effects and a fit as that
stack fitted; both keep the class that they were given.
"""

from __future__ import annotations

from imufit.comparing import compare, compare_model, compare_two
from imufit.diagnosing.add import add
from imufit.diagnosing.diagnose import diagnose
from imufit.fitting.apply import apply
from imufit.fitting.fitted_stack import FittedStack
from imufit.log import AnyLog, AnyLogs, Log, LogSource, log_of, logs_of_any
from imufit.model.effect_stack import EffectStack
from imufit.model.user_function import Function
from imufit.progress import Progress, silent
from imufit.results import Addition, Comparison, Diagnosis, ModelComparison


class SensorModel(EffectStack):
    """A stack of named effects on top of the ideal readings; no effect = the ideal sensor.

    Parameters
    ----------
    effects : sequence of str or callable
        Ids such as ``gyr.bias``, or functions of effects of your own, each once. The order does not
        matter: effects act in the order of their physics.
    parameters : mapping of str to mapping of str to float, optional
        Values by effect and parameter, SI units; zero where not given.
    constants : mapping, optional
        ``temperature_mean`` (degC) and ``covariate_means`` (by name) of the log that the model was fitted on.
    standard_errors : mapping, optional
        Standard errors in the shape of `parameters`.
    limits : mapping, optional
        `Limits` in the shape of `parameters`, of those that are fixed or have bounds.

    Raises
    ------
    InputError
        An effect or a parameter is unknown, or an effect stands there twice.

    Notes
    -----
    ``model.params["gyr.scale.z"].set(value=0.01, vary=False)`` and ``model["gyr.scale"].set(z=0.01, fixed=True)``
    change the model in place, as in lmfit; nothing else does. The model of a fit cannot be set, since the fit is a
    result: take ``fit.model.copy()``.
    """

    def fit(self, log: AnyLogs, progress: Progress | None = None) -> Fit:
        """Fit the parameters to a log with reference, or to several of one sensor, starting from the present values.

        Parameters
        ----------
        log : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these
            With at least one sensor and a reference attitude. Several logs share all effects but biases and mounts.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        Fit
            Parameters with standard errors, held-out error, and the evidence for further questions.

        Raises
        ------
        InputError
            The log has no usable reference, or an effect of the model cannot be tested on it.
        """
        return Fit.of(self, logs_of_any(log), progress)

    def compare(self, log: AnyLog, progress: Progress | None = None) -> Comparison:
        """Say where the model fails on a log, its parameters as they are; nothing is fitted.

        Parameters
        ----------
        log : Log, str, Path, DataFrame or mapping of arrays
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        Comparison
            Residuals by channel, against every covariate, by segment and by frequency.

        Raises
        ------
        InputError
            The log has no usable reference, or an effect of the model cannot be tested on it.
        """
        return compare_model(self, log_of(log), progress or silent)

    def apply(self, log: AnyLog) -> Log:
        """Correct a log's readings: take out what the model's effects added to them.

        No reference is needed. Effects take the motion from the corrected readings themselves: an
        effect of one sensor on another uses the other one corrected, held or interpolated where that one is slower, and
        derivatives come from local polynomials. ``ref.alignment``, the mount of the sensor on the body that the
        reference describes, turns the corrected readings into the axes of that body. The other effects of the
        reference (``ref.delay``, ``ref.tilt``, ``mag.field_reference``) and of the rig change no reading; a note of the
        result names them.

        Parameters
        ----------
        log : Log, str, Path, DataFrame or mapping of arrays
            Readings as they were recorded. A stream is read into memory.

        Returns
        -------
        Log
            The same rows with corrected ``acc``, ``gyr`` and ``mag``; everything else as it was. NaN stays NaN.

        Raises
        ------
        InputError
            An effect needs a column that the log does not have, or cannot be undone: different inputs give the same
            reading, or none gives it. The effect and, where there is one, the row are named.
        """
        return apply(self, log_of(log))


class Fit(FittedStack):
    """A sensor model fitted to a log, or to several of one sensor, with the evidence that answers further questions.

    Attributes
    ----------
    model : SensorModel
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
    params : Params
        Fitted parameters by name: ``fit.params["acc.bias.x"].value``, ``.stderr``, ``.unit``, ``.typical``.
    covariance, correlation : DataFrame
        Of the fitted parameters, rows and columns ``EFFECT.PARAM``.
    """

    model: SensorModel

    def compare(self, log: AnyLog | None = None, progress: Progress | None = None) -> Comparison:
        """Say where the model fails on a log (default: its own, of several the worst); parameters stay as they are.

        Parameters
        ----------
        log : Log, str, Path, DataFrame or mapping of arrays, optional
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        Comparison
            Residuals by channel, against every covariate, by segment and by frequency.
        """
        return compare(self, None if log is None else log_of(log), progress or silent)

    def predict(self, log: AnyLog | None = None, progress: Progress | None = None) -> Log:
        """Return the readings that the fitted model predicts from a log's reference.

        Parameters
        ----------
        log : Log, str, Path, DataFrame or mapping of arrays, optional
            With reference attitude; default: the log of the fit, if it is one. A log's own parameters (its bias) are
            its own in a log of the fit, and the mean in any other.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        Log
            The same rows with predicted ``acc``, ``gyr`` and ``mag``, so that measured minus predicted is what
            :meth:`residuals` returns and :meth:`compare` judges. NaN where nothing is judged.

        Raises
        ------
        InputError
            The log has no usable reference, or it is open which log is meant.
        """
        chosen = self.logs[self._number(None)] if log is None else log_of(log)
        return self.predicted(chosen, progress or silent)

    def diagnose(self, log: AnyLogs | None = None, progress: Progress | None = None) -> Diagnosis:
        """Say which effect is missing from the model, judged on a log (default: its own); fitted parameters move along.

        Parameters
        ----------
        log : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these, optional
            With reference attitude.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).
        """
        tell = progress or silent
        fit = self.on(_opened(log), tell)
        tell(0, 1, f"step 1: looking for effects missing in {' + '.join(fit.model.effects) or 'the ideal sensor'}")
        return diagnose(fit)

    def add(self, effect: str | Function, log: AnyLogs | None = None, progress: Progress | None = None) -> Addition:
        """Add an effect to the model and refit.

        Parameters
        ----------
        effect : str or callable
            Id such as ``gyr.g_sensitivity``, or the function of an effect of your own.
        log : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these, optional
            Logs to fit to; default: its own.
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
        tell = progress or silent
        fit = self.on(_opened(log), tell)
        tell(0, 1, f"step 1: adding {effect}")
        return add(fit, effect)

    def against(self, other: Fit, progress: Progress | None = None) -> ModelComparison:
        """Hold another model that was fitted to the same log against this one.

        Parameters
        ----------
        other : Fit
            The second model.
        progress : callable, optional
            Called with (rows done, rows in all, what is being done).

        Raises
        ------
        InputError
            The two were fitted to different logs.
        """
        return compare_two(self, other, progress or silent)


def _opened(log: AnyLogs | None) -> tuple[LogSource, ...] | None:
    return None if log is None else logs_of_any(log)
