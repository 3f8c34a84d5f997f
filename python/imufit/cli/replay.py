"""``imufit replay``: attitude filters over a log, and the methods beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import (
    EXISTING,
    LOG_ENDINGS,
    OutputFile,
    Real,
    effects_from_option,
    json_option,
    keep_inputs,
    plot_option,
)
from imufit.cli.names import FILTERS, KnownList
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import log_argument
from imufit.cli.settings import set_option, settings_from

if TYPE_CHECKING:
    from imufit.log import Reading
    from imufit.results import Table

_MADE = 100
"""Bytes that a filter makes of a row: attitude, angles and errors."""


@click.command()
@log_argument
@click.option(
    "--filter",
    "filters",
    multiple=True,
    type=KnownList("filter", lambda: FILTERS),
    metavar="NAME[,NAME...]",
    help=f"Out of {', '.join(FILTERS)}. Repeatable; without it all that the log allows.",
)
@click.option(
    "--model", "model_file", type=EXISTING, metavar="MODEL", help="Remove its effects from the readings first."
)
@effects_from_option
@set_option
@click.option(
    "--settings",
    "settings_file",
    type=EXISTING,
    metavar="FILE.toml",
    help="Settings as `imufit tune -o` and `imufit allan --settings` write them; --set overrides them.",
)
@click.option(
    "--band",
    type=Real(min=0.0, min_open=True),
    default=0.1,
    show_default=True,
    metavar="DEG",
    help="Band in which a tilt counts as settled.",
)
@click.option(
    "--memory",
    type=Real(min=1.0, max=1000.0),
    default=1.0,
    show_default=True,
    metavar="GB",
    help="Memory that a long log and its attitudes may take.",
)
@click.option(
    "-o",
    "--output",
    type=OutputFile(LOG_ENDINGS),
    metavar="OUT",
    help="Write the log with the attitudes added: quaternions, and roll, pitch, yaw in rad.",
)
@json_option
@plot_option
def replay(
    log: Path,
    *,
    reading: Reading,
    filters: tuple[tuple[str, ...], ...],
    model_file: Path | None,
    assignments: tuple[str, ...],
    settings_file: Path | None,
    band: float,
    memory: float,
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Run attitude filters over LOG; where it has a reference, give their errors, else their angles.

    For a rig with one axis (metadata rig_axis) the error of the angle about that axis, else of the whole attitude and
    of the inclination: RMSE, offset, standard deviation, drift, noise density, settling time, gain on vibration, and
    ranks of the methods.
    """
    keep_inputs([log, model_file, settings_file], [output, json_file, plot_file])
    names = tuple(dict.fromkeys(name for group in filters for name in group))
    settings = {} if settings_file is None else engine.read_settings(settings_file)
    for group, values in settings_from(assignments).items():
        settings[group] = {**settings.get(group, {}), **values}
    out = Output(json_file)
    rows = engine.read_log(log, reading, _MADE * len(names or FILTERS), memory, "--memory")
    if model_file is None:
        out.say(*(f"Note: {note}." for note in rows.notes))
    else:
        model = engine.sensor_model(path=model_file)
        rows = model.apply(rows)
        out.say(f"{' + '.join(model.effects) or 'No effect'} taken out.", *(f"Note: {note}." for note in rows.notes))
    with ProgressBar(counted=True) as progress:
        result = engine.replay(rows, names, progress, settings)
    compared = result.comparison(band)
    value = result.to_dict(compared)
    out.say(f"{value['n']} rows replayed.", bold=True)
    out.say(*(f"{count} rows skipped: {reason}." for reason, count in value.get("skipped", {}).items() if count))
    if all(errors is None for errors in value["filters"].values()):
        out.say(result.frame_words())
        out.table(result.angle_table())
    elif compared is None or compared.axis is None:
        out.table(_attitude_table(value))
    if compared is not None:
        out.tables(compared.tables())
        out.say(*compared.notes)
    if output is not None:
        replayed = result.to_log()
        engine.write_log(replayed, output)
        out.wrote_log(output, replayed.columns, "roll, pitch and yaw of each filter")
    out.json(value)
    if plot_file is not None:
        out.plot(plot_file, result.plot())


def _attitude_table(value: dict[str, Any]) -> Table:
    """Errors of the whole attitude, one row per filter."""
    from imufit.figures import quantity  # noqa: PLC0415
    from imufit.results import Table  # noqa: PLC0415

    columns = ("total", "heading", "inclination", "roll", "pitch", "yaw", "sd")
    rows = tuple(
        (name, *(quantity.number((errors or {}).get(f"{column}_deg")) for column in columns))
        for name, errors in value["filters"].items()
    )
    return Table("Attitude error against the reference, RMSE in deg", ("filter", *(f">{c}" for c in columns)), rows)
