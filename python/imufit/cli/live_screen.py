"""The display of a live calibration: a picture that changes on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

    from imufit.calibrating import Stage

SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
BAR = 30
EVERY = 0.1
"""Time between two changes of the picture, s."""


def bar(progress: float) -> str:
    """Return a bar of `BAR` characters.

    Parameters
    ----------
    progress : float
        0 to 1.
    """
    full = round(BAR * progress)
    return "█" * full + "░" * (BAR - full)


class LiveScreen:
    """Shows the stages of a live calibration on standard error, or standard output for a person; a context manager.

    Parameters
    ----------
    quiet : bool
        Whether standard output is for something else.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._stream = sys.stderr if quiet else sys.stdout
        self._live: Live | None = None
        self._shown, self._said = 0.0, ""
        self._done: tuple[str, ...] = ()

    def __enter__(self) -> Self:
        if self._stream.isatty():
            from rich.console import Console  # noqa: PLC0415
            from rich.live import Live  # noqa: PLC0415

            self._live = Live(console=Console(file=self._stream, highlight=False), transient=True, auto_refresh=False)
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def __call__(self, stage: Stage) -> None:
        """Show where things stand."""
        if self._live is None:
            self._say(stage)
        elif time.monotonic() - self._shown >= EVERY or stage.done != self._done:
            self._shown, self._done = time.monotonic(), stage.done
            self._live.update(self._picture(stage), refresh=True)

    def _say(self, stage: Stage) -> None:
        """Print a line for each side that is known, and for each change of what is to be done."""
        for side in stage.done[len(self._done) :]:
            self._print(f"{side} up is known, {len(stage.done)} of {len(SIDES)}.", stage)
        self._done = stage.done
        # Percentages and counts go up all the time: only the words before them are news.
        words = stage.message.split(",")[0].split(":")[0]
        if words != self._said:
            self._said = words
            self._print(stage.message, stage)

    def _print(self, words: str, stage: Stage) -> None:
        print(f"{stage.t:7.1f} s  {words}", file=self._stream, flush=True)

    @staticmethod
    def _picture(stage: Stage) -> Table:
        from rich.table import Table  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        grid = Table.grid(padding=(0, 2))
        grid.add_row(Text(stage.message, style="bold"))
        grid.add_row(Text(bar(stage.progress)))
        marks = Text()
        for side in SIDES:
            known = side in stage.done
            marks.append(f" {'✓' if known else '·'} {side} ", style="green" if known else "dim")
        grid.add_row(marks)
        field = "" if stage.directions is None else f", field seen in {stage.directions} of 26 directions"
        grid.add_row(Text(f"{stage.t:.1f} s, {stage.rows} samples, {stage.rests} good rests{field}", style="dim"))
        return grid
