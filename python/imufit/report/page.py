"""The page: the answer, the fall of the error, where the model fails, which effect, the sensor in space, what next."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from imufit.comparing.traces import STRETCHES
from imufit.figures import quantity
from imufit.figures.residuals import VISIBLE
from imufit.remedy import command
from imufit.report.inline_svg import inline_svg, untitled
from imufit.report.interactive import hash_of, interactive, policy
from imufit.report.pictures import (
    PHONE,
    Picture,
    fitted_parameters,
    in_order,
    noise_of,
    pictures,
    worst_first,
)
from imufit.report.turned import script, turned
from imufit.report.words import shown, with_words
from imufit.results.diagnosis import SIGNIFICANT, VERDICTS
from imufit.results.noise_part import noise_table
from imufit.results.parameter import in_lines, parameter_table
from imufit.results.table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from imufit.figures.style import PlainFigure
    from imufit.results import Addition, Candidate, Comparison, Diagnosis, Ladder, LogRows

Complete: TypeAlias = "Callable[[Picture], PlainFigure]"
"""Draws a picture at its usual width and finds its layout."""

_CANDIDATES: Final = 20
_MOST_SENTENCES: Final = 3
"""Sentences of the next step: more is a plan, and the plan stands in the documents."""
_SENTENCE: Final = re.compile(r"(?<=[.!?])\s+(?=[A-Z])")
_KINDS: Final = {"missing": "warn", "ambiguous": "warn", "unknown": "stop", "adequate": "good"}


def page(
    comparison: Comparison | None = None,
    diagnosis: Diagnosis | None = None,
    ladder: Ladder | None = None,
    *,
    addition: Addition | None = None,
    rows: LogRows | None = None,
    title: str = "Sensor model report",
    complete: Complete = Picture.complete,
) -> str:
    """Write results as one HTML page that needs no network.

    Parameters
    ----------
    comparison, diagnosis, ladder, addition : optional
        Whatever there is to show. A ladder brings its own comparison and diagnosis, which those given here replace.
    rows : LogRows, optional
        Rows of the log: traces of the channels, the measured field, the noise at rest.
    title : str
        Heading, for instance the log's name.
    complete : callable
        Draws a picture at its usual width and finds its layout; may save what it drew.

    Returns
    -------
    str
        The page; figures are inline SVG.
    """
    if ladder is not None:
        comparison = comparison or ladder.comparison_start
        diagnosis = diagnosis or ladder.first or ladder.diagnosis
    last = ladder.diagnosis if ladder is not None else diagnosis
    environment = Environment(
        loader=PackageLoader("imufit.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawing = {
        name: partial(drawn, complete=complete)
        for name, drawn in (("wide", _filling), ("small", _beside), ("turned", _in_space))
    }
    environment.globals.update(q=quantity, shown=shown, **drawing)
    end = ladder.comparison_end if ladder is not None and ladder.steps else None
    ends = {item.channel: item.ratio for item in end.channels} if end is not None else {}
    candidates = diagnosis.candidates[:_CANDIDATES] if diagnosis is not None else ()
    standing = [item for item in candidates if _stands_out(item, diagnosis)]
    order = worst_first(comparison)
    chart = interactive(in_order(rows.traces, order)) if rows is not None and comparison is not None else None
    figures = pictures(comparison, diagnosis, ladder, addition=addition, rows=rows)
    space = script() if figures.space else ""
    body = environment.get_template("page.html.j2").render(
        title=title,
        chart=chart,
        policy=policy([*(() if chart is None else chart.scripts), *([hash_of(space)] if space else ())]),
        space=space,
        stretches=STRETCHES,
        log=rows.log if rows is not None else "",
        verdict=_verdict(comparison, last, ladder, addition),
        judged=_judged(comparison, last),
        faults=_faults(comparison, last),
        pictures=figures,
        comparison=comparison,
        comparison_end=end,
        channels=_channel_table(comparison, ends),
        worst=next(iter(order), ""),
        shares=_shares(comparison),
        attitude=ladder.attitude if ladder is not None else comparison.attitude if comparison is not None else None,
        diagnosis=diagnosis,
        notes=tuple(dict.fromkeys(note for each in (comparison, diagnosis) if each is not None for note in each.notes)),
        standing=_candidate_table(standing),
        others=_candidate_table([item for item in candidates if item not in standing]),
        explanations=_explanations(standing, diagnosis),
        not_shown=len(diagnosis.candidates) - len(candidates) if diagnosis is not None else 0,
        final=last if last is not diagnosis else None,
        ladder=ladder,
        addition=addition,
        noise=noise_table(noise_of(ladder, diagnosis, rows)),
        fitted=parameter_table(fitted_parameters(ladder, addition)),
        next_steps=_next_steps(last, ladder),
    )
    return with_words(body, environment)


def _filling(picture: Picture, complete: Complete) -> Markup:
    """Return a figure that fills the page, drawn twice: for a desk and for a phone, whichever the reader has."""
    desk, phone = complete(picture), picture.draw(PHONE)
    caption, part = untitled(desk)
    _, whole = untitled(phone)
    return _figure(
        caption,
        Markup('<div class="desk">{}</div><div class="phone">{}</div>').format(
            inline_svg(desk, f"{picture.name}-desk", picture.description, part),
            inline_svg(phone, f"{picture.name}-phone", picture.description, whole),
        ),
    )


def _beside(picture: Picture, complete: Complete) -> Markup:
    """Return a figure with others beside it."""
    drawn = complete(picture)
    caption, part = untitled(drawn)
    return _figure(caption, inline_svg(drawn, picture.name, picture.description, part))


def _in_space(picture: Picture, complete: Complete) -> Markup:
    """Return a figure in space that the reader turns, with others beside it."""
    drawn = complete(picture)
    caption, part = untitled(drawn)
    return _figure(caption, turned(drawn, inline_svg(drawn, picture.name, picture.description, part)))


def _figure(caption: str, contents: Markup) -> Markup:
    head = Markup("<figcaption>{}</figcaption>").format(caption) if caption else Markup("")
    return Markup("<figure>{}{}</figure>").format(head, contents)


def _verdict(
    comparison: Comparison | None, diagnosis: Diagnosis | None, ladder: Ladder | None, addition: Addition | None
) -> dict[str, str]:
    """Return the word, the colour class and the sentence on top of the page."""
    if diagnosis is None:
        sentence = addition.sentence if addition else comparison.sentence if comparison else "There is nothing to show."
        return {"word": "added" if addition else "compared", "kind": "plain", "sentence": sentence}
    sentence = diagnosis.sentence or VERDICTS.get(diagnosis.verdict, "")
    if ladder is not None:
        sentence = ladder.sentence or sentence
    word = diagnosis.headline.lower()
    return {"word": word, "kind": _KINDS.get(word, "plain"), "sentence": sentence}


def _judged(comparison: Comparison | None, diagnosis: Diagnosis | None) -> Table | None:
    """Return which sensors were judged, and why others were not."""
    if diagnosis is not None and diagnosis.judged:
        rows = tuple((item.sensor, "yes" if item.judged else "no", item.reason or "") for item in diagnosis.judged)
    elif comparison is not None and comparison.sensors:
        rows = tuple((sensor, "yes", "") for sensor in comparison.sensors)
    else:
        return None
    if not any(reason for _, _, reason in rows):
        return Table("", ("sensor", "judged"), tuple(row[:2] for row in rows))
    return Table("", ("sensor", "judged", "reason"), rows)


def _channel_table(comparison: Comparison | None, ends: dict[str, float]) -> Table | None:
    """Return the residual by channel, with the ratio after the ladder beside that before."""
    if comparison is None:
        return None
    table = comparison.channel_table()
    if not ends:
        return table
    header = (*table.header[:2], ">after the ladder", *table.header[2:])
    rows = tuple((*row[:2], quantity.ratio(ends.get(row[0])), *row[2:]) for row in table.rows)
    return Table(table.title, header, rows)


def _shares(comparison: Comparison | None) -> dict[str, str]:
    """Return in words what each channel's residual depends on."""
    found: dict[str, str] = {}
    for panel in comparison.panels if comparison is not None else ():
        if math.isfinite(panel.share) and panel.share >= VISIBLE and panel.channel not in found:
            found[panel.channel] = f"{panel.covariate} {quantity.share(panel.share)}"
    return found


