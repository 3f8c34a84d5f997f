"""A stack of effects with their parameters, and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import tomli_w

from imufit import _imufit
from imufit.errors import InputError
from imufit.log.columns import LARGEST_COVARIATE
from imufit.log.documents import table_from_toml
from imufit.model.catalogue import find_effect
from imufit.printable import NAME, printable
from imufit.results import Parameter

KIND = "imufit sensor model"
FORMAT = 1
_NUMBER = "Write a number in SI units."


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
            The file; one that exists is replaced.
        """
        document: dict[str, Any] = {"kind": KIND, "format": FORMAT, "effects": list(self.effects)}
        if self.constants:
            document["constants"] = self.constants
        document["parameters"] = self.parameters
        document["units"] = {
            key: {name: unit for name, unit, _ in effect.parameters} for key, effect in self._effects.items()
        }
        if self.standard_errors:
            document["standard_errors"] = self.standard_errors
        Path(path).write_bytes(tomli_w.dumps(document).encode())

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
            The file is missing, no model, of a later format, or has a wrong unit or parameter.
        """
        file = Path(path)
        try:
            document = table_from_toml(file, "Correct it: as it stands it is no TOML, so no model.")
        except OSError as error:
            raise InputError(
                f"the model cannot be read ({error.strerror})", file=file, remedy="Check the name."
            ) from None
        if document.get("kind") != KIND:
            raise InputError(f'the key kind is {document.get("kind")!r}, not "{KIND}"', file=file)
        if document.get("format") != FORMAT:
            raise InputError(f"format {document.get('format')!r} is not known", file=file, remedy="Update imufit.")
        try:
            return cls._from_document(document)
        except InputError as error:
            raise InputError(error.problem, file=file, remedy=error.remedy) from None

    @classmethod
    def _from_document(cls, document: Mapping[str, Any]) -> Self:
        """Check every value that the file of a model may hold, and make the model."""
        effects = document.get("effects", [])
        if not isinstance(effects, list) or not all(isinstance(key, str) for key in effects):
            raise InputError("effects is no list of names", remedy='Write for example effects = ["gyr.bias"].')
        errors, constants = _table(document, "standard_errors"), _table(document, "constants")
        for key in errors:
            for name, error in _table(errors, key, "standard_errors.").items():
                if isinstance(error, bool) or not isinstance(error, int | float):
                    raise InputError(f"standard_errors.{key}.{name} is {_shown(error)}, not a number", remedy=_NUMBER)
        means = _table(constants, "covariate_means", "constants.")
        means["the temperature"] = constants.get("temperature_mean", 0.0)
        for name, mean in means.items():
            if not _is_usable(mean):
                raise InputError(
                    f"constants: the mean of {name} is {_shown(mean)}, not a finite number", remedy=_NUMBER
                )
        parameters = _table(document, "parameters")
        model = cls(
            effects,
            {key: _table(parameters, key, "parameters.") for key in parameters},
            constants=constants,
            standard_errors=errors,
        )
        all_units = _table(document, "units")
        for key in all_units:
            units = _table(all_units, key, "units.")
            for name, unit, _ in find_effect(key).parameters:
                if units.get(name, unit) != unit:
                    raise InputError(
                        f"{key} {name} is in {printable(str(units[name]), NAME)}, not in {unit}",
                        remedy="Convert the value.",
                    )
        return model

    def __repr__(self) -> str:
        return f"{type(self).__name__}([{', '.join(map(repr, self.effects))}])"


def _table(holder: Mapping[str, Any], key: str, of: str = "") -> dict[str, Any]:
    """Return a table of the file; empty where it is not there."""
    table = holder.get(key, {})
    if not isinstance(table, Mapping):
        raise InputError(f"{of}{key} is {_shown(table)}, not a table", remedy=f"Write [{of}{key}] above its values.")
    return dict(table)


def _shown(value: Any) -> str:
    return printable(repr(value), NAME)


def _is_usable(value: Any) -> bool:
    """Whether something is a number that can be worked with."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_COVARIATE


def _values(effect: _imufit.Effect, given: Mapping[str, float]) -> list[float]:
    names = [name for name, _, _ in effect.parameters]
    for name, value in given.items():
        if name not in names:
            raise InputError(f"{effect.id} has no parameter {name}", remedy=f"It has {', '.join(names)}.")
        if not _is_usable(value):
            raise InputError(f"{effect.id} {name} is {_shown(value)}, not a finite number", remedy=_NUMBER)
    return [float(given.get(name, 0.0)) for name in names]
