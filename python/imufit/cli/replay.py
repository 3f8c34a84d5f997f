"""``imufit replay``: attitude filters over a log, and the methods beside each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import EXISTING, LOG_ENDINGS, OutputFile, json_option, keep_inputs, log_argument, plot_option
from imufit.cli.names import FILTERS, KnownList, unknown
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar

if TYPE_CHECKING:
    from imufit.results import Table


@click.command(short_help="Attitude for every row, its error, and the methods' tilt beside each other.")
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
    "--set",
    "assignments",
    multiple=True,
    metavar="FILTER.NAME=VALUE",
    help="Setting of a filter, in SI units, or of the rules as replay.NAME, e.g. kalman.acc_noise=0.01. Repeatable.",
)
@click.option(
    "--settings",
    "settings_file",
    type=EXISTING,
    metavar="FILE.toml",
    help="Settings as `imufit tune -o` and `imufit allan --settings` write them; --set goes before them.",
)
@click.option(
    "--band",
    type=click.FloatRange(min=0.0, min_open=True),
    default=0.1,
    show_default=True,
    metavar="DEG",
    help="Band in which a tilt counts as settled.",
)
@click.option(
    "-o", "--output", type=OutputFile(LOG_ENDINGS), metavar="OUT", help="Write the log with the attitudes added."
)
@json_option
@plot_option
def replay(
    log: Path,
    *,
    mapping: tuple[str, ...],
    filters: tuple[tuple[str, ...], ...],
    assignments: tuple[str, ...],
    settings_file: Path | None,
    band: float,
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Run attitude filters over LOG; where it has a reference, give their errors.

    For a rig with one axis (metadata rig_axis) the error of the angle about that axis, else of the whole attitude and
    of the inclination: RMSE, offset, standard deviation, drift, noise density, settling time, gain on vibration, and
    how the methods rank.
    """
    keep_inputs([log, settings_file], [output, json_file, plot_file])
    names = tuple(dict.fromkeys(name for group in filters for name in group))
    settings = {} if settings_file is None else engine.read_settings(settings_file)
    for group, values in _settings(assignments).items():
        settings[group] = {**settings.get(group, {}), **values}
    out = Output(json_file)
    with ProgressBar() as progress:
        result = engine.replay(engine.read_log(log, mapping), names, progress, settings)
    compared = result.comparison(band)
    value = result.to_dict(compared)
    out.say(f"{value['n']} rows replayed.", bold=True)
    out.say(*(f"{count} rows skipped: {reason}." for reason, count in value.get("skipped", {}).items() if count))
    if compared is None or compared.axis is None:
        out.table(_attitude_table(value))
    if compared is not None:
        out.tables(compared.tables())
        out.say(*compared.notes)
    if output is not None:
        engine.write_log(result.to_log(), output)
        out.wrote(output)
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


def _settings(assignments: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read ``FILTER.NAME=VALUE``.

    Raises
    ------
    click.UsageError
        Not of that form, an unknown name (the known ones are told), or no finite number.
    """
    settings: dict[str, dict[str, float]] = {}
    for text in assignments:
        place, equals, number = text.partition("=")
        group, dot, name = (part.strip() for part in place.partition("."))
        if not (equals and dot and group and name):
            raise click.UsageError(f"--set {text!r}: write FILTER.NAME=VALUE, such as kalman.acc_noise=0.01")
        known = engine.filter_settings()
        if group not in known:
            raise click.UsageError(f"--set: {unknown('filter', group, known)}")
        if name not in known[group]:
            raise click.UsageError(
                f"--set: {unknown(f'setting of {group}', name, known[group])}"
                if known[group]
                else f"--set: {group} has no settings"
            )
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise click.UsageError(f"--set {text!r}: {number.strip()!r} is no number")
        settings.setdefault(group, {})[name] = value
    return settings
