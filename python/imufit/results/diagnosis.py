"""Which effect is missing: ranked candidates, rivals, and what no effect explains."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from imufit.figures import quantity
from imufit.results.data_fault import DataFault, fault_table
from imufit.results.disagreement import Disagreement, Without, disagreement_table
from imufit.results.json_value import json_fields, json_value
from imufit.results.judged import Judged
from imufit.results.log_parameters import LogParameters, log_table, logs_json
from imufit.results.noise_part import NoisePart, noise_table
from imufit.results.parameter import Parameter, by_name, in_words
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

OFF_FLOOR: Final = 1.2
"""Held-out error over the noise up to which a residual counts as at its noise floor."""
VERDICTS = {
    "adequate": "Nothing that this log can show is missing.",
    "missing": "One effect is missing and stands out.",
    "ambiguous": "Something is missing, and two or more effects explain it equally well in this log.",
    "unknown": "Something is missing that no effect of the catalogue explains.",
}


SIGNIFICANT = "significant"
"""Status of an effect that is there, or explains as much as one that is."""
NOT_SIGNIFICANT = "not significant"
"""Status of an effect that the log shows not to be there, or does not need beside others."""
LIKELY = "likely, not established"
"""In words the status of an effect that is not significant, but more probable than not: a name needs better odds."""
IN_DOUBT = "in doubt"
"""In words the status of an effect with the odds that a name needs, which its kind of evidence does not earn it: it
does not lower the held-out error, an unnamed cause explains more in its place, its size changes over the log, or it
needs a position that is not there."""
ENOUGH = 0.881
"""Probability from which on a candidate has the odds that a name needs, e² to one (`Problem.ODDS`)."""
NEXT = 5
"""Candidates behind those that stand out that are shown with them: the answer stays on a screen of 24 lines."""
NOT_TESTABLE = "not testable here"
"""Status of an effect that a log cannot show."""


@dataclass(frozen=True, repr=False)
class Rival(Part):
    """An effect that looks much the same in this log.

    Attributes
    ----------
    effect : str
        Its id.
    correlation : float
        Canonical correlation with the candidate, given the model.
    """

    effect: str
    correlation: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of one rival."""
        return {"effect": self.effect, "correlation": json_value(self.correlation)}

    def __str__(self) -> str:
        return f"{self.effect} ({quantity.number(self.correlation, 2)})"


