"""``imufit fit``: fit a stack of effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import json_option, keep_inputs, model_option, model_output, plot_option
from imufit.cli.names import check_effects, complete_effect, unknown
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import logs_argument
from imufit.cli.settings import number_of

if TYPE_CHECKING:
    from imufit.log import Reading
    from imufit.loop import SensorModel


@click.command()
@logs_argument
@click.option(
    "--effects",
    multiple=True,
    metavar="ID,ID,...",
    shell_complete=complete_effect,
    help="Effects of the model, in any order.",
)
@click.option(
    "--fix",
    "fixed",
    multiple=True,
    metavar="EFFECT.PARAM=VALUE",
    help="Keep this parameter at this value, in SI units, e.g. gyr.bias.x=0.01. Repeatable.",
)
@model_option
@model_output
@json_option
@plot_option
def fit(
    logs: tuple[Path, ...],
    *,
    reading: Reading,
    effects: tuple[str, ...],
    fixed: tuple[str, ...],
    model: Path | None,
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Fit the parameters of the given effects to LOG, or to several LOGs of one sensor together.

    Effects of MODEL are fitted too, from the values there; what is fixed there stays.
    """
    from imufit.figures import quantity  # noqa: PLC0415
    from imufit.results.log_parameters import log_table  # noqa: PLC0415
    from imufit.results.parameter import drawn_parameters, parameter_table  # noqa: PLC0415

    keep_inputs([*logs, model], [output, json_file, plot_file])
    names = [name.strip() for text in effects for name in text.split(",") if name.strip()]
    if not names and model is None:
        raise click.UsageError(
            "name the effects to fit, such as --effects acc.bias,gyr.bias, or a --model that has some; "
            "`imufit diagnose` finds out which effect is missing"
        )
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise click.UsageError(f"--effects names {repeated[0]} twice")
    check_effects(names)
    values = _values(fixed)
    out = Output(json_file)
    with ProgressBar() as progress:
        start = engine.sensor_model(names, model)
        _fix(start, values)
        fitted = start.fit(engine.open_logs(logs, reading), progress=progress)
    found = fitted.to_dict()
    stack = " + ".join(found["model"])
    out.say(f"{stack}: residual {quantity.ratio(fitted.ratio)} times the noise floor.", bold=True)
    out.table(parameter_table(fitted.parameters, "Fitted parameters"))
    out.table(log_table(fitted.by_log))
    if output is not None:
        fitted.save(output)
        out.wrote(output)
    out.json(found)
    if plot_file is not None:
        out.plot(plot_file, drawn_parameters(fitted.parameters).root)


def _values(texts: Sequence[str]) -> dict[str, float]:
    """Read texts such as ``gyr.bias.x=0.01``."""
    values: dict[str, float] = {}
    for text in texts:
        key, equals, given = (part.strip() for part in text.partition("="))
        if not (equals and key and given):
            raise click.UsageError(f"--fix {text!r}: write EFFECT.PARAM=VALUE, such as gyr.bias.x=0.01")
        values[key] = number_of("--fix", text, given)
    return values


def _fix(model: SensorModel, values: Mapping[str, float]) -> None:
    """Keep parameters at given values."""
    for key, value in values.items():
        if key not in model.params:
            raise click.UsageError(f"--fix: {unknown('parameter of this model', key, model.params)}")
        model.params[key].set(value, vary=False)
