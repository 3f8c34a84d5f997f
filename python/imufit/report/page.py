"""The page: verdict, where, which, the error falling, what to do next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from imufit.figures import quantity
from imufit.remedy import command
from imufit.report.inline_svg import inline_svg
from imufit.report.words import with_words
from imufit.results.comparison import MOST_PANELS, Panel, drawn_panels
from imufit.results.diagnosis import VERDICTS
from imufit.results.parameter import in_lines, parameter_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from imufit.results import Addition, Candidate, Comparison, Diagnosis, Ladder

_COVARIATES = 6
_PANELS_AT_FIRST = 8
_CANDIDATES = 20
_WORST = {"missing": "warn", "ambiguous": "warn", "unknown": "stop", "adequate": "good"}


def page(
    comparison: Comparison | None = None,
    diagnosis: Diagnosis | None = None,
    ladder: Ladder | None = None,
    *,
    addition: Addition | None = None,
    title: str = "Sensor model report",
) -> str:
    """Write results as one HTML page that needs no network.

    Parameters
    ----------
    comparison, diagnosis, ladder, addition : optional
        Whatever there is to show. A ladder brings its own comparison and diagnosis, which those given here replace.
    title : str
        Heading, for instance the log's name.

    Returns
    -------
    str
        The page; figures are inline SVG.
    """
    final = None
    if ladder is not None:
        comparison = comparison or ladder.comparison_start
        diagnosis = diagnosis or ladder.first or ladder.diagnosis
        final = ladder.diagnosis if diagnosis is not ladder.diagnosis else None
    environment = Environment(
        loader=PackageLoader("imufit.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(q=quantity, svg=inline_svg, in_lines=in_lines, plot_panels=_panels)
    by_covariate = _by_covariate(comparison)
    last = ladder.diagnosis if ladder is not None else diagnosis
    body = environment.get_template("page.html.j2").render(
        title=title,
        verdict=_verdict(comparison, last, ladder, addition),
        comparison=comparison,
        comparison_end=ladder.comparison_end if ladder is not None else None,
        channels_end=_ratios(ladder.comparison_end if ladder is not None else None),
        worst=_worst(comparison),
        by_covariate=by_covariate[:_COVARIATES],
        other_covariates=[(name, share) for name, share, _ in by_covariate[_COVARIATES:]],
        panels_at_first=_PANELS_AT_FIRST,
        diagnosis=diagnosis,
        candidates=_candidates(diagnosis),
        final=final,
        ladder=ladder,
        addition=addition,
        fitted=_fitted(ladder, addition),
        faults=_faults(comparison, last),
        next_step=_next_step(last, ladder),
    )
    return with_words(body, environment)


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
    return {"word": diagnosis.verdict, "kind": _WORST.get(diagnosis.verdict, "plain"), "sentence": sentence}


def _ratios(comparison: Comparison | None) -> dict[str, float]:
    """Return each channel's ratio."""
    return {item.channel: item.ratio for item in comparison.channels} if comparison else {}


def _worst(comparison: Comparison | None) -> str:
    """Return the channel furthest over its floor."""
    ratios = {name: value for name, value in _ratios(comparison).items() if math.isfinite(value)}
    return max(ratios, key=ratios.__getitem__) if ratios else ""


def _by_covariate(comparison: Comparison | None) -> list[tuple[str, float, list[Panel]]]:
    """Return (covariate, largest share, its panels), the worst covariate first."""
    groups: dict[str, list[Panel]] = {}
    for panel in comparison.panels if comparison else ():
        groups.setdefault(panel.covariate, []).append(panel)
    listed = [
        (name, max((item.share for item in panels if math.isfinite(item.share)), default=0.0), panels)
        for name, panels in groups.items()
    ]
    return sorted(listed, key=lambda group: -group[1])


def _candidates(diagnosis: Diagnosis | None) -> list[tuple[Candidate, Markup]]:
    """Return the candidates with their typical sizes, as the ranked table shows them."""
    return [(item, _typical(item)) for item in (diagnosis.candidates if diagnosis else ())[:_CANDIDATES]]


def _typical(candidate: Candidate) -> Markup:
    """Return the typical sizes of the candidate's parameters on one line."""
    sizes = dict.fromkeys(
        quantity.quantity(item.typical, item.unit) for item in candidate.parameters if item.typical is not None
    )
    return Markup.escape(", ".join(sizes) or "-")


def _panels(panels: Sequence[Panel], limit: int = MOST_PANELS) -> Figure:
    """Return the figure of the worst panels."""
    return drawn_panels(panels, limit=limit).root


def _faults(comparison: Comparison | None, diagnosis: Diagnosis | None) -> dict[str, Any] | None:
    """Return table and sentences of the faults of the data."""
    from imufit.results.data_fault import fault_table  # noqa: PLC0415

    source = diagnosis or comparison
    faults = source.data_faults if source is not None else ()
    return {"table": fault_table(faults), "sentences": [item.sentence for item in faults]} if faults else None


def _fitted(ladder: Ladder | None, addition: Addition | None) -> dict[str, Any] | None:
    """Return table and figure of the final model's parameters."""
    if addition is not None:
        parameters = tuple(addition.parameters)
    else:
        parameters = tuple(getattr(ladder.fit, "parameters", ()) or ()) if ladder is not None else ()
    if not parameters:
        return None
    from imufit.results.parameter import drawn_parameters  # noqa: PLC0415

    return {"table": parameter_table(parameters), "figure": drawn_parameters(parameters).root}


def _next_step(diagnosis: Diagnosis | None, ladder: Ladder | None) -> str:
    """Return what to do after reading the page."""
    if diagnosis is None:
        return f"Ask which effect is missing: `{command('diagnose')}`."
    found = "; ".join(str(item) for item in diagnosis.unexplained)
    rivals = " and ".join(diagnosis.ambiguous_with)
    add = command("add", "Fit.add")
    steps = {
        "missing": f"Add {diagnosis.best} with `{add}`, or let `{command('ladder')}` go on until nothing is missing.",
        "unknown": f"Find what couples in here: {found}." if found else "Look at the worst segments.",
        "ambiguous": f"Record a log with another motion or temperature profile, so that {rivals} are separated.",
        "adequate": "Use the model as it stands. Record another log of this sensor to check it."
        if ladder is not None and ladder.steps
        else "The model describes this log down to its noise; a harder motion could show more.",
    }
    return diagnosis.experiment or steps.get(diagnosis.verdict, "")
