"""The sentences of a diagnosis, from descriptions of effects and figures."""

from __future__ import annotations

from collections.abc import Sequence

from imufit.figures import quantity
from imufit.results.data_fault import DataFault
from imufit.results.diagnosis import IN_DOUBT, LIKELY, NOT_TESTABLE, OFF_FLOOR, SIGNIFICANT, Candidate, Diagnosis
from imufit.results.disagreement import Disagreement
from imufit.results.effect_card import EffectCard
from imufit.results.judged import left_out
from imufit.results.parameter import Parameter
from imufit.results.phrasing import capital, listed


def leading(parameters: Sequence[Parameter]) -> Parameter | None:
    """Return the parameter that stands out most from its error."""
    known = [p for p in parameters if p.standard_error > 0]
    return max(known, key=lambda p: abs(p.value / p.standard_error), default=None)


DOUBTS = {
    "implausible size": "no sensor of this kind has so much of it",
    "negative delay": "it would have to read what is yet to come",
}
"""Why a candidate that would explain much is not the answer, by its status."""


def explanation(card: EffectCard, candidate: Candidate) -> str:
    """One candidate in a sentence: the physics, its size, what adding it should bring."""
    if candidate.status == NOT_TESTABLE:
        why = "no such motion or temperature, or inside the model already"
        return f"{capital(card.name)}: this log cannot show it ({why})."
    text = f"{capital(card.name)}: {card.physics}." if card.physics else f"{capital(card.name)}."
    top = leading(candidate.parameters)
    if top is not None:
        text += f" Here {top.name} = {quantity.with_error(top.value, top.standard_error, top.unit)}"
        if top.typical:
            text += f" (typically {quantity.quantity(top.typical, top.unit)})"
        text += ", the clearest of its values." if len(candidate.parameters) > 1 else "."
    if candidate.status == SIGNIFICANT:
        text += f" {quantity.promise('it', candidate.held_out_before, candidate.held_out_after)}."
    elif candidate.status == "negative delay":
        text += (
            " It would have to read what is yet to come: that is not the sensor, but rows that are stamped too late,"
            " or a reference that is late itself."
        )
    elif candidate.status == "implausible size":
        text += " No sensor of this kind has so much of it: something else looks like it here."
    elif candidate.outcome == IN_DOUBT:
        text += (
            " There is evidence of it, but its name would be a guess: it does not lower the held-out error, a cause"
            " without a name explains more instead, its size changes over the log, or it needs a position that the"
            " reference lacks."
        )
    elif candidate.outcome == LIKELY:
        text += " It is more probable than not, but these rows do not establish it: a longer log may."
    else:
        text += " Adding it would not lower the held-out error by more than chance does."
    return text


def answer(found: Diagnosis, best: Candidate | None, *, untold: int, spoilt: bool) -> str:
    """Give an answer in a few sentences: the verdict, logs that disagree, sensors that were not judged.

    Parameters
    ----------
    found : Diagnosis
        The answer.
    best : Candidate or None
        The effect that stands out, be it named or not.
    untold : int
        Number of effects that only a reference would show.
    spoilt : bool
        The logs differ so much that an answer for all of them does not exist.
    """
    adequate = found.verdict == "adequate"
    text = _adequate(found, untold) if adequate else _missing(found, best)
    if found.disagrees:
        text = _with_disagreements(text, found.disagrees, spoilt=spoilt)
    missing = left_out(found.judged)
    if not missing:
        return text
    if not adequate:
        return f"{text} {capital(missing)}."
    judged = ", ".join(item.sensor for item in found.judged if item.judged)
    outcome = "judged" if found.ratio > OFF_FLOOR else "nothing missing"
    return f"{judged}: {outcome}; {missing}. {text}" if judged else f"{capital(missing)}. {text}"


def _adequate(found: Diagnosis, untold: int) -> str:
    """Say that nothing is missing, as far as the logs show."""
    rests = "rests" in found.evidence
    if found.ratio > OFF_FLOOR:
        return (
            f"No effect is missing for certain{' without a reference attitude' if rests else ''}, but the residual "
            f"stands at {found.ratio:.2f} times the noise: the noise is stronger or more coloured than stated, or the "
            "log does not contain the cause of the residual."
        )
    if rests:
        text = "Nothing that this log can show without a reference attitude is missing."
        # Of sensors that were not judged no effect was shown: a count of the others would pass for all of them.
        counted = untold and not left_out(found.judged)
        return f"{text} A reference would also show {quantity.counted(untold, 'effect')}." if counted else text
    return "Nothing that this log can show is missing: the residual is at its noise floor."


