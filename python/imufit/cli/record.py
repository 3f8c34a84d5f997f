"""``imufit record``: from a serial device to a log."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, OutputFile, json_option, keep_inputs
from imufit.cli.names import OneOf
from imufit.cli.output import Output
from imufit.cli.port import duration_option, frame_option, port_argument
from imufit.cli.reading import map_option


@click.command()
@port_argument
@map_option
@click.option("-o", "--output", type=OutputFile(LOG_ENDINGS), required=True, metavar="LOG", help="Log to write.")
@frame_option
@duration_option
@click.option(
    "--angle",
    metavar="ANGLE",
    help="Commanded angle of a one-axis rig, e.g. 5deg: the column ref_angle. While it runs, type the next angle and "
    "Enter; type only Enter while the rig moves.",
)
@click.option("--axis", type=OneOf("axis", ("x", "y", "z")), help="Body axis about which the rig turns.")
@click.option("--force", is_flag=True, help="Overwrite LOG if it exists already.")
@click.option("--quiet", is_flag=True, help="No status line and no messages of the device.")
@json_option
def record(
    port: str,
    *,
    baud: int,
    form: str,
    header: str | None,
    mapping: tuple[str, ...],
    output: Path,
    frame: str,
    duration: float | None,
    give_up: float | None,
    angle: str | None,
    axis: str | None,
    force: bool,
    quiet: bool,
    json_file: Path | None,
) -> None:
    """Record the device on PORT until Ctrl-C: /dev/ttyUSB0, COM3, a pseudo-terminal or socket://HOST:PORT.

    The device uses the wire protocol, binary or text. While it runs, rows go to LOG.part; `imufit recover` makes a
    log of it after a crash. A line that is lost is opened again, and the gap is marked.
    """
    keep_inputs([], [output, json_file])
    out = Output(json_file)
    if (angle is None) != (axis is None):
        raise click.UsageError("--angle and --axis belong together, e.g. --angle 5deg --axis x")
    with engine.status_line(mapping, quiet, frame=frame) as status:
        rig = None if angle is None or axis is None else engine.rig(axis, angle, status.say)
        result = engine.record(
            port,
            output,
            mapping,
            baud=baud,
            form=form,
            header=header,
            frame=frame,
            duration=duration,
            give_up=give_up,
            force=force,
            watch=status,
            rig=rig,
        )
    out.say(result.sentence, bold=True)
    out.say(*result.sentences()[1:])
    out.table(result.gap_table())
    out.wrote(output)
    out.json(result.to_dict())
