"""The questions of the library as functions: each takes a log, a file's name, a table or arrays.

A verb opens what it is given (:func:`imufit.log.log_of`) and asks the package that answers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from imufit.diagnosing.ladder import ladder as ladder_from
from imufit.errors import InputError
from imufit.log import AnyLog, AnyLogs, Log, LogStream, log_of, logs_of_any, whole
from imufit.loop import Fit, SensorModel
from imufit.model.user_function import Function
from imufit.progress import Progress, silent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike
    from scipy.spatial.transform import Rotation

    from imufit.allan_deviation import Allan
    from imufit.calibrating import Calibration
    from imufit.figures.place import Place
    from imufit.joining import Joined
    from imufit.replaying import Replay
    from imufit.results import Comparison, Diagnosis, Ladder, LogInfo, ModelComparison
    from imufit.tuning import Tuning

AnyModel = SensorModel | Fit | Sequence[str | Function] | Function | str | Path | None
"""A model, a fit, effects by their ids, the file of a model; None is the ideal sensor."""


def model_of(given: AnyModel) -> SensorModel:
    """Return the sensor model that something stands for.

    Parameters
    ----------
    given : SensorModel, Fit, sequence of str, str, Path or None
        A text is one effect's id, or the name of a model's file where it ends in ``.toml``.
    """
    if given is None:
        return SensorModel()
    if isinstance(given, SensorModel):
        return given
    if isinstance(given, Fit):
        return given.model
    if isinstance(given, Path) or (isinstance(given, str) and given.endswith(".toml")):
        return SensorModel.load(given)
    return SensorModel([given] if isinstance(given, str) or callable(given) else list(given))


def fit(logs: AnyLogs, model: AnyModel = None, *, progress: Progress | None = None) -> Fit:
    """Fit a sensor model to a log with reference, or to several logs of one sensor.

    Parameters
    ----------
    logs : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these
        Several share all effects but biases and mounts.
    model : SensorModel, sequence of str, str or Path, optional
        Effects such as ``["gyr.bias", "gyr.scale"]``; without it the ideal sensor.
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

    Examples
    --------
    >>> fitted = imufit.fit("walk.parquet", ["gyr.scale"])
    >>> print(fitted)
    gyr.scale: 0.99... times the noise floor (held out)
    >>> round(fitted.params["gyr.scale.y"].value, 3)
    -0.02
    """
    return model_of(model).fit(logs_of_any(logs), progress)


def diagnose(logs: AnyLogs, model: AnyModel = None, *, progress: Progress | None = None) -> Diagnosis:
    """Say which physical effect a sensor model is missing, judged on a log.

    Parameters
    ----------
    logs : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these
        With reference attitude, or with rests that stand in for one; several logs are of one sensor.
    model : SensorModel, Fit, sequence of str, str or Path, optional
        The model that is questioned; without it the ideal sensor.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Raises
    ------
    InputError
        The log has no usable reference, or an effect of the model cannot be tested on it.

    Examples
    --------
    >>> diagnosis = imufit.diagnose("walk.parquet")
    >>> diagnosis.verdict, diagnosis.best
    ('missing', 'gyr.scale')
    >>> diagnosis.candidates[0].parameters[0].name
    'x'
    """
    return fit(logs, model, progress=progress).diagnose(progress=progress)


def ladder(logs: AnyLogs, model: AnyModel = None, *, progress: Progress | None = None) -> Ladder:
    """Repeat diagnose and add until nothing is missing, or until the log leaves open what is.

    Parameters
    ----------
    logs : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these
        With reference attitude, or with rests that stand in for one; several logs are of one sensor.
    model : SensorModel, Fit, sequence of str, str or Path, optional
        Where to start from; without it the ideal sensor.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Returns
    -------
    Ladder
        Every step with the held-out error before, expected and after, the final model and verdict.

    Raises
    ------
    InputError
        The log has no usable reference, or an effect of the model cannot be tested on it.

    Examples
    --------
    >>> result = imufit.ladder("walk.parquet")
    >>> result.model, result.verdict
    (('gyr.scale',), 'adequate')
    >>> print(f"{result.ratio_start:.1f} -> {result.ratio_end:.1f}")
    7.9 -> 1.0
    """
    return ladder_from(fit(logs, model, progress=progress), progress)


def compare(
    log: AnyLog, model: AnyModel = None, other: AnyModel = None, *, progress: Progress | None = None
) -> Comparison | ModelComparison:
    """Say where a model fails on a log, its parameters as they are; or how two models differ on it.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        With reference attitude.
    model : SensorModel, Fit, sequence of str, str or Path, optional
        The model; without it the ideal sensor.
    other : SensorModel, Fit, sequence of str, str or Path, optional
        A second model. Both are then fitted to the log from where they stand.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Returns
    -------
    Comparison or ModelComparison
        Residuals by channel, covariate, segment and frequency; of two models their errors, which one the log prefers
        and in which channels they differ.

    Raises
    ------
    InputError
        The log has no usable reference, or an effect of a model cannot be tested on it.

    Examples
    --------
    >>> comparison = imufit.compare("walk.parquet")
    >>> {name: round(ratio) for name, ratio in comparison.sensors.items()}
    {'acc': 1, 'gyr': 14, 'mag': 1}
    >>> two = imufit.compare("walk.parquet", [], ["gyr.scale"])
    >>> print(two.sentence)
    Held-out error: 7.9... times the noise floor with the ideal sensor, ... with gyr.scale. ...
    """
    opened = log_of(log)
    first = model_of(model)
    if other is None:
        return first.compare(opened, progress)
    return first.fit(opened, progress).against(model_of(other).fit(opened, progress))


def calibrate(
    logs: AnyLogs,
    cost: str | None = None,
    *,
    sensors: Sequence[str] = ("acc", "gyr", "mag"),
    settings: Mapping[str, float] | None = None,
) -> Calibration:
    """Calibrate a sensor from rests, turns between them, and free rotation (paper A).

    Parameters
    ----------
    logs : Log, str, Path, DataFrame, mapping of arrays, or a sequence of these
        Of one sensor; several add up.
    cost : str, optional
        ``vector`` or ``magnitude``, see :func:`imufit.calibrating.calibrate`.
    sensors : sequence of str
        Those to be calibrated, if the logs have them.
    settings : mapping, optional
        Criteria of a rest, see :func:`imufit.calibrating.find_poses`.

    Raises
    ------
    InputError
        The logs leave a calibration open; the message states what is missing.

    Examples
    --------
    >>> calibration = imufit.calibrate("poses.parquet")
    >>> bias = calibration.to_dict()["bias"]
    >>> [round(value, 2) for value in bias]
    [-0.15, 0.1, -0.2]
    >>> calibration.save("sensor.toml")
    """
    from imufit.calibrating import calibrate  # noqa: PLC0415  only needed here

    return calibrate([_held(log) for log in logs_of_any(logs)], cost, sensors=sensors, settings=settings)


def replay(
    log: AnyLog,
    filters: Sequence[str] | str | None = ("gyro", "triad", "mahony"),
    settings: Mapping[str, Mapping[str, float]] | None = None,
    initial: ArrayLike | Rotation | str | None = None,
    *,
    progress: Progress | None = None,
) -> Replay:
    """Attitude for every row of a log by each of several filters.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        n rows with the sensors that the filters need.
    filters : sequence of str or str, optional
        Names out of :data:`imufit.replaying.FILTERS` and ``SMOOTHERS``; None is every filter for which the log has the
        sensors.
    settings : mapping of mappings, optional
        ``{"mahony": {"k_p": 1.0}}``.
    initial : (4,) array, Rotation, "vectors" or "reference", optional
        Attitude at the first row, scalar first, body to reference frame.
    progress : callable, optional
        Called with (filters done, filters in all, what is being done).

    Returns
    -------
    Replay
        Attitudes (n, 4), errors in deg, skipped rows.

    Raises
    ------
    InputError
        A filter or setting is unknown, or a filter lacks its sensor.

    Examples
    --------
    >>> run = imufit.replay("walk.parquet", ["mahony", "mekf"], {"mahony": {"k_p": 1.0}})
    >>> list(run.to_dict()["filters"])
    ['mahony', 'mekf']
    """
    from imufit.replaying import DEFAULT_FILTERS, replay  # noqa: PLC0415  only needed here

    held = _held(log_of(log))
    chosen = (filters,) if isinstance(filters, str) else filters
    try:
        return replay(
            held, DEFAULT_FILTERS if chosen == DEFAULT_FILTERS else chosen, settings, initial, progress or silent
        )
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error), file=held.path) from error


def allan(log: AnyLog, *, progress: Progress | None = None) -> Allan:
    """Allan deviation of each sensor over the longest rest of a log.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        At rest for a long time.
    progress : callable, optional
        Called with (steps done, steps in all, what is being done).

    Raises
    ------
    InputError
        A rest that is long enough is missing.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(scale=0.001, size=(30_000, 3))
    >>> still = imufit.Log.from_arrays(0.01 * np.arange(30_000), gyr=noise)
    >>> deviation = imufit.allan(still)
    >>> {channel: f"{found.noise_density:.1e}" for channel, found in deviation.channels.items()}
    {'gyr_x': '1.4e-04', 'gyr_y': '1.4e-04', 'gyr_z': '1.4e-04'}
    """
    from imufit.allan_deviation import allan  # noqa: PLC0415  only needed here

    return allan(_held(log_of(log)), progress=progress or silent)


def tune(log: AnyLog, filter: str, *, progress: Progress | None = None, **options: Any) -> Tuning:
    """Find the gains of a filter that come nearest to the reference of a log.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        With reference attitude.
    filter : str
        Name out of :data:`imufit.replaying.FILTERS`.
    progress : callable, optional
        Called with (trials done, trials in all, what is being done).
    **options
        As for :func:`imufit.tuning.tune`.

    Raises
    ------
    InputError
        The log lacks what this takes, or a setting cannot be.

    Examples
    --------
    >>> tuning = imufit.tune("walk.parquet", "mahony", gains=["k_p"])
    >>> print(tuning.sentence)
    mahony: total error 1.78 deg with the defaults, 1.40 deg held out with tuned gains.
    """
    from imufit.tuning import tune  # noqa: PLC0415  only needed here

    return tune(_held(log_of(log)), filter, progress=progress or silent, **options)


def info(log: AnyLog, *, effects: bool = True, progress: Progress | None = None) -> LogInfo:
    """Say what is in a log: rates, gaps, ranges, rests, the quality of its reference, the effects that it can show.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        Any log.
    effects : bool
        Whether to find out which effects it can show, which takes a pass over all rows.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Examples
    --------
    >>> print(imufit.info("walk.parquet", effects=False).sentence)
    walk.parquet: 6000 rows over 59.99 s; accelerometer, gyroscope, magnetometer.
    """
    from imufit.inspection import info  # noqa: PLC0415  only needed here

    return info(log_of(log), effects=effects, progress=progress)


@overload
def plot(log: AnyLog, *, ax: None = None, progress: Progress | None = None, **options: Any) -> Figure: ...


@overload
def plot(log: AnyLog, *, ax: Place, progress: Progress | None = None, **options: Any) -> Axes | list[Axes]: ...


def plot(
    log: AnyLog, *, ax: Place | None = None, progress: Progress | None = None, **options: Any
) -> Figure | Axes | list[Axes]:
    """Draw the readings of a log over time.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        Any log.
    ax : Axes, sequence of Axes, Figure or SubFigure, optional
        One Axes for each panel, or a Figure or SubFigure for all of them. One Axes in a grid gives its place to
        several panels.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).
    **options
        As for :func:`imufit.inspection.drawing`: ``columns``, ``show``, ``rows``, ``begin``, ``end``.

    Returns
    -------
    Figure, Axes or list of Axes
        A new figure, which shows itself in a notebook; with `ax` the Axes that were drawn on.

    Raises
    ------
    InputError
        The log has nothing to draw, or `ax` has another number of Axes.

    Examples
    --------
    >>> figure = imufit.plot("walk.parquet", columns=["gyr_x", "gyr_y"])
    >>> figure.savefig("readings.png")
    """
    from imufit.inspection import drawing  # noqa: PLC0415  only needed here

    return drawing(log_of(log), progress=progress, ax=ax, **options).result


def join(
    log: AnyLog,
    reference: AnyLog,
    lag: float | None = None,
    skew: float | None = None,
    *,
    attitude: str | None = None,
    inverse: bool = False,
) -> Joined:
    """Lay a reference on another clock beside a sensor's log.

    Parameters
    ----------
    log : Log, str, Path, DataFrame or mapping of arrays
        The sensor.
    reference : Log, str, Path, DataFrame or mapping of arrays
        The reference; an attitude in columns without a declared kind is read as the sensor's rates show.
    lag : float, optional
        Lag of the reference, s, instead of the one that is found.
    skew : float, optional
        Its clock's skew, instead of the one that is found.
    attitude : str, optional
        Columns that hold the attitude, where names and rates do not show them, such as
        ``euler-ZYX:yaw[deg],pitch[deg],roll[deg]``; see :func:`imufit.joining.with_attitude`.
    inverse : bool
        Whether that attitude turns vectors of the reference frame into the body.

    Raises
    ------
    InputError
        The two have too little motion in common, or the lag is ambiguous.

    Examples
    --------
    >>> log = imufit.read("walk.parquet")
    >>> sensor = log.with_fields(ref_q=None, ref_p=None)
    >>> late = imufit.Log.from_arrays(log.t + 0.25, ref_q=log.ref_q)
    >>> joined = imufit.join(sensor, late)
    >>> print(f"{joined.lag:.2f} s")
    0.25 s
    """
    from imufit.joining import declared_attitude, join, join_as_found, with_attitude  # noqa: PLC0415  only needed here

    other = LogStream(reference, bare=True).read() if isinstance(reference, (str, Path)) else _held(log_of(reference))
    if attitude is not None:
        other = with_attitude(other, *declared_attitude(attitude), inverse=inverse)
    way = join if other.ref_q is not None else join_as_found
    return way(_held(log_of(log)), other, lag, skew)


def _held(log: Any) -> Log:
    """All rows in memory."""
    return whole(log)
