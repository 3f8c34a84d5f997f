"""Two models fitted to one log, held against each other."""

from __future__ import annotations

from imufit.comparing.compare import compare
from imufit.errors import InputError
from imufit.fitting.fitted_stack import FittedStack
from imufit.progress import Progress
from imufit.results import ModelComparison


def compare_two(first: FittedStack, second: FittedStack, progress: Progress) -> ModelComparison:
    """Hold two fits of the same log against each other.

    Parameters
    ----------
    first, second : FittedStack
        Fitted to the same log.
    progress : callable
        Called with (rows done, rows in all, what is being done).

    Raises
    ------
    InputError
        They were fitted to different logs.
    """
    gain = ln_bayes_factor(first, second)
    return ModelComparison(
        compare(first, None, progress), compare(second, None, progress), first.ratio, second.ratio, gain
    )


def ln_bayes_factor(first: FittedStack, second: FittedStack) -> float:
    """Return the natural logarithm of the evidence for the second of two fits over that for the first.

    Parameters
    ----------
    first, second : FittedStack
        Fitted to the same log.

    Raises
    ------
    InputError
        They were fitted to different logs.
    """
    if first.logs != second.logs:
        raise InputError("the two models were fitted to different logs", remedy="Fit both to the same log.")
    analysis = first.analysis
    return float(
        analysis.ln_likelihood(second.analysis, second.estimate) - analysis.ln_likelihood(analysis, first.estimate)
    )
