"""The commands of the program: each is imported when it is first used, so that `imufit --help` is quick."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from typing import Final

import click
from click.shell_completion import CompletionItem

from imufit.cli.names import unknown

SUMMARIES: Final = {
    "info": "The contents of a log: rates, gaps, rests, reference, and the effects that it can show.",
    "plot": "Readings, reference and rests of a log over time, as a figure.",
    "calibrate": "Calibrate accelerometer, gyro and magnetometer.",
    "compare": "Where the model fails: by channel, segment and covariate.",
    "diagnose": "Name the missing effect, with its expected gain.",
    "add": "Add an effect, refit, show the error before, expected and after.",
    "ladder": "Repeat diagnose and add until nothing is missing.",
    "studio": "The same loop in the browser.",
    "fit": "Fit a stack of effects.",
    "apply": "A log with the model's effects removed from its readings.",
    "export": "A model as C, Arduino sketch, Python for imufusion or ahrs, JSON.",
    "explain": "An effect's card; without EFFECT the catalogue.",
    "simulate": "A synthetic log, on request with a hidden effect.",
    "reveal": "The truth of a simulated log; grades an answer.",
    "grade": "The blind protocol: rate of right answers on hidden effects.",
    "replay": "Attitude for every row, its error, and the methods' tilt beside each other.",
    "tune": "Gains of a filter: by its error, or without reference by its predictions.",
    "allan": "Noise density, bias instability and random walk of sensors at rest.",
    "convert": "Convert another maker's file, a text table or a serial transcript to a log.",
    "join": "Join a sensor's log and a reference on another clock to one log.",
    "record": "Record a serial device to a log, safe against crashes.",
    "monitor": "Attitude of a running device by several filters at once.",
    "recover": "Make a log from the part of a recording that was killed or ran out of disk.",
    "emulate": "A device without hardware: a scenario or a log on a pty or socket.",
    "demo": "The whole loop on a log with a hidden effect.",
}
"""The purpose of each command, in the order of the loop; ``imufit.cli.info`` has the command ``info``."""


class OnDemand(MutableMapping[str, click.Command]):
    """Commands by name; one that is looked up is imported."""

    def __init__(self) -> None:
        self._loaded: dict[str, click.Command] = {}
        self._names = dict(SUMMARIES)

    def __getitem__(self, name: str) -> click.Command:
        if name not in self._loaded:
            summary = self._names[name]
            command: click.Command = getattr(import_module(f"imufit.cli.{name}"), name)
            command.short_help = summary
            self._loaded[name] = command
        return self._loaded[name]

    def __setitem__(self, name: str, command: click.Command) -> None:
        self._names[name] = command.get_short_help_str()
        self._loaded[name] = command

    def __delitem__(self, name: str) -> None:
        del self._names[name]
        self._loaded.pop(name, None)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def summaries(self) -> dict[str, str]:
        """Return what each command does, without importing any."""
        return dict(self._names)


class Commands(click.Group):
    """A group whose commands are imported on demand, with a guess at misspelt names."""

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        self._all = OnDemand()
        self.commands = self._all

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of the loop."""
        return list(self._all)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the names and what the commands do."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self._all.summaries().items()))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands and options that begin so."""
        found = [
            CompletionItem(name, help=summary)
            for name, summary in self._all.summaries().items()
            if name.startswith(incomplete)
        ]
        return [*found, *click.Command.shell_complete(self, ctx, incomplete)]

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or fail with the name that was probably meant."""
        if args and not args[0].startswith("-") and args[0] not in self._all:
            ctx.fail(unknown("command", args[0], self._all))
        return super().resolve_command(ctx, args)
