"""``imufit monitor``: attitude of a device while it runs."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import EXISTING, Real, effects_from_option, json_option, keep_inputs, plot_option
from imufit.cli.horizon import horizon
from imufit.cli.life_line import HOW_TO_STOP
from imufit.cli.names import FILTERS, KnownList
from imufit.cli.output import Output
from imufit.cli.port import duration_option, frame_option, port_argument
from imufit.cli.reading import map_option
from imufit.printable import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure
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
    "--model", "model_file", type=EXISTING, metavar="MODEL", help="Remove its effects from the readings first."
)
@effects_from_option
@frame_option
@duration_option
@click.option("--plain", is_flag=True, help="Lines of numbers instead of a table; also without a terminal.")
@click.option(
    "--updates",
    type=Real(min=0.1, max=20.0),
    default=10.0,
    show_default=True,
    metavar="HZ",
    help="States per second.",
)
@click.option("--raw", is_flag=True, help="Show the readings as well, SI units.")
@json_option
@plot_option
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
    raw: bool,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Show roll, pitch and yaw of the device on PORT by several filters until Ctrl-C, in degrees."""
    keep_inputs([model_file], [json_file, plot_file])
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
    shown: Any = _Screen(screen, raw, frame) if screen.isatty() and not plain else _Lines(not for_json, raw)
    last = None
    kept: list[tuple[float, dict[str, Any]]] = []
    with shown:
        for last in states:
            shown.show(last)
            if plot_file is not None and last.angles:
                kept.append((last.t, last.angles))
    if last is not None:
        if not last.n:
            raise click.UsageError(f"the device sent nothing that could be shown: {last.trouble}")
        out.json(last.to_dict())
        if plot_file is not None:
            out.plot(plot_file, _figure(kept))


def _figure(kept: list[tuple[float, dict[str, Any]]]) -> Figure:
    """Draw the angles of all states."""
    import numpy as np  # noqa: PLC0415

    from imufit.figures.angles import angle_panels  # noqa: PLC0415

    names = list(dict.fromkeys(name for _, angles in kept for name in angles))
    unknown = np.full(3, np.nan)
    series = {name: np.array([angles.get(name, unknown) for _, angles in kept]) for name in names}
    return angle_panels(np.array([t for t, _ in kept]), series).root


class _Lines:
    """States as comma-separated lines on standard output."""

    def __init__(self, wanted: bool, raw: bool) -> None:
        self._wanted, self._raw = wanted, raw
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
        readings = state.readings if self._raw else {}
        header = (*header, *readings)
        if header != self._header:
            self._header = header
            click.echo(",".join(header))
        angles = [
            f"{a:.2f}" if math.isfinite(a) else "" for three in state.angles.values() for a in map(math.degrees, three)
        ]
        values = [f"{value:.6g}" for value in readings.values()]
        click.echo(
            ",".join([f"{state.t:.3f}", f"{state.rate_hz:.1f}", f"{state.lost}", f"{state.damaged}", *angles, *values])
        )


_ANGLES = ("roll", "pitch", "yaw")


class _Screen:
    """States as a table that stays in its place."""

    def __init__(self, stream: Any, raw: bool, frame: str) -> None:
        from rich.console import Console  # noqa: PLC0415
        from rich.live import Live  # noqa: PLC0415

        console = Console(file=stream, highlight=False, markup=False, emoji=False)
        self._raw, self._frame = raw, frame
        self._live = Live(console=console, auto_refresh=False)

    def __enter__(self) -> None:
        self._live.start()

    def __exit__(self, *_error: object) -> None:
        self._live.stop()

    def show(self, state: MonitorState) -> None:
        """Renew the table."""
        for text in state.messages:
            self._live.console.print(f"device: {printable(text)}")
        from rich.console import Group  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        parts: list[Any] = [_table(state)]
        if three := _leading(state):
            # the body's y axis points left in a frame with z up, so that a positive pitch lowers the nose there
            nose_up = three[1] if self._frame == "NED" else -three[1]
            parts.insert(0, Text("\n".join(horizon(three[0], nose_up))))
        if self._raw and state.readings:
            parts.append(Text("  ".join(f"{name} {value:.4g}" for name, value in state.readings.items())))
        self._live.update(Group(*parts), refresh=True)


def _leading(state: MonitorState) -> tuple[float, float] | None:
    """Return roll and pitch of the last filter that has them: the filters stand from the simplest on."""
    known = [three for three in state.angles.values() if math.isfinite(three[0]) and math.isfinite(three[1])]
    return (float(known[-1][0]), float(known[-1][1])) if known else None


def _table(state: MonitorState) -> Table:
    """One row per filter, the state of the line below."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    words = [f"{state.t:.1f} s" if math.isfinite(state.t) else "waiting", f"{state.rate_hz:.0f} Hz"]
    words += [f"{state.n} rows"]
    words += [f"lost {state.lost}", f"damaged {state.damaged}"]
    if state.unplugged:
        words.append(f"unplugged {state.unplugged}")
    if math.isfinite(state.temp):
        words.append(f"{state.temp:.1f} degC")
    if not state.connected:
        words.insert(0, "line lost, trying again")
    elif state.trouble:
        words.append(state.trouble)
    words.append(HOW_TO_STOP)
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
