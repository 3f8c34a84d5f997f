"""One log with its truth, as the independent simulator hands it to a judge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

VERDICTS = frozenset({"adequate", "missing", "ambiguous", "unknown"})


@dataclass(frozen=True)
class Case:
    """A log, what is physically in it, and which answers are right.

    Attributes
    ----------
    name
        Kind and seed.
    frame
        The log, with the columns of the public contract.
    metadata
        The log's metadata: ``frame``, ``gravity``, ``mag_reference``, ``noise``, ``rig_axis``.
    effects
        Effect id to the true parameters that act in the log. Names beyond those of the contract
        (``cutoff_hz``, ``order``, ``interval``) describe the instrument that caused the effect.
    may_name
        Effect ids that are a right or a harmless name. Any other name is false.
    verdicts
        Verdicts that are right.
    seconds
        Duration of the log.
    """

    name: str
    frame: pd.DataFrame
    metadata: dict[str, Any]
    effects: dict[str, dict[str, float]]
    may_name: frozenset[str]
    verdicts: frozenset[str]
    seconds: float

    def false_names(self, named: set[str] | frozenset[str]) -> frozenset[str]:
        """Return the names that are neither right nor harmless."""
        return frozenset(named) - self.may_name
