"""``imufit apply``: readings corrected with a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import (
    EXISTING,
    LOG_ENDINGS,
    MODEL_ENDINGS,
    OutputFile,
    effects_from_option,
    json_option,
    keep_inputs,
)
from imufit.cli.output import Output
from imufit.cli.reading import log_argument

if TYPE_CHECKING:
    from imufit.log import Reading
    from imufit.loop import SensorModel


@click.command()
@click.argument("model", metavar="MODEL", type=EXISTING)
@log_argument
@effects_from_option
@click.option(
    "-o", "--output", type=OutputFile(LOG_ENDINGS), required=True, metavar="OUT", help="Write the corrected log."
)
@json_option
def apply(model: Path, log: Path, *, reading: Reading, output: Path, json_file: Path | None) -> None:
    """Remove the effects of MODEL from the readings of LOG.

    OUT has the columns of imufit's logs in their units: t in s, acc in m/s^2, gyr in rad/s, mag in uT. It has every row
    of LOG and, as they are, the columns that imufit does not know.
    """
    from imufit.figures import quantity  # noqa: PLC0415
    from imufit.results import Table  # noqa: PLC0415

    keep_inputs([model, log], [output, json_file])
    out = Output(json_file)
    stack = _first_argument(model)
    recorded = engine.read_log(log, reading)
    corrected = stack.apply(recorded)
    changes = engine.changes(recorded, corrected)
    out.say(f"{corrected.n} rows: {' + '.join(stack.effects) or 'no effect'} taken out.", bold=True)
    rows = tuple(
        (
            name,
            str(change["n"]),
            quantity.quantity(change["rms"], change["unit"]),
            quantity.quantity(change["max"], change["unit"]),
        )
        for name, change in changes.items()
    )
    out.table(Table("Change of the readings", ("sensor", ">samples", ">RMS", ">largest"), rows))
    out.say(*(f"Note: {note}." for note in corrected.notes))
    engine.write_log(corrected, output)
    out.wrote_log(output, corrected.columns)
    out.json({"n": corrected.n, "model": list(stack.effects), "change": changes, "notes": list(corrected.notes)})


def _first_argument(path: Path) -> SensorModel:
    """Read the model; of a file that does not end as a model does say what the first argument must be."""
    from imufit.errors import InputError  # noqa: PLC0415

    try:
        found: SensorModel = engine.sensor_model(path=path)
    except InputError as error:
        if path.suffix.lower() in MODEL_ENDINGS:
            raise
        order = "The first argument must be the model, the second the log: imufit apply MODEL LOG."
        raise InputError(error.problem, file=path, line=error.line, remedy=order) from None
    return found
