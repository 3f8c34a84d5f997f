"""``imufit calibrate``: paper A's calibration, and what it is worth."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import EXISTING, json_option, keep_inputs, map_option, model_output, plot_option
from imufit.cli.output import Output


@click.command(short_help="Calibrate accelerometer, gyro and magnetometer.")
@click.argument("logs", metavar="LOG...", type=EXISTING, nargs=-1, required=True)
@map_option
@click.option(
    "--cost",
    type=click.Choice(["vector", "magnitude"]),
    help="vector: six sides up on a level table, 12 unknowns. magnitude: nine or more attitudes, 9 unknowns.",
)
@click.option(
    "--sensor",
    "sensors",
    type=click.Choice(["acc", "gyr", "mag"]),
    multiple=True,
    help="Calibrate this sensor only. Repeatable.",
)
@click.option(
    "--hold", type=click.FloatRange(min=0.0, min_open=True), metavar="S", help="Shortest pose, s (default 0.6)."
)
@model_output
@json_option
@plot_option
def calibrate(
    logs: tuple[Path, ...],
    *,
    mapping: tuple[str, ...],
    cost: str | None,
    sensors: tuple[str, ...],
    hold: float | None,
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Calibrate a sensor from one or several LOGs of it.

    The accelerometer from poses at rest (labelled in the column `pose`, or found), the gyro from the rests and the
    turns between them, the magnetometer from free rotation.
    """
    keep_inputs(logs, [output, json_file, plot_file])
    out = Output(json_file)
    read = [engine.read_log(path, mapping) for path in logs]
    result = engine.calibrate(read, cost, sensors, {} if hold is None else {"hold": hold})
    for sensor in result.sensors.values():
        out.say(sensor.sentence(), bold=True)
    remarks = [remark for sensor in result.sensors.values() for remark in sensor.remarks]
    out.say(*remarks, *result.notes)
    out.tables([result.pose_table(), result.correction_table()])
    if output is not None:
        result.save(output)
        out.wrote(output)
    out.json(result.to_dict())
    if plot_file is not None:
        out.plot(plot_file, result.plot(read))