@dataclass(frozen=True, repr=False)
class Candidate(Part):
    """One effect and what adding it would bring.

    Attributes
    ----------
    effect : str
        Its id.
    status : str
        ``passed``, ``not significant``, ``not testable here``, ``implausible size`` or ``negative delay``.
    held_out_before, held_out_after : float
        Held-out residual over noise floor without and with it.
    explanation : str
        The physics and the figures in a sentence.
    probability : float
        Probability that the effect is there beside the others that are; rivals share it.
    ln_bayes : float
        Log Bayes factor on top of the model.
    gain, gain_error : float
        Held-out gain and its standard error, in any common unit.
    parameters : tuple of Parameter
        Predicted parameters.
    confounded_with : tuple of Rival
        Effects that this log hardly separates from it.
    minimal_detectable : dict
        Smallest detectable (value, unit) by parameter.
    logs : tuple of LogParameters
        Of several logs, where each has its own parameters of this effect; `parameters` are then their means.
    """

    effect: str
    status: str
    held_out_before: float
    held_out_after: float
    explanation: str = ""
    probability: float = 0.0
    ln_bayes: float = 0.0
    gain: float = 0.0
    gain_error: float = 0.0
    parameters: tuple[Parameter, ...] = ()
    confounded_with: tuple[Rival, ...] = ()
    minimal_detectable: dict[str, tuple[float, str]] = field(default_factory=dict)
    logs: tuple[LogParameters, ...] = ()

    @property
    def p_value(self) -> float:
        """Bound on the chance of such evidence without the effect: one over its Bayes factor, at most 1."""
        return math.exp(-max(self.ln_bayes, 0.0))

    @property
    def expected_ratio(self) -> float:
        """Expected residual over noise floor with the effect."""
        return self.held_out_after

    def to_dict(self) -> dict[str, Any]:
        """JSON of one candidate; gain, status and smallest detectable sizes besides."""
        return {
            "effect": self.effect,
            "p_value": json_value(self.p_value),
            "expected_ratio": json_value(self.expected_ratio),
            "held_out_before": json_value(self.held_out_before),
            "held_out_after": json_value(self.held_out_after),
            "parameters": by_name(self.parameters),
            "confounded_with": [rival.to_dict() for rival in self.confounded_with],
            "explanation": self.explanation,
            "probability": json_value(self.probability),
            "ln_bayes": json_value(self.ln_bayes),
            "gain": json_value(self.gain),
            "gain_error": json_value(self.gain_error),
            "status": self.status,
            "minimal_detectable": {
                name: {"value": json_value(value), "unit": unit}
                for name, (value, unit) in self.minimal_detectable.items()
            },
            **(
                {"logs": [{"file": log.file, "parameters": by_name(log.parameters)} for log in self.logs]}
                if self.logs
                else {}
            ),
        }

    @property
    def drop_error(self) -> float:
        """Standard error of the drop of the held-out ratio: beside the drop what `gain_error` is beside `gain`."""
        if self.gain == 0.0 or not math.isfinite(self.gain):
            return math.nan
        return abs(self.gain_error * (self.held_out_before - self.held_out_after) / self.gain)

    @property
    def outcome(self) -> str:
        """The status as it is shown beside the probability, which it does not contradict."""
        if self.status != NOT_SIGNIFICANT or self.probability <= 0.5:
            return self.status
        return IN_DOUBT if self.probability >= ENOUGH else LIKELY

    @property
    def error_change(self) -> str:
        """Held-out error without and with the effect alone, e.g. ``2.17 → 1.31``; some lower it beside others only."""
        return quantity.change(self.held_out_before, self.held_out_after)

    @property
    def smallest_detectable(self) -> str:
        """Smallest sizes that this log would have shown, on one line."""
        by_size: dict[str, list[str]] = {}
        for name, (value, unit) in self.minimal_detectable.items():
            by_size.setdefault(quantity.quantity(value, unit), []).append(name)
        if len(by_size) == 1 and len(self.minimal_detectable) > 1:
            return f"each {next(iter(by_size))}"
        if len(by_size) > 3:
            sizes = [(value, unit) for value, unit in self.minimal_detectable.values() if math.isfinite(value)]
            if sizes and len({unit for _, unit in sizes}) == 1:
                unit = sizes[0][1]
                return f"{quantity.quantity(min(sizes)[0], unit)} to {quantity.quantity(max(sizes)[0], unit)}"
        return ", ".join(f"{' '.join(names)} {size}" for size, names in by_size.items()) or "-"

    def __str__(self) -> str:
        return (
            f"{self.effect}: held-out error {self.error_change}, probability {quantity.probability(self.probability)}. "
            f"{self.explanation}"
        )


