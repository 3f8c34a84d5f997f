"""The ten-line way to write an effect of one's own."""

from __future__ import annotations

import copyreg
import inspect
import math
import pickle
import re
import runpy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from imufit import _imufit
from imufit.errors import InputError
from imufit.model.search_range import SearchRange
from imufit.model.user_function import Function, UserFunction
from imufit.model.window import TEMPERATURE

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

WHOLE_LOG = "log"
"""Memory of an effect that all rows since the start of the log decide."""


@dataclass(frozen=True, eq=False)
class Written:
    """A user's effect as it was written.

    Attributes
    ----------
    asked : UserFunction
        Its function, as the compiled core asks for it.
    card : tuple
        What else it declares, as the compiled core takes it.
    file : Path or None
        The file that `load_effects` ran to define it.
    """

    asked: UserFunction
    card: tuple[Any, ...]
    file: Path | None


_registered: dict[str, _imufit.Effect] = {}
_written: dict[str, Written] = {}
_running: list[Path] = []
"""The file of effects that is being run."""


F = TypeVar("F", bound=Function)


def effect(
    effect_id: str,
    *,
    parameters: Mapping[str, str] | Sequence[str],
    search: Mapping[str, Sequence[float]] | None = None,
    memory: float | str = 0.0,
    axes: str = "xyz",
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
    """Make an effect out of a function that returns what it adds to the reading, fitted and ranked like a built-in one.

    Derivatives are taken for you. The value has to be linear in every parameter that is not named in `search`.

    Parameters
    ----------
    effect_id : str
        Such as ``gyr.fan``: the sensor's prefix, a dot, a name.
    parameters : mapping of str to str, or sequence of str
        Name of each parameter and its SI unit.
    search : mapping of str to sequence of float, optional
        Parameters that the value is not linear in: for each the range (low, high) to search, in its unit, or at least
        three values, which are then the only ones tried.
    memory : float or str, optional
        How long before a row others decide what is added to it: seconds (``10.0`` or ``"10 s"``, ``"2 min"``), or
        ``"log"`` for all rows since the start of the log. The window then begins at least that much earlier than the
        rows that are used of it.
    axes : str, optional
        Axes that a value of shape (n,) is added to, such as ``z``; by default all three.
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
        around it besides, as for ``w.alpha``; default) or ``history`` (those since the start, as for ``w.t_start``;
        follows from `memory`). Live rows can only be corrected for ``row``.
    affine : str, optional
        ``offset`` (a constant on each axis, parameters x, y, z), ``scale`` (each axis times ``w.x`` of its own) or
        ``matrix`` (``w.x`` times elements named xx, xy, ...): `imufit export` writes such an effect.
    sign : str, optional
        ``any`` (default), ``rather_positive`` (never named first with a negative value) or ``positive``.

    Returns
    -------
    callable
        Decorator; the function itself is returned unchanged. It takes a :class:`Window` and the parameters by name,
        and returns what the effect adds to the reading, (n, 3) or (n,).

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
    names = tuple(units)
    ranges = _ranges(effect_id, search or {}, names)
    seconds = _seconds(effect_id, memory)
    if seconds > 0.0:
        if stage != "offset":
            raise InputError(f"effect {effect_id}: memory at stage {stage}", remedy="Leave stage out.")
        reach = "history"
    if not axes or set(axes) - set("xyz"):
        raise InputError(f"effect {effect_id}: axes is {axes!r}", remedy="Name some of x, y, z.")
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
        _check_arguments(effect_id, function, names)
        columns = [
            (key, unit, sizes.get(key), _FOUND[(key in ranges) + bool(key in ranges and ranges[key].values)])
            for key, unit in units.items()
        ]
        limits = [(ranges[key].low, ranges[key].high) if key in ranges else (-math.inf, math.inf) for key in units]
        card = (effect_id, prefix, columns, words, stage, list(needs), traits, seconds, limits if ranges else [])
        size = tuple(abs(sizes.get(key) or 1.0) for key in units)
        centred = {TEMPERATURE} & set(needs)
        asked = UserFunction(effect_id, function, names, size, ranges, seconds, axes, centred)
        _register(Written(asked, card, _running[-1] if _running else None))
        return function

    return decorate


def _check_new(effect_id: str) -> None:
    """Refuse a second effect under one id: models that name it would mean another one than before."""
    if effect_id in _registered:
        raise InputError(
            f"effect {effect_id} is defined already",
            remedy=f'Choose another name, or take the first one back: imufit.forget_effect("{effect_id}").',
        )


_FOUND = ("steps", "search_then_steps", "search")
"""How the value of a parameter is found: linear, in a range, among given values."""


def _register(written: Written) -> _imufit.Effect:
    effect_id = written.asked.effect
    made = _imufit.python_effect(*(*written.card, written.asked))
    _registered[effect_id], _written[effect_id] = made, written
    return made


def _restored(effect_id: str, written: Written) -> _imufit.Effect:
    """Return a pickled effect; the import of its function's module may have defined it already."""
    return _registered.get(effect_id) or _register(written)


def _restored_from_file(effect_id: str, file: Path) -> _imufit.Effect:
    """Return a pickled effect of a file that `load_effects` ran."""
    if effect_id not in _registered:
        run_effects(file)
    return _registered[effect_id]


def _pickled(effect: _imufit.Effect) -> tuple[Any, ...]:
    """Effects go into a pickle by their id; a user's by its file, or as it was written with its function by name."""
    if effect.id in _registered:
        written = _written[effect.id]
        if written.file is not None:
            return _restored_from_file, (effect.id, written.file)
        return _restored, (effect.id, written)
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
            f"effect {effect_id}: an effect with a column is not a constant {affine}", remedy="Leave affine out."
        )
    if stage != own_stage:
        raise InputError(f"effect {effect_id}: affine {affine} at stage {stage}", remedy=f"Use stage {own_stage}.")
    if not (parameters <= names if affine == "matrix" else parameters == names):
        wanted = "among xx, xy, ..., zz" if affine == "matrix" else "x, y, z"
        raise InputError(f"effect {effect_id}: affine {affine} has other parameters", remedy=f"Call them {wanted}.")


