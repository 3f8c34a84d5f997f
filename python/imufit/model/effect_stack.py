"""A stack of effects with their parameters, and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from imufit import _imufit
from imufit.errors import InputError
from imufit.model.catalogue import find_effect
from imufit.model.model_file import ModelFile, is_usable, shown
from imufit.results import Parameter
from imufit.results.parameter import parameter_table
from imufit.results.result import LONGEST, shortened
from imufit.results.table import html


class EffectStack:
    """A stack of named effects on top of the ideal readings; no effect = the ideal sensor.

    Parameters
    ----------
    effects : sequence of str
        Ids such as ``gyr.bias``, each once. The order does not matter: effects act in the order of their physics.
    parameters : mapping of str to mapping of str to float, optional
        Values by effect and parameter, SI units; zero where not given.
    constants : mapping, optional
        ``temperature_mean`` (degC) and ``covariate_means`` (by name) of the log that the model was fitted on.
    standard_errors : mapping, optional
        Standard errors in the shape of `parameters`.

    Raises
    ------
    InputError
        An effect or a parameter is unknown, or an effect stands there twice.
    """

    def __init__(
        self,
        effects: Sequence[str] = (),
        parameters: Mapping[str, Mapping[str, float]] | None = None,
        *,
        constants: Mapping[str, Any] | None = None,
        standard_errors: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        if isinstance(effects, str):
            raise InputError(f"effects is the text {effects!r}", remedy=f"Pass a list: [{effects!r}].")
        for effect_id in effects:
            if list(effects).count(effect_id) > 1:
                raise InputError(f"effect {effect_id} stands in the model twice", remedy="Name it once.")
        self._effects = {effect_id: find_effect(effect_id) for effect_id in effects}
        given = parameters or {}
        for effect_id in given:
            if effect_id not in self._effects:
                raise InputError(f"parameters are given for {effect_id}, which is not in the model")
        self._values = {key: _values(effect, given.get(key, {})) for key, effect in self._effects.items()}
        self.constants: dict[str, Any] = dict(constants or {})
        self.standard_errors = {key: dict(values) for key, values in (standard_errors or {}).items()}

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

    def stack(self) -> list[tuple[_imufit.Effect, list[float]]]:
        """Effects with their parameter values in order, as the compiled core takes them."""
        return [(effect, list(self._values[key])) for key, effect in self._effects.items()]

    def listed(self) -> tuple[Parameter, ...]:
        """Every parameter with its standard error, unit and typical size."""
        return tuple(
            Parameter(key, name, value, self.standard_errors.get(key, {}).get(name, float("nan")), unit, typical)
            for key, effect in self._effects.items()
            for (name, unit, typical), value in zip(effect.parameters, self._values[key], strict=True)
        )

    def with_effect(self, effect_id: str) -> Self:
        """Return the same model with one more effect, its parameters zero.

        Parameters
        ----------
        effect_id : str
            Id such as ``gyr.g_sensitivity``.

        Raises
        ------
        InputError
            The effect is unknown or in the model already.
        """
        if effect_id in self._effects:
            raise InputError(f"effect {effect_id} is in the model already", remedy="Nothing needs to be added.")
        return type(self)([*self.effects, effect_id], self.parameters, constants=self.constants)

    def without_effect(self, effect_id: str) -> Self:
        """Return the same model with one effect less, the others with their values.

        Parameters
        ----------
        effect_id : str
            An effect of the model.
        """
        kept = [key for key in self.effects if key != effect_id]
        parameters = {key: values for key, values in self.parameters.items() if key != effect_id}
        return type(self)(kept, parameters, constants=self.constants)

    def starting_at(self, values: Mapping[str, list[float]]) -> Self:
        """Return the same model with other values of some effects, to start a fit from.

        Parameters
        ----------
        values : mapping of str to list of float
            By effect, one value for each of its parameters, SI units.
        """
        if not values:
            return self
        named = {
            key: dict(zip((name for name, _, _ in self._effects[key].parameters), given, strict=True))
            for key, given in values.items()
        }
        return type(self)(
            self.effects, self.parameters | named, constants=self.constants, standard_errors=self.standard_errors
        )

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
        ModelFile(list(self.effects), self.parameters, self.constants, self.standard_errors).write(path)

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
            model = cls(held.effects, held.parameters, constants=held.constants, standard_errors=held.standard_errors)
            held.check_complete()
        except InputError as error:
            raise InputError(error.problem, file=path, remedy=error.remedy) from None
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
