"""The answer of the ladder to a log of the second simulator (tests/independent), and the faults in that answer."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import lab_failures
import pyarrow as pa
import pyarrow.parquet as pq
from case import Case
from imufit import ladder
from imufit.errors import InputError
from imufit.log import read
from imufit.results import Diagnosis, Ladder

SEED = 5
"""Seed of the rows in tests and on the page."""

REFUSED = "refused"


@dataclass(frozen=True)
class Answer:
    """What the ladder said about a log.

    Attributes
    ----------
    first, end
        Verdicts before the first step and after the last one; ``refused`` where the log is an input error.
    named
        Best candidate and its rivals, of the first and of the last diagnosis.
    steps
        Effects added, in order.
    remarks
        The first dependences that no effect explains, the faults of the data, or why the log was refused.
    parameters
        Value and standard error of each parameter of the final model, by ``effect.name``, in SI units.
    """

    first: str
    end: str
    named: tuple[str, ...] = ()
    steps: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    parameters: dict[str, tuple[float, float]] = field(default_factory=dict)

    def __str__(self) -> str:
        said = " ".join(filter(None, [self.first, ", ".join(self.named)]))
        climbed = f"; ladder + {' + '.join(self.steps)} -> {self.end}" if self.steps else ""
        remarks = f" ({'; '.join(self.remarks)})" if self.remarks else ""
        return said + climbed + remarks


def answer(case: Case, folder: Path) -> Answer:
    """Climb the ladder on the log, which goes through a file, since its metadata belong to one."""
    path = folder / "log.parquet"
    table = pa.Table.from_pandas(case.frame, preserve_index=False)
    pq.write_table(table.replace_schema_metadata({b"imufit": json.dumps(case.metadata).encode()}), path)
    try:
        found = ladder(read(path))
    except InputError as error:
        return Answer(REFUSED, REFUSED, remarks=(str(error).replace(str(path), path.name),))
    return of_ladder(found)


def of_ladder(found: Ladder) -> Answer:
    """Return what a ladder says."""
    first = found.first or found.diagnosis
    unexplained = [f"{item.channel} over {item.covariate}" for item in first.unexplained[:1]]
    return Answer(
        first=first.verdict,
        end=found.verdict,
        named=tuple(dict.fromkeys([*names(first), *names(found.diagnosis)])),
        steps=tuple(step.effect for step in found.steps),
        remarks=tuple(dict.fromkeys([*unexplained, *(f"fault: {fault.fault}" for fault in first.data_faults)])),
        parameters={f"{p.effect}.{p.name}": (float(p.value), float(p.standard_error)) for p in found.fit.parameters},
    )


def names(diagnosis: Diagnosis) -> list[str]:
    """Return the candidate that a diagnosis names, and its rivals."""
    return [*([diagnosis.best] if diagnosis.best else []), *diagnosis.ambiguous_with]


def false_names(case: Case, said: Answer) -> list[str]:
    """Return the names that are neither right nor harmless."""
    return sorted(case.false_names({*said.named, *said.steps}))


def missed(case: Case, said: Answer) -> list[str]:
    """Return the effects that act in the log and are neither named nor added."""
    return sorted(set(case.effects) - {*said.named, *said.steps})


def verdict(case: Case, said: Answer) -> str:
    """Return the verdict that counts: where an effect acts the one at the end, else the first."""
    return said.end if case.effects else said.first


def too_far(case: Case, said: Answer) -> list[str]:
    """Return the parameters that miss the truth by more than the row allows."""
    found = []
    for effect, tolerances in lab_failures.TOLERANCES.get(case.name, {}).items():
        for name, tolerance in tolerances.items():
            value = said.parameters.get(f"{effect}.{name}", (float("nan"), 0.0))[0]
            if not abs(value - case.effects[effect][name]) <= tolerance:
                found.append(f"{effect}.{name} = {value:.4g} instead of {case.effects[effect][name]:.4g}")
    return found


def faults(case: Case, said: Answer) -> list[str]:
    """Return everything that is wrong in an answer."""
    wrong_verdict = verdict(case, said) not in case.verdicts
    return [
        *(f"false name {name}" for name in false_names(case, said)),
        *(f"missed {name}" for name in missed(case, said)),
        *([f"verdict {verdict(case, said)} instead of {' or '.join(sorted(case.verdicts))}"] if wrong_verdict else []),
        *too_far(case, said),
    ]


def within(case: Case, said: Answer) -> list[bool]:
    """Return for each true parameter that the final model holds whether its estimate is within two standard errors."""
    truth = {f"{effect}.{name}": value for effect, each in case.effects.items() for name, value in each.items()}
    estimates = [(*said.parameters[name], value) for name, value in truth.items() if name in said.parameters]
    return [bool(abs(estimate - value) <= 2.0 * error) for estimate, error, value in estimates if error > 0.0]
