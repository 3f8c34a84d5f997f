"""Parameters by their names, as a mapping."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from imufit.errors import InputError
from imufit.results.parameter import Parameter, by_effect, drawn_parameters, parameter_frame, parameter_table
from imufit.results.plotted import Plotted
from imufit.results.result import LONGEST, shortened

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place


class Params(Plotted, Mapping[str, Parameter]):
    """Parameters by ``EFFECT.PARAM``, such as ``params["acc.bias.x"]``, in the order of the model.

    Parameters
    ----------
    parameters : iterable of Parameter
        The parameters.
    """

    def __init__(self, parameters: Iterable[Parameter]) -> None:
        self._held = {parameter.key: parameter for parameter in parameters}

    def _known(self) -> dict[str, Parameter]:
        return self._held

    def __getitem__(self, key: str) -> Parameter:
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
        known = self._known()
        if key not in known:
            near = [other for other in known if other.startswith(f"{key}.")] or list(known)
            raise KeyError(f"unknown parameter {key!r}; the parameters are {', '.join(near) or 'none'}")
        return known[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())

    def to_dict(self) -> dict[str, dict[str, dict[str, Any]]]:
        """JSON of the parameters by effect and name."""
        return by_effect(self.values())

    def to_dataframe(self) -> pd.DataFrame:
        """One row per parameter, SI units."""
        return parameter_frame(self.values())

    def valuesdict(self) -> dict[str, float]:
        """Values by ``EFFECT.PARAM``, SI units."""
        return {key: parameter.value for key, parameter in self.items()}

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw the parameters beside their typical sizes."""
        if not self:
            raise InputError("parameters to draw are missing", remedy="Take a model with at least one effect.")
        return drawn_parameters(tuple(self.values()), ax)

    def _repr_html_(self) -> str:
        return parameter_table(self.values()).html()

    def __str__(self) -> str:
        return str(parameter_table(self.values()))

    def __repr__(self) -> str:
        return shortened(f"{type(self).__name__}([{', '.join(map(repr, self))}])", LONGEST)
