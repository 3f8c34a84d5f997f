"""``imufit emulate``: a device without hardware."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import NamedFile, OutputFile, Real, Whole, json_option, keep_inputs
from imufit.cli.life_line import LifeLine
from imufit.cli.names import OneOf, complete_injection, complete_scenario_or_log
from imufit.cli.output import Output
from imufit.cli.reading import reading_options
from imufit.cli.simulate import chosen_effects

if TYPE_CHECKING:
    from imufit.log import Reading

DEVICES = ("floats", "mpu6050", "gy86")
FORMS = ("binary", "text")
KINDS = ("garbage", "drop", "crc", "unplug", "reset")


class NumberOr(click.ParamType):  # type: ignore[type-arg]
    """A number above zero, or one word.

    Parameters
    ----------
    word : str
        The word.
    """

    name = "number"

    def __init__(self, word: str) -> None:
        self._word = word

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | str:
        """Return the number, or the word."""
        if value == self._word:
            return self._word
        try:
            number = float(value)
        except ValueError:
            number = 0.0
        if not 0.0 < number < float("inf"):
            self.fail(f"{value!r} is neither a number above 0 nor {self._word}", param, ctx)
        return number


@click.command()
@click.argument("source", metavar="SCENARIO|LOG", shell_complete=complete_scenario_or_log)
@reading_options
@click.option(
    "--on", default="pty", show_default=True, metavar="pty|socket://127.0.0.1:PORT", help="Port of the device."
)
@click.option(
    "--link",
    type=NamedFile(),
    metavar="PATH",
    help="Symbolic link to the pty, which stays the same when the device is unplugged.",
)
@click.option(
    "--device", type=OneOf("device", DEVICES), default="floats", show_default=True, help="Form of the samples."
)
@click.option("--form", type=OneOf("form", FORMS), default="binary", show_default=True, help="Frames or lines of text.")
@click.option("--rate", type=NumberOr("max"), metavar="HZ|max", help="Samples a second; max: what --baud carries.")
@click.option("--duration", type=Real(min=0.0, min_open=True), metavar="S", help="Time until it ends, s.")
@click.option("--loop", is_flag=True, help="Begin again after the last sample; for ever without --duration.")
@click.option(
    "--speed", type=NumberOr("max"), default=1.0, metavar="X|max", help="Times faster than real; max: as it is read."
)
@click.option("--baud", type=Whole(min=300), metavar="BAUD", help="Capacity of the line, bits a second.")
@click.option("--tick", type=Whole(1, 10**9), default=1000, metavar="NS", help="Tick of its clock, ns (1000).")
@click.option("--clock-drift", type=Real(), default=0.0, metavar="PPM", help="Rate by which its clock is fast.")
@click.option("--clock-jitter", type=Real(min=0.0), default=0.0, metavar="S", help="Noise of its stamps, s.")
@click.option("--clock-start", type=Whole(0, 2**32 - 1), default=0, metavar="TICKS", help="First tick of its clock.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="KIND@S[:LENGTH]",
    help=f"A fault and its time: {', '.join(KINDS)}. Repeatable.",
)
@click.option("--fault-rate", "fault_rates", multiple=True, metavar="KIND=PER_S", help="A random fault. Repeatable.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="ID[:NAME=VALUE,...]",
    shell_complete=complete_injection,
    help="Effect of a scenario's sensor, SI units; without values they are drawn. Repeatable.",
)
@click.option(
    "--data-sheet",
    is_flag=True,
    help="Put in errors within the limits of the MPU-6050's data sheet, drawn by --seed; --effect overrides them.",
)
@click.option("--seed", type=Whole(min=0), default=0, metavar="SEED", help="Seed of all random numbers.")
@click.option("--wait/--no-wait", default=None, help="Start when the port is opened (a socket) or at once (a pty).")
@click.option(
    "--sent", type=OutputFile((".parquet",)), metavar="FILE", help="Keep every sample with its fate, .parquet."
)
@json_option
def emulate(
    source: str,
    *,
    reading: Reading,
    tick: int,
    clock_drift: float,
    clock_jitter: float,
    clock_start: int,
    faults: tuple[str, ...],
    fault_rates: tuple[str, ...],
    effects: tuple[str, ...],
    data_sheet: bool,
    sent: Path | None,
    json_file: Path | None,
    **options: Any,
) -> None:
    """Emulate a device that measures a SCENARIO of `imufit simulate`, or the readings of a LOG.

    The first line on standard output is the port that `imufit record`, `imufit monitor` and `imufit calibrate --live`
    open. Ctrl-C ends it.
    """
    keep_inputs([Path(source)], [sent, json_file])
    out = Output(json_file)
    chosen = chosen_effects(effects)
    if data_sheet:
        chosen = {**engine.data_sheet_errors(options["seed"]), **chosen}
    device = engine.emulator(
        source,
        reading,
        faults=faults,
        fault_rates=fault_rates,
        clock={"tick": tick, "drift": clock_drift, "jitter": clock_jitter, "start": clock_start},
        effects=chosen,
        sent=sent or False,
        **options,
    )
    with LifeLine() as life, engine.running(device, life):
        # A program that waits for the port reads one line; with the JSON on standard output it stands on standard
        # error.
        click.echo(device.port, err=str(json_file) == "-")
        sys.stdout.flush()
    found = device.summary()
    out.say(
        f"{found['samples']} samples over {found['duration_s']:.1f} s: {found['intact']} sent whole, "
        f"{found['unread']} without a reader, {found['overrun']} with a reader too slow."
    )
    if found["faults"]:
        out.say(f"Faults: {', '.join('{kind}@{at_s:.3f}'.format(**fault) for fault in found['faults'])}.")
    if sent is not None:
        out.wrote(sent)
    out.json(found)