def _explanations(candidates: Sequence[Candidate], diagnosis: Diagnosis | None) -> list[Candidate]:
    """Return the best candidate and its rivals, where the answer's own sentence does not explain them."""
    named = [item for item in candidates if diagnosis is not None and _is_named(item, diagnosis)]
    return [item for item in named if item.explanation and diagnosis and item.explanation not in diagnosis.sentence]


def _is_named(candidate: Candidate, diagnosis: Diagnosis) -> bool:
    return candidate.effect == diagnosis.best or candidate.effect in diagnosis.ambiguous_with


def _stands_out(candidate: Candidate, diagnosis: Diagnosis | None) -> bool:
    """Return whether a candidate belongs to the answer: the best, its rivals, and what else is there."""
    return diagnosis is not None and (_is_named(candidate, diagnosis) or candidate.status == SIGNIFICANT)


def _candidate_table(candidates: Sequence[Candidate]) -> Table:
    """Return the candidates with their predicted parameters and rivals."""
    header = (
        "effect",
        "status",
        ">before → expected",
        ">probability",
        "predicted",
        "typical size",
        "smallest detectable",
    )
    rows = tuple(
        (
            item.effect,
            item.outcome,
            item.error_change,
            quantity.probability(item.probability),
            ", ".join(in_lines(item.parameters)) if item.status == SIGNIFICANT else "-",
            _typical(item),
            item.smallest_detectable,
            ", ".join(str(rival) for rival in item.confounded_with) or "-",
        )
        for item in candidates
    )
    return Table("", (*header, "smallest detectable", "rivals (correlation)"), rows)


