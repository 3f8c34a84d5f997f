"""Marks of many blind logs: counts, shares with their intervals, errors against the true noise."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imufit.lab.grade.sets import SETS
from imufit.lab.grade.trial import Trial
from imufit.lab.grade.wilson import interval
from imufit.results import Table
from imufit.results.part import Part

MARKS = ("named", "wrong", "missed", "alarm", "single", "needless", "covariate")
WITHIN = 0.10
"""Share of itself by which an expected drop may differ from the realised one to count as predicted."""


@dataclass(frozen=True, repr=False)
class BlindGrade(Part):
    """Marks of many blind logs.

    Attributes
    ----------
    trials : tuple of Trial
        Every log.
    """

    trials: tuple[Trial, ...]

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> BlindGrade:
        """Return the grade of a `to_dict`, also after JSON.

        Parameters
        ----------
        data : mapping
            Of `to_dict`.
        """
        return cls(tuple(Trial.from_dict(each) for each in data["trials"]))

    def of(self, blind_set: str) -> tuple[Trial, ...]:
        """Return the trials of one set.

        Parameters
        ----------
        blind_set : str
            Of `SETS`.
        """
        return tuple(trial for trial in self.trials if trial.blind_set == blind_set)

    @property
    def failures(self) -> tuple[Trial, ...]:
        """Trials with anything wrong in them."""
        return tuple(trial for trial in self.trials if trial.marks.faults)

    def rows(self) -> list[dict[str, Any]]:
        """One row per set: how many logs, and for each mark requested the count, of how many, share and interval."""
        return [
            {"set": name, "logs": len(trials), **counts(trials), **figures(trials)}
            for name in SETS
            if (trials := self.of(name))
        ]

    def to_dict(self) -> dict[str, Any]:
        """JSON: the table, the same figures of all logs together, and every trial."""
        return {
            "table": self.rows(),
            "all": figures(self.trials) if self.trials else {},
            "trials": [trial.to_dict() for trial in self.trials],
        }

    def tables(self) -> tuple[Table, ...]:
        """Return the marks, and how near the end of the ladder is to the noise, as a person reads them."""
        rows = self.rows()
        asked = [mark for mark in MARKS if any(mark in row for row in rows)]
        marks = tuple((row["set"], f"{row['logs']}", *(_share(row.get(mark)) for mark in asked)) for row in rows)
        end = tuple(
            (
                row["set"],
                _ratio(row["true_ratio_median"]),
                _ratio(row["true_ratio_worst"]),
                _share(row.get("coverage")),
                _share(row.get("foretold")),
            )
            for row in rows
        )
        head = ("set", ">logs", *(f">{mark}" for mark in asked))
        ends = ("set", ">over true noise, median", ">worst", ">95 % intervals that cover", ">drops predicted")
        return (
            Table("Blind logs: how many of how many, % (95 % interval)", head, marks),
            Table("End of the ladder: residual, parameters, drops of the error predicted within 10 %", ends, end),
        )

    def lines(self) -> list[str]:
        """Return one line for each failure, with what repeats that log alone."""
        return [str(trial) for trial in self.failures]

    def __str__(self) -> str:
        return "\n\n".join([*map(str, self.tables()), "\n".join(self.lines())]).rstrip()


def counts(trials: Sequence[Trial]) -> dict[str, dict[str, float]]:
    """Return count, number, share and 95 % interval of each mark that was requested.

    Parameters
    ----------
    trials : sequence of Trial
        Of one set.
    """
    found = {}
    for mark in MARKS:
        asked = [value for trial in trials if (value := getattr(trial.marks, mark)) is not None]
        if asked:
            found[mark] = share(asked)
    return found


def share(values: Iterable[bool]) -> dict[str, float]:
    """Return how many of the values are true: count, of, share, low, high.

    Parameters
    ----------
    values : iterable of bool
        At least one.
    """
    each = list(values)
    low, high = interval(sum(each), len(each))
    return {"count": sum(each), "of": len(each), "share": sum(each) / len(each), "low": low, "high": high}


def figures(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return error at the end over the true noise (median, worst), coverage, and share of drops predicted.

    Parameters
    ----------
    trials : sequence of Trial
        At least one.
    """
    ends = [trial.true_ratio for trial in trials if np.isfinite(trial.true_ratio) and not _rightly_stopped(trial)]
    errors = [abs(error) <= 1.96 for trial in trials for error in trial.errors]
    drops = [
        abs(expected - realised) <= WITHIN * abs(realised) for trial in trials for expected, realised in trial.drops
    ]
    return {
        "true_ratio_median": float(np.median(ends)) if ends else None,
        "true_ratio_worst": float(max(ends)) if ends else None,
        **({"coverage": share(errors)} if errors else {}),
        **({"foretold": share(drops)} if drops else {}),
    }


def _ratio(ratio: float | None) -> str:
    return "-" if ratio is None else f"{ratio:.4f}"


def _rightly_stopped(trial: Trial) -> bool:
    """Return whether the ladder rightly left something in the residual: rivals, or an effect outside the catalogue."""
    return trial.answer.end in ("ambiguous", "unknown") and not trial.marks.faults


def _share(found: dict[str, float] | None) -> str:
    if found is None:
        return "-"
    return (
        f"{found['count']}/{found['of']} {100 * found['share']:.1f} "
        f"({100 * found['low']:.1f}-{100 * found['high']:.1f})"
    )