def _missing(found: Diagnosis, best: Candidate | None) -> str:
    """Say what is missing."""
    left = ""
    if found.unexplained:
        first = found.unexplained[0]
        left = f"{first.channel} still depends on {first.covariate} ({first.shape})"
    if found.verdict == "unknown" or best is None:
        text = "Something is missing"
        text += f" that no effect of the catalogue explains: {left}." if left else "."
        if not left and best is None:
            text += _nearest(found)
        return text if best is None else f"{text} {best.effect} would explain a part of it, but not most."
    if found.verdict == "ambiguous":
        rivals = " or ".join(found.ambiguous_with)
        return (
            f"{best.effect} or {rivals} is missing: each alone explains this log, "
            f"and {best.effect} explains nothing more beside {rivals}."
        )
    text = f"{best.effect} is missing. {best.explanation}"
    others = [item.effect for item in found.candidates if item.status == SIGNIFICANT and item.effect != best.effect]
    if others:
        text += f" The log shows {listed(others)} as well."
    return f"{text} Apart from {'these' if others else 'it'}, {left}." if left else text


def _nearest(found: Diagnosis) -> str:
    """Name the candidate that comes nearest to an explanation, and say why it is none."""
    doubtful = next((candidate for candidate in found.candidates if candidate.status in DOUBTS), None)
    if doubtful is not None:
        return f" {doubtful.effect} comes nearest, but {DOUBTS[doubtful.status]}."
    seen = next((candidate for candidate in found.candidates if candidate.outcome == IN_DOUBT), None)
    if seen is None or seen.held_out_after < seen.held_out_before:
        return ""
    return f" {seen.effect} has evidence, but does not lower the held-out error: the noise may be another one."


def spoilt(faults: Sequence[DataFault]) -> str:
    """Say which faults of the data must be corrected before any effect can be judged."""
    said = " ".join(fault.sentence for fault in faults)
    kinds = ", ".join(dict.fromkeys(fault.fault for fault in faults))
    logs = ", ".join(dict.fromkeys(fault.file for fault in faults if fault.file is not None))
    return f"The data{f' of {logs}' if logs else ''} are at fault, not the sensor ({kinds}). {said}"


def _with_disagreements(text: str, found: Sequence[Disagreement], *, spoilt: bool) -> str:
    """Put logs that disagree into the answer: in its place where they spoil it, else after it."""
    about = list(dict.fromkeys(item.effect for item in found))
    if spoilt:
        about = [key for key in about if any(item.wild for item in found if item.effect == key)][:1]
        said = "The logs differ too much about {} for it to be a property of the sensor: {}."
        text = ""
    else:
        said = "The logs differ about {}: {}."
    for key in about:
        text += " " + said.format(key, _differences([item for item in found if item.effect == key]))
    return text.strip()


def _differences(found: Sequence[Disagreement]) -> str:
    """State the values of each log; of two that differ from each other once."""
    first = found[0]
    if len(found) == 2 and found[1].value == first.others:
        return str(first).replace("the others", found[1].file)
    return "; ".join(map(str, found))


def contradicted(held: Parameter, found: Parameter) -> str:
    """Say of a fixed value how far it is from the value that the logs give."""
    value = quantity.quantity(held.value, held.unit)
    estimate = quantity.with_error(found.value, found.standard_error, found.unit)
    return (
        f"{held.key} is fixed at {value}, but the data give {estimate}: estimate the parameter, or correct its value."
    )


def unshown(effect: str, reason: str) -> str:
    """Say of an effect that a log cannot show it, and why."""
    return f"This log cannot show {effect}: {reason}."


def experiment(cards: Sequence[EffectCard]) -> str:
    """Say what would separate candidates that this log does not separate."""
    parts = [f"for {card.id}, {card.confirm}" for card in cards if card.confirm]
    if not parts:
        return "Record a log with another motion, in more attitudes and over a wider range of temperature."
    return "Record another log that separates them: " + "; ".join(parts) + "."
