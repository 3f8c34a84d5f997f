"""The ten-line way to write an effect of one's own."""

from __future__ import annotations

import copyreg
import pickle
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError

Array = NDArray[np.float64]

SENSORS = ("acc", "gyr", "mag")
SCOPES = ("sensor", "log")
REACHES = ("row", "neighbours", "history")
SIGNS = ("any", "rather_positive", "positive")
AFFINE = {
    "offset": ("offset", {"x", "y", "z"}),
    "scale": ("gain", {"x", "y", "z"}),
    "matrix": ("gain", {row + column for row in "xyz" for column in "xyz"}),
}
"""Parts of a gain and an offset, each with the stage and the parameters that it can have."""

_registered: dict[str, _imufit.Effect] = {}
_written: dict[str, tuple[Function, tuple[Any, ...]]] = {}
"""Function and card of each, by id."""


@dataclass(frozen=True)
class Window:
    """Rows that an effect's function is asked about: ideal readings and covariates, SI units, body frame.

    Attributes
    ----------
    t : ndarray
        (n,) time, s.
    t_start : float
        Time of the log's first row, s.
    omega, alpha : ndarray
        (n, 3) ideal angular rate, rad/s, and angular acceleration, rad/s^2.
    f, m : ndarray
        (n, 3) ideal specific force, m/s^2, and magnetic flux density, uT.
    x : ndarray
        (n, 3) what the effect's stage acts on: the sensor's ideal reading plus earlier effects of the model.
    temperature : ndarray or None
        (n,) sensor temperature less its mean over the log, K.
    columns : mapping of str to ndarray
        (n,) every other column of the log.
    """

    t: Array
    t_start: float
    omega: Array
    alpha: Array
    f: Array
    m: Array
    x: Array
    temperature: Array | None
    columns: Mapping[str, Array]

    def column(self, name: str) -> Array:
        """One of the log's own columns, (n,).

        Parameters
        ----------
        name : str
            Name of the column.

        Raises
        ------
        KeyError
            The log has no such column.
        """
        if name not in self.columns:
            raise KeyError(f"the log has no column {name}; it has {', '.join(self.columns) or 'none of its own'}")
        return self.columns[name]


Function = Callable[[Window], Any]
F = TypeVar("F", bound=Function)


def effect(
    effect_id: str,
    *,
    parameters: Mapping[str, str] | Sequence[str],
    sensor: str | None = None,
    explanation: str = "",
    typical: float | Mapping[str, float] | None = None,
    needs: Sequence[str] = (),
    name: str | None = None,
    formula: str = "",
    signature: str = "",
    mistaken_for: str = "",
    confirm: str = "",
    stage: str = "offset",
    scope: str = "sensor",
    reach: str = "neighbours",
    affine: str | None = None,
    sign: str = "any",
) -> Callable[[F], F]:
    """Make an effect out of a function that returns d reading / d parameters, fitted and ranked like a built-in one.

    Parameters
    ----------
    effect_id : str
        Such as ``gyr.fan``: the sensor's prefix, a dot, a name.
    parameters : mapping of str to str, or sequence of str
        Name of each parameter and its SI unit.
    sensor : str, optional
        ``acc``, ``gyr`` or ``mag``; by default the prefix of the id.
    explanation : str, optional
        The physics in a sentence, shown by ``diagnose`` and ``explain``.
    typical : float or mapping of str to float, optional
        Size that the parameters typically have, in their units.
    needs : sequence of str, optional
        Columns of the log without which the effect is not offered; ``temp`` is the temperature.
    name, formula, signature, mistaken_for, confirm : str, optional
        More words for the effect's card.
    stage : str, optional
        ``offset`` (adds to the reading, default), ``gain`` (acts on the sensor's quantity ``w.x``) or ``input``
        (changes the quantity that reaches the sensing element).
    scope : str, optional
        Whose property the parameters are: ``sensor`` (the same in all logs of one sensor, default) or ``log`` (each
        log has its own, as it has its own bias and mount).
    reach : str, optional
        Which rows of the log decide what the effect adds to one row: ``row`` (that one alone), ``neighbours`` (those
        around it besides, as for ``w.alpha``; default) or ``history`` (those since the start, as for ``w.t_start``).
        Live rows can only be corrected for ``row``.
    affine : str, optional
        ``offset`` (a constant on each axis, parameters x, y, z), ``scale`` (each axis times ``w.x`` of its own) or
        ``matrix`` (``w.x`` times elements named xx, xy, ...): `imufit export` writes such an effect.
    sign : str, optional
        ``any`` (default), ``rather_positive`` (never named first with a negative value) or ``positive``.

    Returns
    -------
    callable
        Decorator; the function itself is returned unchanged. It takes a :class:`Window` and returns (n, 3) for one
        parameter or (n, 3, p) for p of them.

    Raises
    ------
    InputError
        The id, a parameter or the sensor cannot be, or there is an effect of that id: to define one anew, as in a
        notebook, call :func:`imufit.forget_effect` before.
    """
    prefix = effect_id.split(".", 1)[0] if sensor is None else sensor
    if not re.fullmatch(r"[A-Za-z]\w*\.[A-Za-z]\w*", effect_id):
        raise InputError(f"effect id {effect_id!r} is not SENSOR.NAME", remedy="Write for instance gyr.fan.")
    if prefix not in SENSORS:
        raise InputError(
            f"effect {effect_id}: sensor {prefix!r} is unknown", remedy=f"Use one of {', '.join(SENSORS)}."
        )
    if _imufit.find_effect(effect_id) is not None:
        raise InputError(f"effect {effect_id} is built in", remedy="Choose another name.")
    _check_new(effect_id)
    units = dict(parameters) if isinstance(parameters, Mapping) else dict.fromkeys(parameters, "1")
    if not units:
        raise InputError(f"effect {effect_id} has no parameter", remedy="Name at least one with its unit.")
    for key, given, allowed in (("scope", scope, SCOPES), ("reach", reach, REACHES), ("sign", sign, SIGNS)):
        if given not in allowed:
            raise InputError(f"effect {effect_id}: {key} is {given!r}", remedy=f"Use one of {', '.join(allowed)}.")
    if affine is not None:
        _check_affine(effect_id, affine, stage, set(units), needs)
    traits = {"scope": scope, "reach": reach, "sign": sign, **({} if affine is None else {"affine": affine})}
    sizes = dict(typical) if isinstance(typical, Mapping) else dict.fromkeys(units, typical)

    def decorate(function: F) -> F:
        # A decorator may be used twice.
        _check_new(effect_id)
        words = {
            "name": name or effect_id.split(".", 1)[1].replace("_", " "),
            "physics": explanation or (function.__doc__ or "").strip().split("\n")[0],
            "formula": formula,
            "signature": signature,
            "mistaken_for": mistaken_for,
            "confirm": confirm,
        }
        columns = [(key, unit, sizes.get(key)) for key, unit in units.items()]
        _register(function, (effect_id, prefix, columns, words, stage, list(needs), traits))
        return function

    return decorate