def _check_arguments(effect_id: str, function: Function, names: Sequence[str]) -> None:
    """Refuse a function that does not take the window and the parameters by their names."""
    try:
        inspect.signature(function).bind(None, **dict.fromkeys(names))
    except TypeError:
        raise InputError(
            f"effect {effect_id}: the function {getattr(function, '__name__', 'given')} does not take the window and "
            f"the parameters {', '.join(names)} by these names",
            remedy=f"Write def {effect_id.split('.', 1)[1]}(w, {', '.join(names)}) and return what the effect adds to "
            "the reading.",
        ) from None
    except ValueError:
        return  # a function of another language does not state its arguments


def _ranges(effect_id: str, search: Mapping[str, Sequence[float]], names: Sequence[str]) -> dict[str, SearchRange]:
    for name in search:
        if name not in names:
            raise InputError(
                f"effect {effect_id}: search names {name}, which is not a parameter",
                remedy=f"Use one of {', '.join(names)}.",
            )
    return {name: SearchRange.of(search[name], effect_id, name) for name in names if name in search}


_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}


def _seconds(effect_id: str, memory: float | str) -> float:
    """Memory in seconds from a number or a text such as ``10 s``; infinite for the whole log."""
    if memory == WHOLE_LOG:
        return math.inf
    found = re.fullmatch(r"\s*([-+.\deE]+?)\s*(ms|s|min|h)?\s*", str(memory))
    try:
        seconds = float(found[1]) * _SECONDS[found[2] or "s"] if found else float(memory)
    except (TypeError, ValueError):
        seconds = math.nan
    if not seconds >= 0.0:
        raise InputError(
            f"effect {effect_id}: memory is {memory!r}", remedy='Write seconds, such as "10 s", or "log" for all rows.'
        )
    return seconds


def run_effects(file: Path) -> None:
    """Run a Python file that defines effects.

    Parameters
    ----------
    file : Path
        The file.
    """
    _running.append(file.resolve())
    try:
        runpy.run_path(str(file))
    finally:
        _running.pop()


def id_of(effect: str | Function) -> str:
    """Return the id of an effect that is given by its id or as the function that was decorated.

    Parameters
    ----------
    effect : str or callable
        Such as ``gyr.bias``, or the function below ``@imufit.effect(...)``.

    Raises
    ------
    InputError
        The function is not that of exactly one effect.
    """
    if isinstance(effect, str):
        return effect
    ids = [key for key, written in _written.items() if written.asked.function is effect]
    if len(ids) == 1:
        return ids[0]
    shown = getattr(effect, "__name__", repr(effect))
    if ids:
        raise InputError(f"{shown} is the function of {' and '.join(ids)}", remedy="Name one of them.")
    raise InputError(f"{shown} is not an effect", remedy="Decorate the function with @imufit.effect(...).")


def written_as(effect_id: str) -> UserFunction:
    """Return the function of a user's effect, as the compiled core asks for it."""
    return _written[effect_id].asked


def registered() -> dict[str, _imufit.Effect]:
    """User-written effects by id, in the order of their definition."""
    return dict(_registered)


def forget(effect_id: str) -> None:
    """Take a user-written effect out of the catalogue again, so that its id can be defined anew.

    Parameters
    ----------
    effect_id : str
        Such as ``gyr.fan``; an undefined one is not a mistake.
    """
    _registered.pop(effect_id, None)
    _written.pop(effect_id, None)
