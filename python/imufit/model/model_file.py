"""The file of a model: what stands in it, and that nothing is missing from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from imufit.errors import InputError
from imufit.log.columns import LARGEST_COVARIATE
from imufit.model.catalogue import find_effect, units_of
from imufit.model.limits import Limits
from imufit.printable import NAME, printable
from imufit.whole_toml import HOW_TO_END, read_toml, write_toml

KIND = "imufit sensor model"
FORMAT = 1


@dataclass(frozen=True)
class ModelFile:
    """The content of the file of a model.

    Attributes
    ----------
    effects : list of str
        Ids of the effects.
    parameters : dict of str to dict of str to float
        Every parameter of every effect, SI units.
    constants : dict
        Means that effects count from, see `imufit.model.EffectStack`.
    standard_errors : dict of str to dict of str to float
        As far as they are known, SI units.
    units : dict of str to dict of str to str
        Units that the file states.
    limits : dict of str to dict of str to Limits
        Parameters that are fixed or have bounds. They stand before the parameters, so that a file that is cut off
        cannot lose them alone; versions that do not know the key read the rest.
    marked : bool
        Whether it ends in the mark of `imufit.whole_toml`.
    """

    effects: list[str]
    parameters: dict[str, dict[str, float]]
    constants: dict[str, Any] = field(default_factory=dict)
    standard_errors: dict[str, dict[str, float]] = field(default_factory=dict)
    units: dict[str, dict[str, str]] = field(default_factory=dict)
    marked: bool = True
    limits: dict[str, dict[str, Limits]] = field(default_factory=dict)

    def write(self, path: str | Path) -> None:
        """Write the file, whole or not at all.

        Parameters
        ----------
        path : str or Path
            The file; one that exists is replaced.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        document: dict[str, Any] = {"kind": KIND, "format": FORMAT, "effects": self.effects}
        if self.constants:
            document["constants"] = self.constants
        if self.limits:
            document["limits"] = {
                key: {name: limits.to_dict() for name, limits in of_effect.items()}
                for key, of_effect in self.limits.items()
            }
        document["parameters"] = self.parameters
        document["units"] = {key: units_of(key) for key in self.effects}
        if self.standard_errors:
            document["standard_errors"] = self.standard_errors
        write_toml(path, document)

    @classmethod
    def read(cls, path: str | Path) -> ModelFile:
        """Read a model's file.

        Parameters
        ----------
        path : str or Path
            A file that :meth:`write` wrote, or one written or changed by hand in its form.

        Raises
        ------
        InputError
            The file is missing, cut off, not a model, of a later format, or something in it is not a table or number.
        """
        file = Path(path)
        document, marked = read_toml(file, "the model")
        if document.get("kind") != KIND:
            raise InputError(f'the key kind is {document.get("kind")!r}, not "{KIND}"', file=file)
        if document.get("format") != FORMAT:
            raise InputError(f"format {document.get('format')!r} is not known", file=file, remedy="Update imufit.")
        effects = document.get("effects")
        if not isinstance(effects, list) or not all(isinstance(key, str) for key in effects):
            raise InputError(
                "the key effects is not a list of names", file=file, remedy='Write effects = ["gyr.bias"].'
            )
        try:
            return cls(
                effects,
                _tables(document.get("parameters", {}), "parameters"),
                _constants(document.get("constants", {})),
                _standard_errors(document.get("standard_errors", {})),
                _tables(document.get("units", {}), "units"),
                marked,
                _limits(document.get("limits", {})),
            )
        except InputError as error:
            raise InputError(error.problem, file=file, remedy=error.advice) from None

    def check_complete(self) -> None:
        """Refuse a model of which something is missing, or may be missing, and one in other units.

        Raises
        ------
        InputError
            Names it.
        """
        for key in self.effects:
            for name, unit in units_of(key).items():
                if name not in self.parameters.get(key, {}):
                    raise InputError(
                        f"parameter {name} of {key} is missing",
                        remedy=f"Is the file cut off? Otherwise write {name} = VALUE in {unit} below its effect.",
                    )
                given = self.units.get(key, {}).get(name, unit)
                if given != unit:
                    raise InputError(f"{key} {name} is in {given}, not in {unit}", remedy="Convert the value.")
        if not self.marked:
            self._check_nothing_is_cut()

    def _check_nothing_is_cut(self) -> None:
        """Refuse a file without a mark where something that belongs to the model may have stood behind its end."""
        for words, table in (("units", self.units), ("standard errors", self.standard_errors)):
            for key in self.effects if table else ():
                if units_of(key).keys() != table.get(key, {}).keys():
                    raise InputError(f"{words} of {key} are not complete: is the file cut off?", remedy=HOW_TO_END)
        known = set(self.constants.get("covariate_means", {}))
        known |= {"temp"} if "temperature_mean" in self.constants else set()
        for effect in map(find_effect, self.effects):
            for column in set(effect.centred_columns) - known:
                raise InputError(
                    f"constants do not hold the mean of {column}, which {effect.id} counts from: is the file cut off?",
                    remedy=HOW_TO_END,
                )


def is_usable(value: Any) -> bool:
    """Whether something is a number that can be worked with."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_COVARIATE


def shown(value: Any) -> str:
    """Return what a file holds, printable and not too long for a message."""
    return printable(repr(value), NAME)


def _table(value: Any, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{name} is {shown(value)}, not a table", remedy=f"Write [{name}] above what belongs to it.")
    return value


def _tables(value: Any, name: str) -> dict[str, dict[str, Any]]:
    return {key: _table(item, f'{name}."{key}"') for key, item in _table(value, name).items()}


def _constants(value: Any) -> dict[str, Any]:
    constants = dict(_table(value, "constants"))
    if "temperature_mean" in constants:
        _check_mean(constants["temperature_mean"], "the temperature")
    for name, mean in _table(constants.get("covariate_means", {}), "constants.covariate_means").items():
        _check_mean(mean, name)
    return constants


def _standard_errors(value: Any) -> dict[str, dict[str, float]]:
    errors = _tables(value, "standard_errors")
    for key, numbers in errors.items():
        for name, number in numbers.items():
            # One that could not be computed is not a number, and stays so.
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise InputError(f"the standard error of {key} {name} is {shown(number)}, not a number")
            if number < 0.0:
                raise InputError(f"the standard error of {key} {name} is {shown(number)}, which is negative")
    return errors


def _limits(value: Any) -> dict[str, dict[str, Limits]]:
    return {
        key: {
            name: Limits.of(_table(table, f'limits."{key}".{name}'), f"{key}.{name}") for name, table in tables.items()
        }
        for key, tables in _tables(value, "limits").items()
    }


def _check_mean(value: Any, name: str) -> None:
    if not is_usable(value):
        raise InputError(f"constants: the mean of {name} is {shown(value)}, not a finite number")
