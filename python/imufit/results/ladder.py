"""The ladder: effects added one by one until nothing is missing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from imufit.figures import quantity
from imufit.results.addition import surprise
from imufit.results.comparison import Comparison
from imufit.results.data_fault import fault_table
from imufit.results.diagnosis import VERDICTS, Diagnosis
from imufit.results.json_value import json_fields, json_value
from imufit.results.log_parameters import logs_json
from imufit.results.parameter import by_effect, parameter_table
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place
    from imufit.results.attitude import AttitudeComparison


@dataclass(frozen=True, repr=False)
class Step(Part):
    """One effect added.

    Attributes
    ----------
    effect : str
        Its id.
    before, expected, after : float
        Held-out residual over noise floor before, as predicted, and as realised.
    training : float
        The same after the step, on the data used for fitting.
    """

    effect: str
    before: float
    expected: float
    after: float
    training: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of one step; training error besides."""
        return json_fields(self)

    def __str__(self) -> str:
        return (
            f"+ {self.effect}: {quantity.ratio(self.before)} -> {quantity.ratio(self.after)} "
            f"(expected {quantity.ratio(self.expected)})"
        )


@dataclass(frozen=True, repr=False)
class Revision(Part):
    """An effect taken out again, because later ones made it needless or another does better in its place.

    Attributes
    ----------
    removed : str
        Its id.
    by : str or None
        The effect that stands in its place, if any.
    before, after : float
        Held-out residual over noise floor with it and without.
    """

    removed: str
    by: str | None
    before: float
    after: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of one revision."""
        return json_fields(self)

    def __str__(self) -> str:
        errors = f"{quantity.ratio(self.before)} -> {quantity.ratio(self.after)}"
        if self.by is None:
            return f"{self.removed} was taken out again: the effects added later explain what it did ({errors})."
        return f"{self.by} took the place of {self.removed}: it explains more beside the others ({errors})."


@dataclass(frozen=True, eq=False, repr=False)
class Ladder(Plotted, Result):
    """The whole loop on one log.

    Attributes
    ----------
    steps : tuple of Step
        In the order of the additions.
    model : tuple of str
        Effects of the final model.
    verdict : str
        Verdict after the last step.
    ratio_start, ratio_end : float
        Held-out residual over noise floor before the first and after the last step.
    attitude : AttitudeComparison or None
        How far an attitude filter is off without and with the final model, where the log determines this.
    diagnosis : Diagnosis
        After the last step; where other causes explain the log as well as effects of the model, without these.
    comparison_start, comparison_end : Comparison or None
        First and last model against the log.
    first : Diagnosis or None
        Before the first step.
    fit : Any
        The final fit.
    start : Any
        The fit before the first step.
    sentence : str
        The result in words.
    revisions : tuple of Revision
        Effects that were added on the way and taken out again; `steps` is the way without them.
    """

    steps: tuple[Step, ...]
    model: tuple[str, ...]
    verdict: str
    ratio_start: float
    ratio_end: float
    attitude: AttitudeComparison | None
    diagnosis: Diagnosis
    comparison_start: Comparison | None = None
    comparison_end: Comparison | None = None
    first: Diagnosis | None = None
    fit: Any = field(default=None, repr=False)
    sentence: str = ""
    revisions: tuple[Revision, ...] = ()
    start: Any = field(default=None, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """JSON of `ladder`; besides: revisions, rivals, what is unexplained, experiment, faults, parameters."""
        return {
            "steps": [step.to_dict() for step in self.steps],
            "model": list(self.model),
            "verdict": self.verdict,
            "ratio_start": json_value(self.ratio_start),
            "ratio_end": json_value(self.ratio_end),
            "attitude": None if self.attitude is None else self.attitude.to_dict(),
            "revisions": [revision.to_dict() for revision in self.revisions],
            "ambiguous_with": [effect for effect in self.diagnosis.named if effect not in self.model]
            if self.verdict == "ambiguous"
            else [],
            "unexplained": [item.to_dict() for item in self.diagnosis.unexplained],
            "experiment": self.diagnosis.experiment,
            "data_faults": [fault.to_dict() for fault in self.diagnosis.data_faults],
            "sentence": self.sentence,
            "parameters": by_effect(getattr(self.fit, "parameters", ()) or ()),
            **logs_json(self.diagnosis.logs),
            **({"disagrees": [item.to_dict() for item in self.diagnosis.disagrees]} if self.diagnosis.logs else {}),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per step."""
        import pandas as pd  # noqa: PLC0415

        columns = ["effect", "before", "expected", "after", "training"]
        return pd.DataFrame([[getattr(item, name) for name in columns] for item in self.steps], columns=columns)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Waterfall of the held-out error."""
        from imufit.figures.waterfall import waterfall  # noqa: PLC0415

        return waterfall(
            [step.effect for step in self.steps],
            before=[step.before for step in self.steps],
            expected=[step.expected for step in self.steps],
            after=[step.after for step in self.steps],
            training=[step.training for step in self.steps],
            start=self.ratio_start,
            ax=ax,
        )

    def step_table(self) -> Table:
        """Before, expected and after of each step beside the noise floor."""
        rows = tuple(
            (
                f"+ {step.effect}",
                quantity.ratio(step.before),
                quantity.ratio(step.expected),
                quantity.ratio(step.after),
                "1.00",
                quantity.ratio(step.training),
            )
            for step in self.steps
        )
        header = ("step", ">before", ">expected", ">after", ">noise floor", ">training")
        return Table("Held-out error over noise floor", header, rows)

    def warnings(self) -> list[str]:
        """List the steps whose drop was not the expected one."""
        texts = ((step.effect, surprise(step.before, step.expected, step.after)) for step in self.steps)
        return [f"{effect}: {text}" for effect, text in texts if text]

    def tables(self) -> tuple[Table, ...]:
        """Every table, most important first."""
        return (
            self.step_table(),
            self.diagnosis.unexplained_table(),
            self.diagnosis.disagreement_table(),
            self.diagnosis.log_table(),
            fault_table(self.diagnosis.data_faults),
            parameter_table(getattr(self.fit, "parameters", ()) or (), "Parameters of the model"),
        )

    def answer_tables(self) -> tuple[Table, ...]:
        """Return the steps, what no effect explains, and the logs that disagree."""
        return self.step_table(), self.diagnosis.unexplained_table(), self.diagnosis.disagreement_table()

    def sentences(self) -> list[str]:
        """Verdict, result, attitude, warnings, next experiment, faults of the data that only concern some rows."""
        experiment = f"Next: {self.diagnosis.experiment}" if self.diagnosis.experiment else ""
        result = (
            f"Held-out error {quantity.ratio(self.ratio_start)} -> {quantity.ratio(self.ratio_end)} "
            f"times the noise floor with {' + '.join(self.model) or 'the ideal sensor'}."
        )
        attitude = "" if self.attitude is None else self.attitude.sentence
        verdict = f"{self.diagnosis.headline}: {self.sentence or VERDICTS.get(self.verdict, '')}"
        without = [f"{item}. {item.sentence}" for item in self.diagnosis.without]
        faults = self.diagnosis.local_faults()
        return [verdict, *without, result, *map(str, self.revisions), attitude, *self.warnings(), experiment, *faults]