def _typical(candidate: Candidate) -> str:
    """Return the typical sizes of the candidate's parameters on one line."""
    sizes = dict.fromkeys(
        quantity.quantity(item.typical, item.unit) for item in candidate.parameters if item.typical is not None
    )
    return ", ".join(sizes) or "-"


def _faults(comparison: Comparison | None, diagnosis: Diagnosis | None) -> dict[str, Any] | None:
    """Return table and sentences of the faults of the data."""
    from imufit.results.data_fault import fault_table  # noqa: PLC0415

    source = diagnosis or comparison
    faults = source.data_faults if source is not None else ()
    return {"table": fault_table(faults), "sentences": [item.sentence for item in faults]} if faults else None


def _next_steps(diagnosis: Diagnosis | None, ladder: Ladder | None) -> list[str]:
    """Return what to do after reading the page, in at most three sentences."""
    if diagnosis is None:
        return [f"Ask which effect is missing: `{command('diagnose')}`."]
    found = "; ".join(str(item) for item in diagnosis.unexplained)
    rivals = " and ".join(diagnosis.named)
    add = command("add", "Fit.add")
    steps = {
        "missing": f"Add {diagnosis.best} with `{add}`, or let `{command('ladder')}` go on until nothing is missing.",
        "unknown": f"Find what couples in here: {found}." if found else "Look at the worst segments.",
        "ambiguous": f"Record a log with another motion or temperature profile, so that {rivals} are separated.",
        "adequate": "Use the model as it stands. Record another log of this sensor to check it."
        if ladder is not None and ladder.steps
        else "The model describes this log down to its noise; a harder motion could show more.",
    }
    return _SENTENCE.split(diagnosis.experiment or steps.get(diagnosis.verdict, ""))[:_MOST_SENTENCES]
