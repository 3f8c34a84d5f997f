"""Tune the gains of a filter on a log, and say what they are worth on data they were not tuned on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from imufit.allan_deviation import allan, filter_noise
from imufit.errors import InputError
from imufit.log import Log
from imufit.progress import Progress, silent
from imufit.replaying import SETTINGS
from imufit.tuning.gains import RANGE, starts
from imufit.tuning.result import Gain, GainMap, Innovation, Tuning
from imufit.tuning.search import coarse, refine
from imufit.tuning.trials import PARTS, Criterion, Metric, Trials, trials

Array = NDArray[np.float64]

HORIZON = 1.0
"""Time that a prediction runs, s."""
_FLAT = 1.05
"""Gains within this factor of the least value are as good."""
_PER_DECADE = 8
_DECADES = 4
_BETWEEN = 15
_MAP = 17
_MAP_DECADES = 1.5
_ONE_ROW = 1e-9
_REST = 20.0
"""Shortest rest, s, whose Allan deviation is used."""
_NOISES = ("gyr_noise", "bias_walk")
"""Noises from an Allan deviation; the accelerometer's and the magnetometer's include motion and surroundings."""


def tune(
    log: Log,
    filter_name: str,
    *,
    by: Criterion | None = None,
    metric: Metric | None = None,
    gains: Sequence[str] = (),
    fixed: Mapping[str, float] | None = None,
    rules: Mapping[str, float] | None = None,
    horizon: float = HORIZON,
    map_of: tuple[str, str] | None = None,
    progress: Progress = silent,
) -> Tuning:
    """Find the gains with which a filter does best on a log.

    With a reference the criterion is the root mean square error (rows with ``movement == 1`` where that column exists).
    Without one it is the mean error of the filter's predictions: from an attitude of the filter a copy goes on for
    `horizon` seconds on the gyro and the learned bias alone, and the specific force and the field that come in the
    second half of that time are held against what it foresees. Noise that is independent over that time cancels; a
    disturbance that lasts longer (the field of a room, a constant acceleration) cannot be separated from an attitude,
    and gains tuned this way follow it. Where the log rests long enough, the gyro's noise and the walk of its bias come
    from
    its Allan deviation and are not searched.

    The search is a grid over factors up to 1000 either way, then steps down to 2 %, each a single pass over the log.
    Gains are tuned on either half of the log and judged on the other; those that are handed out are tuned on all of it.

    Parameters
    ----------
    log : Log
        n rows.
    filter_name : str
        Out of `imufit.replaying.FILTERS`.
    by : {"error", "prediction"}, optional
        Criterion; without it by error where there is a reference.
    metric : {"total", "heading", "inclination"}, optional
        Which angle; without it the total with a magnetometer and the inclination without.
    gains : sequence of str, optional
        Settings to tune.
    fixed : mapping, optional
        Other settings of the filter.
    rules : mapping, optional
        Settings of the replay's rules.
    horizon : float, optional
        Time that a prediction runs, s.
    map_of : pair of str, optional
        The gains of the map; without it the first two.
    progress : callable, optional
        Called with (steps done, steps in all, what is being done).

    Returns
    -------
    Tuning
        Gains, what they are worth, their map and their tolerance.

    Raises
    ------
    InputError
        The log lacks the needed columns, or the filter or gain is unknown.
    """
    if not horizon > 0.0:
        raise InputError(f"horizon = {horizon} is not a time for a prediction", remedy="Write seconds, such as 1.")
    begin = starts(filter_name, gains)
    held = dict(fixed or {})
    begin = {name: value for name, value in begin.items() if name not in held}
    if not begin:
        raise InputError(f"every gain of {filter_name} is fixed: no gain remains to tune")
    ready = trials(log, filter_name, by, metric, horizon, held, rules)
    notes: list[str] = []
    if ready.criterion == "prediction" and not gains:
        known, note = _known_noise(log, filter_name)
        known = {name: value for name, value in known.items() if name not in held}
        if known and set(begin) - set(known):
            begin = {name: value for name, value in begin.items() if name not in known}
            ready = replace(ready, fixed={**known, **ready.fixed})
        notes += [note] if note else []
    begin = _that_matter(ready, begin, notes)
    names = list(begin)
    for name in map_of or ():
        if name not in names:
            raise InputError(f"the map is over gains that are tuned, and {name!r} is not: there is {', '.join(names)}")
    centre = np.log(list(begin.values()))
    low, high = centre - np.log(RANGE), centre + np.log(RANGE)

    def scores(points: Array) -> Array:
        return ready.scores([dict(zip(names, np.exp(point).tolist(), strict=True)) for point in points])

    progress(0, 6, "coarse search")
    points = np.concatenate([centre[None], coarse(low, high)])
    values = ready.values(scores(points))
    if not np.isfinite(values[:, PARTS]).any():
        raise InputError("no row can be judged with any gain", file=log.path or "log")
    spacing = (high - low) / max(2.0, len(points) ** (1.0 / len(names)) - 1.0)
    optima = []
    for k, what in enumerate(("first half", "second half", "whole log")):
        progress(1 + k, 6, f"fine search, {what}")
        column = np.where(np.isfinite(values[:, k]), values[:, k], np.inf)
        at = int(np.argmin(column))
        judge = partial(_column, ready, scores, k)
        optima.append(refine(judge, points[at], float(column[at]), low, high, spacing / 2.0)[0])
    progress(4, 6, "tolerance of the gains")
    best = optima[PARTS]
    rival = _rival(ready)
    described = _gains(ready, names, list(begin.values()), best, (low, high), rival[1] if rival else None)
    progress(5, 6, "map of the gains")
    found_map = _map(ready, names, best, map_of)
    final = scores(np.stack([centre, *optima]))
    progress(6, 6, "tuned")
    return Tuning(
        filter_name=filter_name,
        criterion=ready.criterion,
        metric=ready.metric,
        rows=int(np.count_nonzero(ready.part < PARTS)),
        horizon=horizon if ready.criterion == "prediction" else None,
        gains=described,
        fixed=dict(ready.fixed),
        value=_worth(ready, final, ready.criterion),
        error=_worth(ready, final, "error") if ready.ref_q is not None else None,
        rival=rival,
        innovation=_innovations(ready, names, np.stack([centre, best])),
        map=found_map,
        notes=tuple(notes),
    )


def _column(ready: Trials, scores: Callable[[Array], Array], k: int, points: Array) -> Array:
    """Return the criterion of each point over half or whole k."""
    return ready.values(scores(points))[:, k]


def _known_noise(log: Log, name: str) -> tuple[dict[str, float], str]:
    """Return the noises of this filter from the log's longest rest, and a note on them."""
    try:
        found = allan(log, sensors=("gyr",))
    except InputError:
        return {}, ""
    if found.duration < _REST:
        return {}, ""
    known = {key: value for key, value in filter_noise(found).get(name, {}).items() if key in _NOISES}
    if not known:
        return {}, ""
    return known, f"{' and '.join(known)} from the Allan deviation of {found.duration:.1f} s at rest."