def _check_new(effect_id: str) -> None:
    """Refuse a second effect under one id: models that name it would mean another one than before."""
    if effect_id in _registered:
        raise InputError(
            f"effect {effect_id} is defined already",
            remedy=f'Choose another name, or take the first one back: imufit.forget_effect("{effect_id}").',
        )


def _register(function: Function, card: tuple[Any, ...]) -> _imufit.Effect:
    effect_id, columns = card[0], card[2]
    made = _imufit.python_effect(*(*card, _call(effect_id, function, len(columns))))
    _registered[effect_id], _written[effect_id] = made, (function, card)
    return made


def _restored(effect_id: str, function: Function, card: tuple[Any, ...]) -> _imufit.Effect:
    """Return a pickled effect; the import of its function's module may have defined it already."""
    return _registered.get(effect_id) or _register(function, card)


def _pickled(effect: _imufit.Effect) -> tuple[Any, ...]:
    """Effects go into a pickle by their id; a user's with its card, and with its function as functions are pickled."""
    if effect.id in _registered:
        return _restored, (effect.id, *_written[effect.id])
    if _imufit.find_effect(effect.id) is not None:
        return _imufit.find_effect, (effect.id,)
    raise pickle.PicklingError(f"the effect {effect.id} belongs to a log and is not pickled without it")


copyreg.pickle(_imufit.Effect, _pickled)


def _check_affine(effect_id: str, affine: str, stage: str, parameters: set[str], needs: Sequence[str]) -> None:
    """Refuse what cannot be a constant part of a gain and an offset."""
    if affine not in AFFINE:
        raise InputError(f"effect {effect_id}: affine is {affine!r}", remedy=f"Use one of {', '.join(AFFINE)}.")
    own_stage, names = AFFINE[affine]
    if needs:
        raise InputError(
            f"effect {effect_id}: what needs a column is not a constant {affine}", remedy="Leave affine out."
        )
    if stage != own_stage:
        raise InputError(f"effect {effect_id}: affine {affine} at stage {stage}", remedy=f"Use stage {own_stage}.")
    if not (parameters <= names if affine == "matrix" else parameters == names):
        wanted = "among xx, xy, ..., zz" if affine == "matrix" else "x, y, z"
        raise InputError(f"effect {effect_id}: affine {affine} has other parameters", remedy=f"Call them {wanted}.")


def _call(effect_id: str, function: Function, count: int) -> Callable[[dict[str, Any]], Array]:
    """Wrap the user's function so that the core always gets (n, 3, p) float64."""

    def columns(window: dict[str, Any]) -> Array:
        n = len(window["t"])
        values = np.asarray(function(Window(**window)), dtype=np.float64)
        if values.shape == (n, 3) and count == 1:
            values = values[:, :, None]
        if values.shape != (n, 3, count):
            wanted = f"({n}, 3)" if count == 1 else f"({n}, 3, {count})"
            raise InputError(
                f"effect {effect_id} returned shape {values.shape} for {n} rows",
                remedy=f"Return d reading / d parameter as {wanted}.",
            )
        return np.ascontiguousarray(values)

    return columns


def registered() -> dict[str, _imufit.Effect]:
    """User-written effects by id, in the order of their definition."""
    return dict(_registered)


def forget(effect_id: str) -> None:
    """Take a user-written effect out of the catalogue again, so that its id can be defined anew.

    Parameters
    ----------
    effect_id : str
        Such as ``gyr.fan``; one that is not defined is no mistake.
    """
    _registered.pop(effect_id, None)
    _written.pop(effect_id, None)
