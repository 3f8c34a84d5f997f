"""``imufit simulate``: a synthetic log whose truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, OutputFile, Real, Whole, json_option
from imufit.cli.names import FRAMES, Known, complete_injection, unknown
from imufit.cli.output import Output

SIZES = ("large", "medium", "small")


def parse_effect(text: str) -> tuple[str, dict[str, float] | None]:
    """Read ``ID`` or ``ID:x=0.01,y=0``.

    Parameters
    ----------
    text : str
        As given on the command line.

    Returns
    -------
    effect : str
        The id.
    parameters : dict or None
        Values in SI units; None to have them drawn.

    Raises
    ------
    click.UsageError
        A value is not a number, or the effect is not known.
    """
    head, colon, tail = text.rpartition(":")
    effect, values = (head, tail) if colon and "=" in tail else (text, "")
    if ".column:" not in effect and effect not in (known := engine.injections()):
        raise click.UsageError(unknown("effect", effect, known))
    if not values:
        return effect, None
    parameters = {}
    for part in values.split(","):
        name, _, value = part.partition("=")
        try:
            parameters[name.strip()] = float(value)
        except ValueError:
            raise click.UsageError(f"--effect {text}: {part!r} does not read NAME=NUMBER") from None
    return effect, parameters


def chosen_effects(texts: Sequence[str]) -> dict[str, dict[str, float] | None]:
    """Read effects as `parse_effect`, each of them once.

    Parameters
    ----------
    texts : sequence of str
        As given on the command line.

    Raises
    ------
    click.UsageError
        As `parse_effect`, or an effect that is named twice.
    """
    chosen = dict(parse_effect(text) for text in texts)
    if len(chosen) < len(texts):
        raise click.UsageError("--effect names one effect twice")
    return chosen


@click.command()
@click.argument("scenario", type=Known("scenario", lambda: list(engine.scenarios())), metavar="SCENARIO")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="ID[:NAME=VALUE,...]",
    shell_complete=complete_injection,
    help="Effect to put in, SI units; without values they are drawn. Repeatable.",
)
@click.option("--hidden", type=Whole(min=0), metavar="SEED", help="Let this seed pick a hidden effect.")
@click.option(
    "--fault",
    type=Known("fault", engine.faults),
    metavar="ID",
    help="Fault of the data to put in besides, such as stuck or knock.",
)
@click.option("--size", type=Known("size", lambda: SIZES), metavar="|".join(SIZES), help="Size of drawn effects.")
@click.option("--duration", type=Real(min=0.0, min_open=True), metavar="S", help="Length, s.")
@click.option("--rate", type=Real(min=0.0, min_open=True), metavar="HZ", help="Samples per second.")
@click.option("--seed", type=Whole(min=0), metavar="SEED", help="Seed of motion and noise.")
@click.option(
    "--frame", type=Known("frame", lambda: FRAMES), metavar="|".join(FRAMES), default="NED", show_default=True
)
@click.option("-o", "--output", type=OutputFile(LOG_ENDINGS), required=True, metavar="LOG", help="Log to write.")
@json_option
def simulate(
    scenario: str,
    *,
    effects: tuple[str, ...],
    hidden: int | None,
    fault: str | None,
    size: str | None,
    duration: float | None,
    rate: float | None,
    seed: int | None,
    frame: str,
    output: Path,
    json_file: Path | None,
) -> None:
    """Simulate a log of SCENARIO: turntable, arm, poses, six_sides, tilt, handheld, or of a machine tool, machine_...

    The truth is kept sealed beside the log; `imufit reveal LOG` opens it.
    """
    if hidden is not None and effects:
        raise click.UsageError("--hidden picks the effect itself: leave out --effect")
    if hidden is not None and seed is not None:
        raise click.UsageError("--hidden is the seed: leave out --seed")
    chosen = chosen_effects(effects)
    given = {"duration": duration, "rate": rate, "size": size, "frame": frame}
    settings = {name: value for name, value in given.items() if value is not None}
    out = Output(json_file)
    if hidden is not None:
        simulation = engine.hidden(scenario, hidden, **settings)
    else:
        simulation = engine.simulate(scenario, chosen, **settings, **({} if seed is None else {"seed": seed}))
    if fault is not None:
        simulation = engine.with_fault(simulation, fault)
    sealed = engine.save_simulation(simulation, output)
    rows, span = len(simulation.t), float(simulation.t[-1] - simulation.t[0])
    out.say(f"{scenario}: {rows} rows over {span:.1f} s, frame {frame}.", bold=True)
    if hidden is not None:
        out.say(f"The sensor's error is hidden; `imufit reveal {output}` shows the truth.")
    else:
        out.say(f"Effects: {', '.join(chosen) or 'none'}.")
    if fault is not None:
        out.say(f"Fault of the data: {fault}.")
    out.wrote(output)
    out.json({"log": str(output), "sealed": str(sealed), "n": rows, "duration_s": span, "scenario": scenario})