def _that_matter(ready: Trials, begin: dict[str, float], notes: list[str]) -> dict[str, float]:
    """Leave out the gains that change nothing on this log."""
    tried = [begin, *({**begin, name: 10.0 * value} for name, value in begin.items())]
    values = ready.values(ready.scores(tried))[:, PARTS]
    kept = {name: begin[name] for name, value in zip(begin, values[1:], strict=True) if value != values[0]}
    idle = [name for name in begin if name not in kept]
    if idle and kept:
        notes.append(f"{', '.join(idle)} changes nothing on this log and was left unchanged.")
    return kept or begin


def _rival(ready: Trials) -> tuple[str, float] | None:
    """Return the filter without gains that this one has to beat, and its error, deg."""
    if ready.criterion != "error" or ready.around.sensors["acc"] is None:
        return None
    name = "triad" if ready.around.sensors["mag"] is not None else "accel"
    if name == "accel" and ready.metric != "inclination":
        return None
    value = float(ready.values(ready.scores([{}], name=name))[0, PARTS])
    return (name, value) if np.isfinite(value) else None


def _gains(
    ready: Trials,
    names: list[str],
    defaults: list[float],
    best: Array,
    box: tuple[Array, Array],
    rival: float | None,
) -> tuple[Gain, ...]:
    """Change one gain at a time by up to four decades either way, the others at their best."""
    factors = np.logspace(-_DECADES, _DECADES, 2 * _DECADES * _PER_DECADE + 1)
    tuned = dict(zip(names, np.exp(best).tolist(), strict=True))
    tried = [{**tuned, name: tuned[name] * factor} for name in names for factor in factors]
    values = ready.values(ready.scores(tried))[:, PARTS].reshape(len(names), factors.size)
    units = _units(ready.filter_name)
    middle = factors.size // 2

    def change(k: int, tested: Array) -> Array:
        """Return the values with gain k times each of the factors."""
        name = names[k]
        return ready.values(ready.scores([{**tuned, name: tuned[name] * factor} for factor in tested.tolist()]))[
            :, PARTS
        ]

    found = []
    for k, name in enumerate(names):
        edge = "lower" if best[k] - box[0][k] < 0.1 else "upper" if box[1][k] - best[k] < 0.1 else None
        judge = partial(change, k)
        found.append(
            Gain(
                name=name,
                unit=units[name],
                default=defaults[k],
                tuned=tuned[name],
                edge=edge,
                flat=_within(factors, values[k], middle, _FLAT * values[k, middle], judge),
                wins=None if rival is None else _within(factors, values[k], middle, rival, judge),
                factors=factors,
                values=values[k],
            )
        )
    return tuple(found)


