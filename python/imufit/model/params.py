"""Parameters of a model by their names, which can be set, fixed and bounded there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Protocol, Self

from imufit.errors import InputError
from imufit.results.parameter import Parameter, parameter_table
from imufit.results.params import Params


class Adjustable(Protocol):
    """A model whose parameters can be set."""

    @property
    def params(self) -> ModelParams:
        """Parameters by ``EFFECT.PARAM``."""

    @property
    def parameters(self) -> Mapping[str, Mapping[str, float]]:
        """Values by effect and parameter, SI units."""

    def listed(self) -> tuple[Parameter, ...]:
        """Every parameter with its standard error, unit and typical size."""

    def copy(self) -> Self:
        """Return a model of its own with the same values."""

    def adjust(
        self,
        effect_id: str,
        name: str,
        *,
        value: float | None,
        vary: bool | None,
        lower: float | None,
        upper: float | None,
    ) -> None:
        """Change one parameter in place."""


@dataclass(frozen=True)
class ModelParameter(Parameter):
    """One parameter of a model; :meth:`set` changes the model.

    Attributes
    ----------
    model : Adjustable
        The model that it belongs to.
    """

    model: Adjustable | None = field(default=None, repr=False, compare=False)

    def set(
        self,
        value: float | None = None,
        *,
        vary: bool | None = None,
        min: float | None = None,
        max: float | None = None,
        fixed: bool | None = None,
    ) -> None:
        """Change the value, whether fits move it, and its bounds, in place; what is not given stays.

        Parameters
        ----------
        value : float, optional
            Value where it is fixed, start of a fit where it is not; SI unit.
        vary : bool, optional
            False: fits leave it as it is, and its standard error is 0.
        min, max : float, optional
            Smallest and largest value; ``-inf`` and ``inf`` take a bound away. A value outside moves to the bound.
        fixed : bool, optional
            The opposite of `vary`.

        Raises
        ------
        InputError
            The model belongs to a fit, a value is not a number, or the bounds leave nothing between them.
        """
        if self.model is None:
            raise InputError(f"parameter {self.key} belongs to no model", remedy="Take it from model.params.")
        self.model.adjust(self.effect, self.name, value=value, vary=_varies(vary, fixed), lower=min, upper=max)
        # Who holds the parameter sees what was set.
        now = self.model.params[self.key]
        for item in fields(Parameter):
            object.__setattr__(self, item.name, getattr(now, item.name))


class ModelParams(Params):
    """Parameters of a model by ``EFFECT.PARAM``, as they are whenever they are requested.

    Parameters
    ----------
    model : Adjustable
        The model.
    """

    def __init__(self, model: Adjustable) -> None:
        self._model = model

    def __getitem__(self, key: str) -> ModelParameter:
        """Return one parameter.

        Parameters
        ----------
        key : str
            Such as ``acc.bias.x``.

        Raises
        ------
        KeyError
            The parameter is unknown.
        """
        plain = super().__getitem__(key)
        return ModelParameter(**{item.name: getattr(plain, item.name) for item in fields(Parameter)}, model=self._model)

    def _known(self) -> dict[str, Parameter]:
        return {parameter.key: parameter for parameter in self._model.listed()}


class EffectParameters(Mapping[str, ModelParameter]):
    """Parameters of one effect of a model by their names, such as ``model["gyr.scale"]["x"]``.

    Parameters
    ----------
    model : Adjustable
        The model.
    effect : str
        One of its effects.
    """

    def __init__(self, model: Adjustable, effect: str) -> None:
        self._model = model
        self._effect = effect

    def __getitem__(self, name: str) -> ModelParameter:
        """Return one parameter.

        Parameters
        ----------
        name : str
            Such as ``x``.
        """
        return self._model.params[f"{self._effect}.{name}"]

    def __iter__(self) -> Iterator[str]:
        return iter(self._model.parameters[self._effect])

    def __len__(self) -> int:
        return len(self._model.parameters[self._effect])

    def set(
        self,
        *,
        vary: bool | None = None,
        min: float | None = None,
        max: float | None = None,
        fixed: bool | None = None,
        **values: float | tuple[float | None, ...],
    ) -> None:
        """Change parameters of the effect in place: ``set(z=0.01, fixed=True)``, ``set(x=(None, -0.05, 0.05))``.

        Parameters
        ----------
        vary, min, max, fixed
            As for one parameter, see :meth:`ModelParameter.set`. They hold for the parameters that are named, and for
            all of the effect where none is.
        **values : float or tuple
            By the name of a parameter its value, or (value, min, max), each None where it stays.

        Raises
        ------
        InputError
            A parameter is unknown, or something cannot be set.
        """
        known = list(self)
        for name in values:
            if name not in known:
                raise InputError(f"{self._effect} has no parameter {name}", remedy=f"It has {', '.join(known)}.")
        copy = self._model.copy()
        # All or nothing: what cannot be set must not leave half of it behind.
        for model in (copy, self._model):
            for name in values or known:
                value, lower, upper = _parts(f"{self._effect}.{name}", values.get(name))
                model.adjust(
                    self._effect,
                    name,
                    value=value,
                    vary=_varies(vary, fixed),
                    lower=min if lower is None else lower,
                    upper=max if upper is None else upper,
                )

    def _repr_html_(self) -> str:
        return parameter_table(self.values()).html()

    def __str__(self) -> str:
        return str(parameter_table(self.values()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._effect!r}, [{', '.join(self)}])"


def _varies(vary: bool | None, fixed: bool | None) -> bool | None:
    if vary is not None and fixed is not None and vary == fixed:
        raise InputError(f"vary is {vary} and fixed is {fixed}", remedy="Give one of them: they are opposites.")
    return vary if fixed is None else not fixed


def _parts(key: str, given: Any) -> tuple[Any, Any, Any]:
    """Take what is given for one parameter apart: value, smallest, largest."""
    if not isinstance(given, tuple | list):
        return given, None, None
    if len(given) != 3:
        raise InputError(f"{key} is given {len(given)} numbers", remedy="Give a value, or (value, min, max).")
    return given[0], given[1], given[2]
