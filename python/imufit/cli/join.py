"""``imufit join``: a sensor's log and somebody else's reference become one log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, OutputFile, json_option, keep_inputs, plot_option
from imufit.cli.output import Output
from imufit.cli.reading import LOG, reading_options
from imufit.whole_file import identity

if TYPE_CHECKING:
    from imufit.log import Reading


class AttitudeColumns(click.ParamType):  # type: ignore[type-arg]
    """A kind of attitude and its columns, such as ``euler-ZYX:yaw[deg],pitch[deg],roll[deg]``."""

    name = "attitude"

    def convert(
        self,
        value: str | tuple[str, tuple[str, ...]],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[str, tuple[str, ...]]:
        """Take kind and columns apart."""
        if isinstance(value, tuple):
            return value
        return engine.declared_attitude(value)


@click.command()
@click.argument("sensor", metavar="SENSOR", type=LOG)
@click.argument("reference", metavar="REFERENCE", type=LOG)
@reading_options
@click.option(
    "--reference-map",
    "reference_mapping",
    multiple=True,
    metavar="COL=NAME[unit]",
    help="The same for the columns of REFERENCE, e.g. ref_qw=w. Repeatable. Where REFERENCE is SENSOR, --map holds.",
)
@click.option(
    "--reference-drop", multiple=True, metavar="COLUMN", help="Leave this column of REFERENCE out. Repeatable."
)
@click.option(
    "--attitude",
    type=AttitudeColumns(),
    metavar="KIND:COLUMNS",
    help="Columns that hold the attitude, where names and rates do not show them: quaternion:W,X,Y,Z, "
    "matrix:XX,XY,...,ZZ (row by row), "
    "euler-ZYX:YAW[deg],PITCH[deg],ROLL[deg] (capitals: about the turned axes), angle-x:ANGLE[deg], angle:ANGLE[deg] "
    "where the axis is not known.",
)
@click.option("--inverse", is_flag=True, help="The attitude turns vectors of the reference frame into the body.")
@click.option("--lag", type=float, metavar="S", help="Delay of the reference's stamps, if known.")
@click.option("--skew", type=float, metavar="PPM", help="Rate by which the reference's clock is fast, if known.")
@click.option("-o", "--output", type=OutputFile(LOG_ENDINGS), required=True, metavar="LOG", help="Log to write.")
@json_option
@plot_option
def join(
    sensor: Path,
    reference: Path,
    *,
    reading: Reading,
    reference_mapping: tuple[str, ...],
    reference_drop: tuple[str, ...],
    attitude: tuple[str, tuple[str, ...]] | None,
    inverse: bool,
    lag: float | None,
    skew: float | None,
    output: Path,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Join the attitude, the angle or the positions of REFERENCE to the readings of SENSOR, with another clock.

    The lag is found by the angular rates of both, with any axes of the sensor on the body; then lag, skew and
    mount are refined on the attitude. LOG has all rows of SENSOR and, in rows of their own, all samples of REFERENCE.
    """
    keep_inputs([sensor, reference], [output, json_file, plot_file])
    out = Output(json_file)
    log = engine.read_log(sensor, reading)
    if not reference_mapping and identity(reference) == identity(sensor):
        # One log whose reference is late: its columns are the same, whoever asks for them.
        own = reading
    else:
        own = engine.reading(reference_mapping, reading.frame, (), reference_drop)
    other = engine.reference_log(reference, own, attitude, inverse)
    found = engine.join(log, other, lag, None if skew is None else 1e-6 * skew)
    engine.write_log(found.log, output)
    out.say(found.sentence, bold=True)
    out.tables(found.tables())
    out.say(*found.remarks, *(f"{note}." for note in found.log.notes[len(log.notes) :]))
    out.wrote(output)
    out.json({"log": str(output), **found.to_dict()})
    if plot_file is not None:
        out.plot(plot_file, found.plot())