def _units(name: str) -> dict[str, str]:
    return {setting: entry["unit"] for setting, entry in SETTINGS[name].items()}


def _within(
    factors: Array, values: Array, middle: int, limit: float, judge: Callable[[Array], Array]
) -> tuple[float, float] | None:
    """Return the outermost factors around 1 up to which the values stay below a limit, to 2 %.

    0 and infinity where the limit is not met within the factors; None where it is exceeded at once.
    """
    if not values[middle] <= limit:
        return None
    ends = []
    for step in (-1, 1):
        bad = np.flatnonzero(~(values[middle::step] <= limit))
        if not bad.size:
            ends.append(float("inf") if step > 0 else 0.0)
            continue
        last = middle + step * (int(bad[0]) - 1)
        between = np.geomspace(factors[last], factors[last + step], _BETWEEN + 2)[1:-1]
        good = np.append(judge(between) <= limit, False)
        ends.append(float(np.concatenate([[factors[last]], between])[int(np.argmin(good))]))
    return ends[0], ends[1]


def _map(ready: Trials, names: list[str], best: Array, map_of: tuple[str, str] | None) -> GainMap | None:
    """Return the criterion over two gains, the others at their best; None for a filter with one gain."""
    if len(names) < 2:
        return None
    a, b = map_of or (names[0], names[1])
    tuned = dict(zip(names, np.exp(best).tolist(), strict=True))
    factors = np.logspace(-_MAP_DECADES, _MAP_DECADES, _MAP)
    x, y = tuned[a] * factors, tuned[b] * factors
    tried = [{**tuned, a: float(first), b: float(second)} for second in y for first in x]
    values = ready.values(ready.scores(tried))[:, PARTS].reshape(_MAP, _MAP)
    return GainMap((a, b), x, y, values)


def _worth(ready: Trials, scores: Array, criterion: Criterion) -> dict[str, float]:
    """Return the value, deg, of the defaults and the tuned gains, and of the latter on the half they were not tuned on.

    The rows of `scores` are the defaults, those tuned on the first half, on the second, and on the whole.
    """
    judged = replace(ready, criterion=criterion)
    values = judged.values(scores)
    crossed = np.stack([scores[1, 1], scores[2, 0]])
    held_out = judged.values(crossed[None])[0, PARTS]
    return {
        "default": float(values[0, PARTS]),
        "tuned": float(values[3, PARTS]),
        "held_out": float(held_out),
    }


def _innovations(ready: Trials, names: list[str], points: Array) -> dict[str, Innovation] | None:
    """Return size and whiteness of the innovations with default and tuned gains; None without acc and gyr."""
    if ready.around.sensors["acc"] is None or ready.around.sensors["gyr"] is None:
        return None
    tried = [dict(zip(names, np.exp(point).tolist(), strict=True)) for point in points]
    sums = ready.scores(tried, horizon=_ONE_ROW).sum(axis=1)
    found = {}
    for name, each in zip(("default", "tuned"), sums, strict=True):
        n, _, square, product = each[4:8]
        if n > 1 and square > 0.0:
            found[name] = Innovation(float(np.degrees(np.sqrt(square / n))), float(product / square))
    return found or None
