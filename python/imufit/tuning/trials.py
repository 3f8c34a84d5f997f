"""Many gain sets of one filter over one log, judged in one pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.log import Log
from imufit.log.attitude_columns import attitude_offered
from imufit.replaying.replay import Surroundings, counted_rows, surroundings

Array = NDArray[np.float64]
Metric = Literal["total", "heading", "inclination"]
Criterion = Literal["error", "prediction"]

METRICS: Final = ("total", "heading", "inclination")
PARTS: Final = 2
"""The log's halves, by the rows that count."""


@dataclass(frozen=True, eq=False)
class Trials:
    """One filter, one log and one criterion.

    Parameters
    ----------
    filter_name : str
        The filter.
    around : Surroundings
        What it is given.
    t : (n,) array
        Time, s.
    ref_q : (n, 4) array or None
        Reference.
    part : (n,) array of uint8
        0 and 1 for the rows of the two halves, 2 for those that do not count.
    criterion : {"error", "prediction"}
        What is minimised.
    metric : {"total", "heading", "inclination"}
        Of which angle.
    horizon : float
        Time that a prediction runs, s.
    fixed : mapping
        Settings that are not tuned.
    """

    filter_name: str
    around: Surroundings
    t: Array
    ref_q: Array | None
    part: NDArray[np.uint8]
    criterion: Criterion
    metric: Metric
    horizon: float
    fixed: Mapping[str, float]

    def scores(
        self,
        settings: Sequence[Mapping[str, float]],
        *,
        name: str | None = None,
        horizon: float | None = None,
    ) -> Array:
        """Return the scores (k, halves, 12) of `imufit._imufit.filter_trials` for k gain sets."""
        chosen = name or self.filter_name
        fixed = self.fixed if chosen == self.filter_name else {}
        sensors = self.around.sensors
        if horizon is None:
            horizon = self.horizon if self.criterion == "prediction" else 0.0
        return _imufit.filter_trials(
            chosen,
            [{**fixed, **each} for each in settings],
            self.t,
            sensors["acc"],
            sensors["gyr"],
            sensors["mag"],
            part=self.part,
            parts=PARTS,
            reference=self.ref_q,
            horizon=horizon,
            **self.around.arguments,
        )

    def values(self, scores: Array) -> Array:
        """Return the criterion, deg, of each gain set over the halves and the whole, (k, halves + 1)."""
        whole = np.concatenate([scores, scores.sum(axis=1, keepdims=True)], axis=1)
        return self.errors(whole) if self.criterion == "error" else self.predictions(whole)

    def errors(self, scores: Array) -> Array:
        """Return the RMSE against the reference, deg, one for each row of sums; NaN without a reference."""
        column = 1 + METRICS.index(self.metric)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.degrees(np.sqrt(scores[..., column] / scores[..., 0])))

    def predictions(self, scores: Array) -> Array:
        """Return the mean error of the predictions, deg, one for each row of sums.

        The mean of the angle and not of its square: a blow, which no setting foresees, does not outweigh everything.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            tilt, heading = scores[..., 5] / scores[..., 4], scores[..., 9] / scores[..., 8]
        heading = np.where(scores[..., 8] > 0, heading, 0.0)
        chosen = {"total": np.hypot(tilt, heading), "heading": heading, "inclination": tilt}[self.metric]
        return np.asarray(np.degrees(chosen))


def trials(
    log: Log,
    filter_name: str,
    criterion: Criterion | None,
    metric: Metric | None,
    horizon: float,
    fixed: Mapping[str, float],
    rules: Mapping[str, float] | None = None,
) -> Trials:
    """Make ready for trials.

    Parameters
    ----------
    log : Log
        n rows.
    filter_name : str
        The filter.
    criterion : {"error", "prediction"}, optional
        Without it by error where there is a reference.
    metric : {"total", "heading", "inclination"}, optional
        Without it the total with a magnetometer, the inclination without.
    horizon : float
        Time that a prediction runs, s.
    fixed : mapping
        Settings that are not tuned.
    rules : mapping, optional
        Settings of the replay's rules.

    Raises
    ------
    InputError
        The log lacks the reference or a sensor that this takes.
    """
    around = surroundings(log, rules)
    needs = _imufit.filter_descriptions()[filter_name]["needs"]
    for sensor in needs:
        if around.sensors[sensor] is None:
            raise InputError(f"{filter_name} needs {sensor}, which the log does not have", file=log.path or "log")
    referenced = log.ref_q is not None and bool(log.has_reference.any())
    chosen: Criterion = criterion or ("error" if referenced else "prediction")
    if chosen == "error" and not referenced:
        raise InputError(
            "the log has no reference attitude for the error",
            file=log.path or "log",
            remedy="Tune by prediction." + attitude_offered(log),
        )
    if chosen == "prediction" and (around.sensors["gyr"] is None or around.sensors["acc"] is None):
        raise InputError("predictions need acc and gyr", file=log.path or "log")
    angle: Metric = metric or ("inclination" if around.sensors["mag"] is None else "total")
    if chosen == "prediction" and angle == "heading" and around.sensors["mag"] is None:
        raise InputError("predictions of the heading need mag", file=log.path or "log")
    counted = counted_rows(log)
    counts = np.ones(log.n, np.bool_) if counted is None else counted.copy()
    if chosen == "error":
        counts &= log.has_reference
    rows = np.flatnonzero(counts)
    if rows.size < 2:
        raise InputError("no rows count: movement = 1 with a reference is missing", file=log.path or "log")
    part = np.full(log.n, PARTS, np.uint8)
    part[rows] = (np.arange(rows.size) >= rows.size // 2).astype(np.uint8)
    ref_q = log.ref_q if referenced else None
    return Trials(filter_name, around, log.t, ref_q, part, chosen, angle, horizon, dict(fixed))
