"""``imufit diagnose``: which effect is missing."""

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
    plot_option,
    plots_option,
    title_of,
    verbose_option,
)
from imufit.cli.next_command import say_next
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import logs_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@logs_argument
@model_option
@json_option
@html_option
@plot_option
@plots_option
@verbose_option
def diagnose(
    logs: tuple[Path, ...],
    *,
    reading: Reading,
    model: Path | None,
    json_file: Path | None,
    html_file: Path | None,
    plot_file: Path | None,
    plots: Path | None,
    verbose: bool,
) -> None:
    """Name the effect that is missing in the model of LOG, or state that none is, or that LOG does not determine it.

    Several LOGs of one sensor are diagnosed together: effects are the same in all of them, each has its own bias and
    mount, and a log that disagrees is named.

    A LOG without reference attitude is judged by its rests, the turns between them and the length of the magnetic
    field; six poses labelled in the column pose are enough. The answer lists the effects that such a log cannot show.
    """
    keep_inputs([*logs, model], [json_file, html_file, plot_file])
    output = Output(json_file)
    with ProgressBar() as progress:
        opened = engine.open_logs(logs, reading)
        fit = engine.sensor_model(path=model).fit(opened, progress=progress)
        diagnosis = fit.diagnose(progress=progress)
        shown = html_file is not None or plots is not None
        comparison = fit.compare(progress=progress) if shown else None
        rows = engine.rows_of_fit(fit, candidate=diagnosis.best, progress=progress) if shown else None
    output.result(diagnosis, verbose)
    if diagnosis.verdict == "missing":
        words = "to add the effect, or to go on until nothing is missing"
        say_next(output, words, [f"add {diagnosis.best}", "ladder"], logs, model)
    output.json(diagnosis.to_dict())
    if plot_file is not None:
        output.plot(plot_file, diagnosis.plot())
    title = f"{title_of(logs)}: which effect is missing"
    output.report(html_file, plots, title, comparison=comparison, diagnosis=diagnosis, rows=rows)
