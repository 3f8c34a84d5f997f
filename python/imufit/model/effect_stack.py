"""A stack of effects with their parameters, and its file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from imufit import _imufit
from imufit.errors import InputError
from imufit.model.catalogue import find_effect
from imufit.model.effect import id_of
from imufit.model.limits import FREE, Limits
from imufit.model.model_file import ModelFile, is_usable, shown
from imufit.model.params import EffectParameters, ModelParams
from imufit.model.user_function import Function
from imufit.results import Parameter
from imufit.results.parameter import parameter_table
from imufit.results.result import LONGEST, shortened
from imufit.results.table import html


class EffectStack:
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
    ``model.params["gyr.scale.z"].set(...)`` and ``model["gyr.scale"].set(...)`` change the model in place, as in lmfit;
    nothing else does. The model of a fit cannot be set, since the fit is a result: take ``fit.model.copy()``.
    """

    def __init__(
        self,
        effects: Sequence[str | Function] = (),
        parameters: Mapping[str, Mapping[str, float]] | None = None,
        *,
        constants: Mapping[str, Any] | None = None,
        standard_errors: Mapping[str, Mapping[str, float]] | None = None,
        limits: Mapping[str, Mapping[str, Limits]] | None = None,
    ) -> None:
        if isinstance(effects, str):
            raise InputError(f"effects is the text {effects!r}", remedy=f"Pass a list: [{effects!r}].")
        ids = [id_of(effect) for effect in effects]
        for effect_id in ids:
            if ids.count(effect_id) > 1:
                raise InputError(f"effect {effect_id} stands in the model twice", remedy="Name it once.")
        self._effects = {effect_id: find_effect(effect_id) for effect_id in ids}
        given = parameters or {}
        for effect_id in given:
            if effect_id not in self._effects:
                raise InputError(f"parameters are given for {effect_id}, which is not in the model")
        self._values = {key: _values(effect, given.get(key, {})) for key, effect in self._effects.items()}
        self.constants: dict[str, Any] = dict(constants or {})
        self.standard_errors = {key: dict(values) for key, values in (standard_errors or {}).items()}
        self._limits = {key: dict(of) for key, of in (limits or {}).items() if key in self._effects}
        self._of_a_fit = False
        for key, of in self._limits.items():
            for name, limit in of.items():
                self._check_within(key, name, limit)

    def _check_within(self, effect_id: str, name: str, limit: Limits) -> None:
        present = self.parameters[effect_id]
        if name not in present:
            raise InputError(f"{effect_id} has no parameter {name}", remedy=f"It has {', '.join(present)}.")
        if limit.within(present[name]) != present[name]:
            raise InputError(
                f"{effect_id}.{name} is {present[name]:g}, outside of {limit.lower:g} to {limit.upper:g}",
                remedy="Correct the value or its bounds.",
            )

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects."""
        return tuple(self._effects)

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Values by effect and parameter, SI units."""
        return {
            key: dict(zip((p[0] for p in effect.parameters), self._values[key], strict=True))
            for key, effect in self._effects.items()
        }

    @property
    def limits(self) -> dict[str, dict[str, Limits]]:
        """Limits of the parameters that are fixed or have bounds, by effect and parameter."""
        return {key: dict(of) for key, of in self._limits.items()}

    @property
    def params(self) -> ModelParams:
        """Parameters by ``EFFECT.PARAM``: ``model.params["gyr.scale.z"].set(value=0.01, vary=False)``."""
        return ModelParams(self)

    def limits_of(self, effect_id: str) -> list[Limits]:
        """Return the limits of every parameter of an effect, in order.

        Parameters
        ----------
        effect_id : str
            An effect of the model.
        """
        of = self._limits.get(effect_id, {})
        return [of.get(name, FREE) for name, _, _ in self._effects[effect_id].parameters]

    def adjust(
        self,
        effect_id: str,
        name: str,
        *,
        value: float | None = None,
        vary: bool | None = None,
        lower: float | None = None,
        upper: float | None = None,
    ) -> None:
        """Change one parameter in place; see :meth:`imufit.model.params.ModelParameter.set`.

        Parameters
        ----------
        effect_id, name : str
            The parameter.
        value, vary, lower, upper
            What is to be changed; None stays.

        Raises
        ------
        InputError
            The model belongs to a fit, or something cannot be set.
        """
        key = f"{effect_id}.{name}"
        if self._of_a_fit:
            raise InputError(
                f"{key} cannot be set: the model belongs to a fit, which is a result",
                remedy="Take a copy: model = fit.model.copy().",
            )
        known = self._limits.get(effect_id, {}).get(name, FREE)
        limits = Limits(
            known.fixed if vary is None else not vary,
            known.lower if lower is None else lower,
            known.upper if upper is None else upper,
        )
        limits.check(key)
        names = list(self.parameters[effect_id])
        if value is not None:
            value = _values(self._effects[effect_id], {name: value})[names.index(name)]
            if limits.within(value) != value:
                raise InputError(
                    f"{key} is to be {value:g}, outside of {limits.lower:g} to {limits.upper:g}",
                    remedy="Give a value between its bounds, or other bounds.",
                )
        at = self._values[effect_id]
        before = at[names.index(name)]
        at[names.index(name)] = limits.within(before) if value is None else value
        self._limits.setdefault(effect_id, {})[name] = limits
        if limits == FREE:
            del self._limits[effect_id][name]
        if not self._limits[effect_id]:
            del self._limits[effect_id]
        # The error of an earlier fit is not informative about another value; a given value has none.
        if limits.fixed or at[names.index(name)] != before or known.fixed:
            errors = self.standard_errors.get(effect_id)
            if errors is not None:
                errors[name] = 0.0 if limits.fixed else math.nan

    def copy(self) -> Self:
        """Return the same model, to be changed on its own; the copy of a fit's model can be set."""
        return type(self)(
            self.effects,
            self.parameters,
            constants=self.constants,
            standard_errors=self.standard_errors,
            limits=self._limits,
        )

    def __copy__(self) -> Self:
        return self.copy()

    def of_a_fit(self) -> Self:
        """Return a copy that cannot be set."""
        model = self.copy()
        model._of_a_fit = True
        return model

    def __getitem__(self, effect_id: str) -> EffectParameters:
        """Return the parameters of one effect, ``model["gyr.scale"].set(z=0.01, fixed=True)``.

        Parameters
        ----------
        effect_id : str
            An effect of the model.

        Raises
        ------
        KeyError
            The model does not have it.
        """
        if effect_id not in self._effects:
            raise KeyError(f"the model has no effect {effect_id!r}; it has {', '.join(self.effects) or 'none'}")
        return EffectParameters(self, effect_id)

    def __iter__(self) -> Iterator[str]:
        return iter(self.effects)

    def __contains__(self, effect_id: object) -> bool:
        return effect_id in self._effects

    def stack(self) -> list[tuple[_imufit.Effect, list[float]]]:
        """Effects with their parameter values in order, as the compiled core takes them."""
        return [(effect, list(self._values[key])) for key, effect in self._effects.items()]

    def listed(self) -> tuple[Parameter, ...]:
        """Every parameter with its standard error, unit and typical size."""
        return tuple(
            Parameter(
                key,
                name,
                value,
                0.0 if limits.fixed else self.standard_errors.get(key, {}).get(name, math.nan),
                unit,
                typical,
                limits.fixed,
                limits.lower,
                limits.upper,
            )
            for key, effect in self._effects.items()
            for (name, unit, typical), value, limits in zip(
                effect.parameters, self._values[key], self.limits_of(key), strict=True
            )
        )

    def with_effect(self, effect: str | Function) -> Self:
        """Return the same model with one more effect, its parameters zero.

        Parameters
        ----------
        effect : str or callable
            Id such as ``gyr.g_sensitivity``, or the function of an effect of your own.

        Raises
        ------
        InputError
            The effect is unknown or in the model already.
        """
        effect_id = id_of(effect)
        if effect_id in self._effects:
            raise InputError(f"effect {effect_id} is in the model already", remedy="Nothing needs to be added.")
        return type(self)([*self.effects, effect_id], self.parameters, constants=self.constants, limits=self._limits)

    def without_effect(self, effect_id: str) -> Self:
        """Return the same model with one effect less, the others with their values.

        Parameters
        ----------
        effect_id : str
            An effect of the model.
        """
        kept = [key for key in self.effects if key != effect_id]
        parameters = {key: values for key, values in self.parameters.items() if key != effect_id}
        return type(self)(kept, parameters, constants=self.constants, limits=self._limits)

    def starting_at(self, values: Mapping[str, list[float]]) -> Self:
        """Return the same model with other values of some effects, to start a fit from; what is fixed stays.

        Parameters
        ----------
        values : mapping of str to list of float
            By effect, one value for each of its parameters, SI units. One outside of its bounds moves to them.
        """
        if not values:
            return self
        named = {
            key: dict(zip(self.parameters[key], self.allowed(key, given), strict=True)) for key, given in values.items()
        }
        return type(self)(
            self.effects,
            self.parameters | named,
            constants=self.constants,
            standard_errors=self.standard_errors,
            limits=self._limits,
        )

    def allowed(self, effect_id: str, values: Sequence[float]) -> list[float]:
        """Return values of an effect as its limits allow them: fixed ones as they are, others within their bounds.

        Parameters
        ----------
        effect_id : str
            An effect of the model.
        values : sequence of float
            One for each of its parameters.
        """
        return [
            present if limits.fixed else limits.within(float(value))
            for present, value, limits in zip(self._values[effect_id], values, self.limits_of(effect_id), strict=True)
        ]

    def save(self, path: str | Path) -> None:
        """Write the model as a TOML file.

        Parameters
        ----------
        path : str or Path
            The file; one that exists is replaced. It is written whole or not at all.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        ModelFile(list(self.effects), self.parameters, self.constants, self.standard_errors, limits=self._limits).write(
            path
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a model from its TOML file.

        Parameters
        ----------
        path : str or Path
            A file that :meth:`save` wrote, or one written by hand in its form.

        Raises
        ------
        InputError
            The file is missing, cut off, no model, of a later format, lacks a parameter, or has a wrong unit or
            parameter.
        """
        held = ModelFile.read(path)
        try:
            model = cls(
                held.effects,
                held.parameters,
                constants=held.constants,
                standard_errors=held.standard_errors,
                limits=held.limits,
            )
            held.check_complete()
        except InputError as error:
            raise InputError(error.problem, file=path, remedy=error.advice) from None
        return model

    def _repr_html_(self) -> str:
        return html([repr(self)], [parameter_table(self.listed())])

    def __repr__(self) -> str:
        return shortened(f"{type(self).__name__}([{', '.join(map(repr, self.effects))}])", LONGEST)


def _values(effect: _imufit.Effect, given: Mapping[str, float]) -> list[float]:
    names = [name for name, _, _ in effect.parameters]
    for name, value in given.items():
        if name not in names:
            raise InputError(f"{effect.id} has no parameter {name}", remedy=f"It has {', '.join(names)}.")
        if not is_usable(value):
            raise InputError(
                f"{effect.id} {name} is {shown(value)}, not a finite number", remedy="Write a number in SI units."
            )
    return [float(given.get(name, 0.0)) for name in names]
