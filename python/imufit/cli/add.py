"""``imufit add``: put an effect into the model and see what it brings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import (
    html_option,
    json_option,
    keep_inputs,
    model_option,
    model_output,
    plot_option,
    plots_option,
    title_of,
)
from imufit.cli.names import check_effects, complete_effect
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import logs_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@click.argument("effect", metavar="EFFECT", shell_complete=complete_effect)
@logs_argument
@click.option(
    "--then",
    "others",
    multiple=True,
    metavar="EFFECT",
    shell_complete=complete_effect,
    help="A further effect, added after the one before. Repeatable.",
)
@model_option
@model_output
@json_option
@html_option
@plot_option
@plots_option
def add(
    effect: str,
    logs: tuple[Path, ...],
    *,
    reading: Reading,
    others: tuple[str, ...],
    model: Path | None,
    output: Path | None,
    json_file: Path | None,
    html_file: Path | None,
    plot_file: Path | None,
    plots: Path | None,
) -> None:
    """Add EFFECT to the model of LOG, refit, and show the held-out error before, as expected and after.

    Several LOGs of one sensor are fitted together.
    """
    keep_inputs(logs, [output, json_file, html_file, plot_file])
    check_effects([effect, *others])
    out = Output(json_file)
    with ProgressBar() as progress:
        opened = engine.open_logs(logs, reading)
        fit = engine.sensor_model(path=model).fit(opened, progress=progress)
        additions = [fit.add(effect, progress=progress)]
        for other in others:
            additions.append(additions[-1].fit.add(other, progress=progress))
        addition = additions[-1]
        fit = additions[-2].fit if others else fit
        shown = html_file is not None or plots is not None
        comparison = fit.compare(progress=progress) if shown else None
        rows = engine.rows_of_fit(addition.fit, fit, progress=progress) if shown else None
    for made in additions:
        out.say(made.sentence, bold=True)
        out.say(made.warning)
    out.tables(addition.tables())
    if output is not None:
        addition.fit.save(output)
        out.wrote(output)
    out.json(addition.to_dict())
    if plot_file is not None:
        out.plot(plot_file, addition.plot())
    title = f"{title_of(logs)}: {' and '.join([effect, *others])} added"
    out.report(html_file, plots, title, comparison=comparison, addition=addition, rows=rows)
