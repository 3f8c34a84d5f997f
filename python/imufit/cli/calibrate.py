"""``imufit calibrate``: paper A's calibration, from logs or on a running device, and what it is worth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import (
    LOG_ENDINGS,
    OutputFile,
    Real,
    Whole,
    json_option,
    keep_inputs,
    model_output,
    plot_option,
)
from imufit.cli.live_screen import LiveScreen
from imufit.cli.names import OneOf
from imufit.cli.output import Output
from imufit.cli.reading import LOG, reading_options

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@click.argument("logs", metavar="LOG...", type=LOG, nargs=-1)
@reading_options
@click.option(
    "--cost",
    type=OneOf("cost", ("vector", "magnitude")),
    help="vector: six sides up on a level table, 12 unknowns. magnitude: nine or more attitudes, 9 unknowns.",
)
@click.option(
    "--sensor",
    "sensors",
    type=OneOf("sensor", ("acc", "gyr", "mag")),
    multiple=True,
    help="Calibrate this sensor only. Repeatable.",
)
@click.option("--hold", type=Real(min=0.0, min_open=True), metavar="S", help="Shortest pose, s (default 0.6).")
@click.option("--live", "port", metavar="PORT", help="Guide through a calibration of the device there.")
@click.option("--baud", type=Whole(min=1), metavar="BAUD", help="Bits per second of PORT (default 115200).")
@click.option("--form", type=OneOf("form", ("auto", "binary", "text")), help="Form that PORT sends (default auto).")
@click.option("--header", metavar="NAMES", help="Columns of text without a header, such as t_ms,acc_x,acc_y,acc_z.")
@click.option(
    "--keep",
    type=OutputFile(LOG_ENDINGS),
    metavar="LOG",
    help="Log that keeps the rows of PORT (default: beside the model, .parquet).",
)
@click.option(
    "--rests", type=Whole(min=6), metavar="N", help="Good rests required of PORT, the six sides among them (6)."
)
@click.option(
    "--give-up",
    type=Real(min=0.0, min_open=True),
    metavar="S",
    help="End after so long without anything new from PORT, s (default 300).",
)
@model_output
@json_option
@plot_option
def calibrate(
    logs: tuple[Path, ...],
    *,
    reading: Reading,
    cost: str | None,
    sensors: tuple[str, ...],
    hold: float | None,
    port: str | None,
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
    **live: Any,
) -> None:
    """Calibrate a sensor from one or several LOGs of it, or a running device with --live PORT.

    The accelerometer from poses at rest (labelled in the column `pose`, or found), the gyro from the rests and the
    turns between them, the magnetometer from free rotation. On a running device the terminal states which side to lay
    up next; a key press is not needed, and the rows are kept as a log.
    """
    out = Output(json_file)
    settings = {} if hold is None else {"hold": hold}
    given = {name: value for name, value in live.items() if value is not None}
    if port is None:
        if given:
            raise click.UsageError(f"--{next(iter(given)).replace('_', '-')} is for --live PORT")
        if not logs:
            raise click.UsageError("name a LOG, or a device with --live PORT")
        keep_inputs(logs, [output, json_file, plot_file])
        read = [engine.read_log(path, reading) for path in logs]
        result = engine.calibrate(read, cost, sensors, settings)
    else:
        if logs:
            raise click.UsageError("calibrate either a LOG or a device with --live PORT")
        if reading.frame or reading.noise or reading.drop:
            raise click.UsageError("--frame, --noise and --drop are for a LOG, not for --live PORT")
        keep = _place_of(given.pop("keep", None), output)
        keep_inputs([], [output, json_file, plot_file, keep])
        with LiveScreen(quiet=str(json_file) == "-") as screen:
            result, log = engine.calibrate_live(
                port, keep, reading.mapping, cost=cost, sensors=sensors, settings=settings, show=screen, **given
            )
        read = [log]
        out.wrote(keep)
    for sensor in result.sensors.values():
        out.say(sensor.sentence(), bold=True)
    remarks = [remark for sensor in result.sensors.values() for remark in sensor.remarks]
    out.say(*remarks, *result.notes, *(f"Note: {note}." for log in read for note in log.notes))
    out.tables([result.pose_table(), result.correction_table()])
    if output is not None:
        result.save(output)
        out.wrote(output)
    out.json(result.to_dict())
    if plot_file is not None:
        out.plot(plot_file, result.plot(read))


def _place_of(keep: Path | None, model: Path | None) -> Path:
    """Return where the log goes: where stated, or beside the model by a name that is free."""
    if keep is not None:
        return keep
    if model is None:
        raise click.UsageError("the rows of PORT must be kept: name a model with -o, or a log with --keep")
    path, number = model.with_suffix(".parquet"), 1
    while path.exists():
        number += 1
        path = model.with_name(f"{model.stem}-{number}.parquet")
    return path
