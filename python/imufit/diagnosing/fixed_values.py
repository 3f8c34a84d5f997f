"""Fixed values of a model that its logs contradict."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from imufit.results import Parameter
from imufit.results.parameter import FAR

if TYPE_CHECKING:
    from imufit.fitting import FittedStack


def contradicted(fit: FittedStack) -> Iterator[tuple[Parameter, Parameter]]:
    """Return each fixed value that the logs contradict, and the value that they give in its place, to first order.

    Parameters
    ----------
    fit : FittedStack
        The model and the evidence of its logs.
    """
    fixed = {parameter.key: parameter for parameter in fit.parameters if parameter.fixed}
    if not fixed:
        return
    free = fit.analysis.freed()
    model, _ = free.moved_to(free.estimate())
    for found in model.listed():
        held = fixed.get(found.key)
        if held is not None and abs(found.value - held.value) > FAR * found.standard_error > 0.0:
            yield held, found
