"""``imufit demo``: the whole loop on a log with a hidden effect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import OutputDirectory, Whole, json_option, plots_option
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reveal import truth_rows

if TYPE_CHECKING:
    from imufit.results import Diagnosis

SCENARIO = "handheld"


def choice(diagnosis: Diagnosis) -> str | None:
    """Return the effect to add: the best one, or the first of those that explain the data equally well."""
    return diagnosis.best or next(iter(diagnosis.ambiguous_with), None)


@click.command()
@click.option(
    "-o",
    "--output",
    "directory",
    type=OutputDirectory(),
    default="demo",
    show_default=True,
    metavar="DIR",
    help="Directory of the log, report.html and ladder.png.",
)
@click.option(
    "--seed", type=Whole(min=0), default=3, show_default=True, help="Picks the effect, the motion, the noise."
)
@json_option
@plots_option
def demo(*, directory: Path, seed: int, json_file: Path | None, plots: Path | None) -> None:
    """Hide an effect in a simulated log, find it, add it, see the error fall, and only then look at the truth."""
    from imufit.figures import quantity  # noqa: PLC0415
    from imufit.results import Table  # noqa: PLC0415
    from imufit.results.json_value import json_value  # noqa: PLC0415

    directory.mkdir(parents=True, exist_ok=True)
    log = directory / "log.parquet"
    out = Output(json_file)
    with ProgressBar() as progress:
        out.say("1. A hand-held sensor with one hidden effect", bold=True)
        engine.save_simulation(engine.hidden(SCENARIO, seed, size="large"), log)
        opened = engine.open_log(log)
        out.say(f"   simulated to {log}", "")

        out.say("2. Where does the ideal sensor fail?", bold=True)
        fit = engine.sensor_model().fit(opened, progress=progress)
        comparison = fit.compare(opened, progress=progress)
        out.say(f"   {comparison.sentence}")
        out.table(comparison.channel_table())

        out.say("3. Which effect is missing?", bold=True)
        diagnosis = fit.diagnose(opened, progress=progress)
        out.say(f"   {diagnosis.sentence}")
        out.table(diagnosis.candidate_table(5))

        effect = choice(diagnosis)
        if effect is not None:
            out.say(f"4. Add {effect}", bold=True)
            addition = fit.add(effect, log=opened, progress=progress)
            row = (quantity.ratio(addition.before), quantity.ratio(addition.expected), quantity.ratio(addition.after))
            out.table(Table("", (">before", ">expected", ">after", ">noise floor"), ((*row, "1.00"),)))
            out.say(addition.warning)
        else:
            out.say("4. Nothing to add", bold=True)

        out.say("5. Go on until nothing is missing", bold=True)
        result = engine.ladder(opened, None, progress)
        rows = engine.rows_of_fit(result.fit, result.start, progress=progress)
    out.table(result.step_table())
    out.say(*(f"   {sentence}" for sentence in result.sentences() if sentence))
    parts = {"comparison": comparison, "diagnosis": diagnosis, "ladder": result, "rows": rows}
    out.report(directory / "report.html", plots, "Demonstration: a hidden effect", **parts)
    out.plot(directory / "ladder.png", result.plot())

    truth = engine.unseal(log)
    out.say("6. The truth", bold=True)
    found = ", ".join(result.model) or "nothing"
    out.say(f"   hidden: {', '.join(truth.effects) or 'nothing'}; found: {found}")
    out.table(Table("", ("effect", "parameters", ">size"), truth_rows(truth)))
    out.json({"ladder": result.to_dict(), "truth": json_value(truth.to_json())})