@dataclass(frozen=True, repr=False)
class Unexplained(Part):
    """A dependence that no named effect explains.

    Attributes
    ----------
    channel, covariate : str
        What depends on what.
    share : float
        Fraction of the excess variance.
    shape : str
        For instance ``V-shaped``.
    t_start, t_end : float
        Where in time, s.
    """

    channel: str
    covariate: str
    share: float
    shape: str
    t_start: float
    t_end: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of one dependence."""
        return json_fields(self)

    def __str__(self) -> str:
        shape = f", {self.shape}" if self.shape else ""
        return f"{self.channel} depends on {self.covariate}{shape}: {quantity.share(self.share)} of its excess"


@dataclass(frozen=True, repr=False)
class Diagnosis(Plotted, Result):
    """Verdict over all candidate effects.

    Attributes
    ----------
    verdict : str
        ``adequate``, ``missing``, ``ambiguous`` or ``unknown``.
    best : str or None
        The effect that stands out.
    ambiguous_with : tuple of str
        Effects that explain the data equally well here.
    candidates : tuple of Candidate
        Best first.
    unexplained : tuple of Unexplained
        What no effect explains.
    model : tuple of str
        Effects that the model has.
    experiment : str or None
        The recording that would separate the rivals.
    sentence : str
        The result in words.
    notes : tuple of str
        What the reader should know about these figures.
    logs : tuple of LogParameters
        Of several logs: how far each is above its noise floor, and the model's parameters that it has for itself.
    disagrees : tuple of Disagreement
        Logs that have another value of an effect than the others.
    without : tuple of Without
        What the answer is without logs that disagree so much, or whose data are so faulty, that there is none with
        them.
    data_faults : tuple of DataFault
        What is wrong with the data themselves. Where one of them spoils the log, the verdict is ``unknown`` and no
        effect is judged.
    evidence : str
        What the logs are judged by: ``reference`` (attitude in every row), ``rests`` (the weaker evidence of rests,
        turns between them and the length of the field, for logs without a reference) or ``reference and rests``.
    judged : tuple of Judged
        Every sensor of the logs: whether it was judged, and why not.
    noise : tuple of NoisePart
        The noise floor of each channel as a sum of parts.
    contradicted : tuple of Parameter
        Fixed values of the model that the logs contradict. Any candidate may look as if it were there beside them.
    ratio : float
        Held-out error of the model over the noise floor; NaN where faults of the data spoil the logs.
    """

    verdict: str
    best: str | None
    ambiguous_with: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    unexplained: tuple[Unexplained, ...]
    model: tuple[str, ...]
    experiment: str | None
    sentence: str
    notes: tuple[str, ...]
    logs: tuple[LogParameters, ...] = ()
    disagrees: tuple[Disagreement, ...] = ()
    without: tuple[Without, ...] = ()
    data_faults: tuple[DataFault, ...] = ()
    evidence: str = "reference"
    judged: tuple[Judged, ...] = ()
    noise: tuple[NoisePart, ...] = ()
    contradicted: tuple[Parameter, ...] = ()
    ratio: float = math.nan

    @property
    def headline(self) -> str:
        """The verdict in capitals: ``ADEQUATE`` is for logs of which every sensor was judged and is at its noise."""
        if self.verdict != "adequate" or self.whole:
            return self.verdict.upper()
        return "ABOVE THE NOISE" if all(item.judged for item in self.judged) else "PARTLY JUDGED"

    @property
    def whole(self) -> bool:
        """Whether every sensor was judged, and the residual is at its noise floor."""
        return all(item.judged for item in self.judged) and not self.ratio > OFF_FLOOR

    @property
    def best_candidate(self) -> Candidate | None:
        """The candidate named by `best`."""
        return next((item for item in self.candidates if item.effect == self.best), None)

    @property
    def named(self) -> tuple[str, ...]:
        """The effect named by `best`, and those that explain the log as well; empty where none is named."""
        return tuple(effect for effect in (self.best, *self.ambiguous_with) if effect is not None)

    def to_dict(self) -> dict[str, Any]:
        """JSON of `diagnose`; model, experiment, sentence, notes, faults of the data and evidence besides."""
        return {
            "verdict": self.verdict,
            "best": self.best,
            "ambiguous_with": list(self.ambiguous_with),
            "candidates": [candidate.to_dict() for candidate in self.candidates],
            "unexplained": [item.to_dict() for item in self.unexplained],
            "model": list(self.model),
            "experiment": self.experiment,
            "sentence": self.sentence,
            "notes": list(self.notes),
            "data_faults": [fault.to_dict() for fault in self.data_faults],
            "evidence": self.evidence,
            "judged": {item.sensor: item.to_dict() for item in self.judged},
            "noise": [part.to_dict() for part in self.noise],
            **logs_json(self.logs),
            **({"disagrees": [item.to_dict() for item in self.disagrees]} if self.logs else {}),
            **({"contradicted": [item.key for item in self.contradicted]} if self.contradicted else {}),
            **({"without": [item.to_dict() for item in self.without]} if self.without else {}),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per candidate, best first."""
        import pandas as pd  # noqa: PLC0415

        columns = [
            "effect",
            "status",
            "probability",
            "p_value",
            "held_out_before",
            "held_out_after",
            "expected_ratio",
            "gain",
            "gain_error",
        ]
        return pd.DataFrame([[getattr(item, name) for name in columns] for item in self.candidates], columns=columns)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Draw the expected held-out error of the ranked candidates."""
        from imufit.figures.candidates import candidate_bars  # noqa: PLC0415

        titles = {
            "ambiguous": f"{' and '.join(self.named)} explain this log equally well",
            "unknown": "No effect takes away enough of the held-out error to be the cause",
        }
        return candidate_bars(
            [item.effect for item in self.candidates],
            before=[item.held_out_before for item in self.candidates],
            after=[item.held_out_after for item in self.candidates],
            error=[item.drop_error for item in self.candidates],
            status=[item.status for item in self.candidates],
            sentence=titles.get(self.verdict, ""),
            ax=ax,
        )

    def candidate_table(self, limit: int = 10) -> Table:
        """Ranked candidates in shown units.

        Parameters
        ----------
        limit : int
            Rows at most.
        """
        rows = tuple(self._candidate_row(item) for item in self.candidates[:limit])
        return Table("Candidates, best first", _CANDIDATE, rows, blocks=True)

    def answer_table(self) -> Table:
        """Return the candidates that the answer names, or that passed the test; without rows where none did."""
        rows = tuple(self._candidate_row(item) for item in self.candidates if self._stands_out(item))
        return Table("Candidates that stand out", _CANDIDATE, rows, blocks=True)

    def next_table(self, limit: int = NEXT) -> Table:
        """Return the candidates behind those that stand out, best first, in one line each.

        Parameters
        ----------
        limit : int
            Rows at most.
        """
        others = [item for item in self.candidates if not self._stands_out(item)][:limit]
        rows = tuple(row[:4] for row in map(self._candidate_row, others))
        return Table("Next candidates", _CANDIDATE[:4], rows)

    def _candidate_row(self, item: Candidate) -> tuple[str, ...]:
        """One candidate in shown units."""
        return (
            item.effect,
            item.outcome,
            item.error_change,
            f"{quantity.probability(item.probability)}{self.shared(item)}",
            in_words(item.parameters) if item.status == SIGNIFICANT else "-",
            item.smallest_detectable,
            ", ".join(str(rival) for rival in item.confounded_with[:2]) or "-",
        )

    def shared(self, item: Candidate) -> str:
        """Name the rivals that share the probability of a candidate, e.g. ``, shared with gyr.delay``; often empty.

        Parameters
        ----------
        item : Candidate
            One of the candidates.
        """
        rivals = self.sharing(item)
        return f", shared with {' and '.join(rivals)}" if rivals else ""

    def sharing(self, item: Candidate) -> tuple[str, ...]:
        """Return the ids of the rivals that share the probability of a candidate.

        Parameters
        ----------
        item : Candidate
            One of the candidates.
        """
        alike = self.named if self.verdict == "ambiguous" and item.effect in self.named else ()
        return tuple(name for name in alike if name != item.effect)

    def _stands_out(self, item: Candidate) -> bool:
        return item.status == SIGNIFICANT or item.effect in self.named

    def unexplained_table(self) -> Table:
        """Dependences without a named cause."""
        rows = tuple(
            (
                item.channel,
                item.covariate,
                item.shape or "-",
                quantity.share(item.share),
                quantity.span(item.t_start, item.t_end),
            )
            for item in self.unexplained
        )
        return Table("Not explained by any effect", ("channel", "covariate", "shape", ">share", ">mostly at"), rows)

    def disagreement_table(self) -> Table:
        """Return the logs that disagree; without rows where all agree."""
        return disagreement_table(self.disagrees)

    def log_table(self) -> Table:
        """Return what each of several logs has for itself; without rows for one log."""
        return log_table(self.logs)

    def tables(self) -> tuple[Table, ...]:
        """Every table, most important first."""
        return (
            self.candidate_table(),
            self.unexplained_table(),
            self.disagreement_table(),
            self.log_table(),
            fault_table(self.data_faults),
            noise_table(self.noise),
        )

    def answer_tables(self) -> tuple[Table, ...]:
        """Return the candidates, briefly, what no effect explains, and the logs that disagree."""
        return self.answer_table(), self.next_table(), self.unexplained_table(), self.disagreement_table()

    def sentences(self) -> list[str]:
        """Verdict, result, next experiment, faults of the data that only concern some rows, and notes."""
        experiment = f"Next: {self.experiment}" if self.experiment else ""
        verdict = f"{self.headline}: {self.sentence or VERDICTS.get(self.verdict, '')}"
        without = [f"{item}. {item.sentence}" for item in self.without]
        return [verdict, *without, experiment, *self.local_faults(), *self.notes]

    def local_faults(self) -> list[str]:
        """Sentences on faults of the data beside which effects can be judged."""
        return [str(fault) for fault in self.data_faults if not fault.spoils]


_CANDIDATE = ("effect", "status", "held-out error", ">probability", "predicted", "smallest detectable", "rivals")
