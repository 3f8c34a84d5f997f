"""``imufit compare``: where the model fails."""

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
    verbose_option,
)
from imufit.cli.next_command import say_next
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import log_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@log_argument
@model_option
@json_option
@html_option
@plot_option
@plots_option
@verbose_option
def compare(
    log: Path,
    *,
    reading: Reading,
    model: Path | None,
    json_file: Path | None,
    html_file: Path | None,
    plot_file: Path | None,
    plots: Path | None,
    verbose: bool,
) -> None:
    """Compare the model with LOG: channel by channel, segment by segment, over every covariate."""
    keep_inputs([log, model], [json_file, html_file, plot_file])
    output = Output(json_file)
    with ProgressBar() as progress:
        opened = engine.open_log(log, reading)
        held = engine.sensor_model(path=model)
        rows = None
        if html_file is None and plots is None:
            comparison = held.compare(opened, progress=progress)
        else:
            comparison, rows = engine.compare_with_rows(held, opened, progress)
    output.result(comparison, verbose)
    if comparison.failing:
        say_next(output, "to look for the effect that is missing", ["diagnose"], [log], model)
    output.json(comparison.to_dict())
    if plot_file is not None:
        output.plot(plot_file, comparison.plot())
    output.report(html_file, plots, f"{log.name}: where the model fails", comparison=comparison, rows=rows)
