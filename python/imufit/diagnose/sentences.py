"""Sentences from descriptions and figures."""

from __future__ import annotations

from collections.abc import Sequence

from imufit.figures import quantity
from imufit.results import Candidate, DataFault, Disagreement, EffectCard, Judged, Parameter, Unexplained
from imufit.results.judged import left_out


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def leading(parameters: Sequence[Parameter]) -> Parameter | None:
    """Return the parameter that stands out most from its error."""
    known = [p for p in parameters if p.standard_error > 0]
    return max(known, key=lambda p: abs(p.value / p.standard_error), default=None)


DOUBTS = {
    "differs between halves": "the two halves of the log disagree about it by more than chance",
    "implausible size": "no sensor of this kind has so much of it",
    "negative delay": "it would have to read what is yet to come",
}
"""Why a candidate that would explain much is not the answer, by its status."""


def explanation(card: EffectCard, candidate: Candidate) -> str:
    """One candidate in a sentence: the physics, its size, what adding it should bring."""
    if candidate.status == "not testable here":
        why = "no such motion or temperature, or inside the model already"
        return f"{_capital(card.name)}: this log cannot show it ({why})."
    text = f"{_capital(card.name)}: {card.physics}." if card.physics else f"{_capital(card.name)}."
    top = leading(candidate.parameters)
    if top is not None:
        text += f" Here {top.name} = {quantity.with_error(top.value, top.standard_error, top.unit)}"
        if top.typical:
            text += f" (typically {quantity.quantity(top.typical, top.unit)})"
        text += "."
    before, after = candidate.held_out_before, candidate.held_out_after
    if candidate.status == "passed":
        text += f" Adding it should cut the held-out error from {before:.3f} to {after:.3f} of the noise floor."
    elif candidate.status == "differs between halves":
        text += (
            " But the two halves of the log disagree about it by more than chance, so it is no property of the sensor."
        )
    elif candidate.status == "negative delay":
        text += (
            " It would have to read what is yet to come: that is not the sensor, but rows that are stamped too late,"
            " or a reference that is late itself."
        )
    elif candidate.status == "implausible size":
        text += " No sensor of this kind has so much of it: something else looks like it here."
    else:
        text += " Adding it would not lower the held-out error by more than chance does."
    return text


def verdict(
    word: str,
    best: Candidate | None,
    card: EffectCard | None,
    rivals: Sequence[str],
    unexplained: Sequence[Unexplained],
    doubtful: Candidate | None = None,
) -> str:
    """Give the answer in a sentence or two."""
    left = ""
    if unexplained:
        first = unexplained[0]
        left = f"{first.channel} still depends on {first.covariate} ({first.shape})"
    if word == "adequate":
        return "Nothing that this log can show is missing: the residual is at its noise floor as far as can be told."
    if word == "unknown":
        text = (
            f"Something is missing that no effect of the catalogue explains: {left}."
            if left
            else "Something is missing."
        )
        if doubtful is not None and not left and best is None:
            text += f" {doubtful.effect} comes nearest, but {DOUBTS[doubtful.status]}."
        if best is not None:
            text += f" {best.effect} would take a part of it, but not most."
        return text
    if best is None or card is None:
        raise ValueError(f"verdict {word} needs a candidate")
    if word == "ambiguous":
        return (
            f"{best.effect} or {' or '.join(rivals)} is missing: each explains this log, "
            f"and {best.effect} adds nothing to what {' or '.join(rivals)} explains."
        )
    text = f"{best.effect} is missing. {best.explanation}"
    return f"{text} Apart from it, {left}." if left else text


OFF_FLOOR = 1.2
"""Held-out error over the noise from which on a residual is no longer said to be at its noise floor."""


def above_floor(ratio: float) -> str:
    """Say that no effect is missing for certain, although the residual is larger than the noise."""
    return (
        f"No effect is missing for certain, but the residual stands at {ratio:.2f} times the noise: the noise is "
        "stronger or more coloured than stated, or something is left that goes with nothing in the log."
    )


def with_judged(text: str, sensors: Sequence[Judged], *, adequate: bool) -> str:
    """Put in front which sensors an adequate answer is about, where others were not judged; behind any other answer."""
    missing = left_out(sensors)
    if not missing:
        return text
    if not adequate:
        return f"{text} {missing[0].upper()}{missing[1:]}."
    judged = ", ".join(item.sensor for item in sensors if item.judged)
    return f"{judged}: nothing missing; {missing}. {text}" if judged else f"{missing[0].upper()}{missing[1:]}. {text}"


def spoilt(faults: Sequence[DataFault]) -> str:
    """Say which faults of the data have to be put right before any effect can be judged."""
    said = " ".join(fault.sentence for fault in faults)
    kinds = ", ".join(dict.fromkeys(fault.fault for fault in faults))
    logs = ", ".join(dict.fromkeys(fault.file for fault in faults if fault.file is not None))
    return f"The data{f' of {logs}' if logs else ''} are at fault, not the sensor ({kinds}). {said}"


def with_disagreements(text: str, found: Sequence[Disagreement], *, spoilt: bool) -> str:
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
    """Say what each log says; of two that differ from each other it is said once."""
    first = found[0]
    if len(found) == 2 and found[1].value == first.others:
        return str(first).replace("the others", found[1].file)
    return "; ".join(map(str, found))


def experiment(best: EffectCard, rivals: Sequence[EffectCard]) -> str:
    """Say what would separate candidates that this log cannot tell apart."""
    parts = [f"for {card.id}, {card.confirm}" for card in (best, *rivals) if card.confirm]
    if not parts:
        return "Record a log with another motion, in more attitudes and over a wider range of temperature."
    return "Record another log that separates them: " + "; ".join(parts) + "."
