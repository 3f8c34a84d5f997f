"""``imufit fit``: fit a stack of effects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import effects_from_option, json_option, keep_inputs, model_output, plot_option
from imufit.cli.names import check_effects, complete_effect
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import logs_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@logs_argument
@click.option(
    "--effects",
    required=True,
    multiple=True,
    metavar="ID,ID,...",
    shell_complete=complete_effect,
    help="Effects of the model, in any order.",
)
@effects_from_option
@model_output
@json_option
@plot_option
def fit(
    logs: tuple[Path, ...],
    *,
    reading: Reading,
    effects: tuple[str, ...],
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Fit the parameters of the given effects to LOG, or to several LOGs of one sensor together."""
    from imufit.figures import quantity  # noqa: PLC0415
    from imufit.results.log_parameters import log_table  # noqa: PLC0415
    from imufit.results.parameter import parameter_table, plot_parameters  # noqa: PLC0415

    keep_inputs(logs, [output, json_file, plot_file])
    names = [name.strip() for text in effects for name in text.split(",") if name.strip()]
    if not names:
        raise click.UsageError("--effects names no effect")
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise click.UsageError(f"--effects names {repeated[0]} twice")
    check_effects(names)
    out = Output(json_file)
    with ProgressBar() as progress:
        fitted = engine.sensor_model(names).fit(engine.open_logs(logs, reading), progress=progress)
    out.say(f"{' + '.join(names)}: residual {quantity.ratio(fitted.ratio)} times the noise floor.", bold=True)
    out.table(parameter_table(fitted.parameters, "Fitted parameters"))
    out.table(log_table(fitted.by_log))
    if output is not None:
        fitted.save(output)
        out.wrote(output)
    out.json(fitted.to_dict())
    if plot_file is not None:
        out.plot(plot_file, plot_parameters(fitted.parameters))
