"""``imufit monitor``: attitude of a device while it runs."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import EXISTING, Real, effects_from_option, json_option, keep_inputs
from imufit.cli.names import FILTERS, KnownList
from imufit.cli.output import Output
from imufit.cli.port import duration_option, frame_option, port_argument
from imufit.cli.reading import map_option
from imufit.printable import printable

if TYPE_CHECKING:
    from rich.table import Table

    from imufit.devices.monitor import MonitorState


@click.command()
@port_argument
@map_option
@click.option(
    "--filter",
    "filters",
    multiple=True,
    type=KnownList("filter", lambda: tuple(name for name in FILTERS if name != "smoother")),
    metavar="NAME[,NAME...]",
    help="Repeatable; without it triad, mahony, hybrid with a magnetometer, else accel, gyro, complementary, kalman.",
)
@click.option(
    "--model", "model_file", type=EXISTING, metavar="MODEL", help="Take its effects out of the readings first."
)
@effects_from_option
@frame_option
@duration_option
@click.option("--plain", is_flag=True, help="Lines of numbers instead of a table; so it is where there is no terminal.")
@click.option(
    "--updates",
    type=Real(min=0.1, max=20.0),
    default=10.0,
    show_default=True,
    metavar="HZ",
    help="States per second.",
)
@json_option
def monitor(
    port: str,
    *,
    baud: int,
    form: str,
    header: str | None,
    mapping: tuple[str, ...],
    filters: tuple[tuple[str, ...], ...],
    model_file: Path | None,
    frame: str,
    duration: float | None,
    give_up: float | None,
    plain: bool,
    updates: float,
    json_file: Path | None,
) -> None:
    """Show roll, pitch and yaw of the device on PORT by several filters until Ctrl-C, in degrees."""
    keep_inputs([model_file], [json_file])
    out = Output(json_file)
    names = tuple(dict.fromkeys(name for group in filters for name in group))
    states = engine.monitor(
        port,
        names,
        mapping,
        None if model_file is None else engine.sensor_model(path=model_file),
        baud=baud,
        form=form,
        header=header,
        frame=frame,
        duration=duration,
        give_up=give_up,
        every=1.0 / updates,
    )
    for_json = json_file is not None and str(json_file) == "-"
    screen = sys.stderr if for_json else sys.stdout
    shown: Any = _Screen(screen) if screen.isatty() and not plain else _Lines(not for_json)
    last = None
    with shown:
        for last in states:
            shown.show(last)
    if last is not None:
        if not last.n:
            raise click.UsageError(f"nothing came that could be shown: {last.trouble}")
        out.json(last.to_dict())


class _Lines:
    """States as comma-separated lines on standard output."""

    def __init__(self, wanted: bool) -> None:
        self._wanted = wanted
        self._header: tuple[str, ...] = ()

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_error: object) -> None:
        pass

    def show(self, state: MonitorState) -> None:
        """Print a line, and the header before the first one."""
        for text in state.messages:
            click.echo(f"device: {printable(text)}", err=True)
        if not self._wanted or not state.n:
            return
        header = ("t_s", "rate_hz", "lost", "damaged", *(f"{f}_{a}_deg" for f in state.angles for a in _ANGLES))
        if header != self._header:
            self._header = header
            click.echo(",".join(header))
        angles = [
            f"{a:.2f}" if math.isfinite(a) else "" for three in state.angles.values() for a in map(math.degrees, three)
        ]
        click.echo(",".join([f"{state.t:.3f}", f"{state.rate_hz:.1f}", f"{state.lost}", f"{state.damaged}", *angles]))


_ANGLES = ("roll", "pitch", "yaw")


class _Screen:
    """States as a table that stays in its place."""

    def __init__(self, stream: Any) -> None:
        from rich.console import Console  # noqa: PLC0415
        from rich.live import Live  # noqa: PLC0415

        console = Console(file=stream, highlight=False, markup=False, emoji=False)
        self._live = Live(console=console, auto_refresh=False)

    def __enter__(self) -> None:
        self._live.start()

    def __exit__(self, *_error: object) -> None:
        self._live.stop()

    def show(self, state: MonitorState) -> None:
        """Renew the table."""
        for text in state.messages:
            self._live.console.print(f"device: {printable(text)}")
        self._live.update(_table(state), refresh=True)


def _table(state: MonitorState) -> Table:
    """One row per filter, the state of the line below."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    words = [f"{state.t:.1f} s" if math.isfinite(state.t) else "waiting", f"{state.rate_hz:.0f} Hz"]
    words += [f"lost {state.lost}", f"damaged {state.damaged}"]
    if state.unplugged:
        words.append(f"unplugged {state.unplugged}")
    if math.isfinite(state.temp):
        words.append(f"{state.temp:.1f} degC")
    if not state.connected:
        words.insert(0, "line lost, trying again")
    elif state.trouble:
        words.append(state.trouble)
    table = Table(
        title=Text(printable(state.device)) if state.device else None,
        title_justify="left",
        caption=Text("  ".join(words)),
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column("filter", no_wrap=True)
    for name in _ANGLES:
        table.add_column(f"{name}, deg", justify="right", min_width=10)
    for name, three in state.angles.items():
        table.add_row(name, *(f"{a:.1f}" if math.isfinite(a) else "-" for a in map(math.degrees, three)))
    return table
