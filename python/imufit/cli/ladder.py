"""``imufit ladder``: add what is missing until nothing is."""

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
    verbose_option,
)
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import logs_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@logs_argument
@model_option
@model_output
@json_option
@html_option
@plot_option
@plots_option
@verbose_option
def ladder(
    logs: tuple[Path, ...],
    *,
    reading: Reading,
    model: Path | None,
    output: Path | None,
    json_file: Path | None,
    html_file: Path | None,
    plot_file: Path | None,
    plots: Path | None,
    verbose: bool,
) -> None:
    """Add the missing effects one by one to the model of LOG, and show the held-out error fall.

    Several LOGs of one sensor make one ladder: effects are the same in all of them, each has its own bias and mount.
    """
    keep_inputs(logs, [output, json_file, html_file, plot_file])
    out = Output(json_file)
    with ProgressBar() as progress:
        opened = engine.open_logs(logs, reading)
        start = engine.sensor_model(path=model) if model is not None else None
        result = engine.ladder(opened, start, progress)
        shown = html_file is not None or plots is not None
        rows = engine.rows_of_fit(result.fit, result.start, progress=progress) if shown else None
    out.result(result, verbose)
    if output is not None:
        result.fit.save(output)
        out.wrote(output)
    out.json(result.to_dict())
    if plot_file is not None:
        out.plot(plot_file, result.plot())
    out.report(html_file, plots, f"{title_of(logs)}: the error ladder", ladder=result, rows=rows)
