"""The page of a running device: connect, look on, record, and calibrate by a guide."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from nicegui import ui
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.figures import quantity
from imufit.lab.simulate import SCENARIOS
from imufit.log.columns import SENSOR_NAMES
from imufit.log.metadata import Frame
from imufit.printable import printable
from imufit.rests.poses import SIDES
from imufit.results import Parameter
from imufit.results.parameter import stands_out
from imufit.results.phrasing import capital, listed
from imufit.studio.body import Body, angles_in_words, side_rotation
from imufit.studio.heading import heading_of
from imufit.studio.icons import light_or_dark, link_with_words
from imufit.studio.live.device import device
from imufit.studio.live.directions import Directions
from imufit.studio.live.guided import held_side, how_to_lay
from imufit.studio.live.listening import Listening, Recorded, Source, free_name, shown_state
from imufit.studio.live.panels import groups, panel

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo

    from imufit.calibrating import Stage

Array = NDArray[np.float64]

EVERY: Final = 0.25
"""Time between two pictures of the traces, s: the eye follows, and the browser has time for other work."""
WINDOWS: Final = (5, 10, 20, 60)
"""Lengths of the traces, s."""
EMULATED: Final = "emulate "
"""Begin of the entries of the list of devices that are emulated."""
SENSORS: Final = {**SENSOR_NAMES, "temp": "thermometer"}
"""Sensors of an emulated device in words."""
OPTION: Final = """
<q-item v-bind="props.itemProps"><q-item-section>
  <q-item-label>{{ props.opt.label }}</q-item-label>
  <q-item-label caption style="max-width: 30rem">{{ (%s)[props.opt.label] }}</q-item-label>
</q-item-section></q-item>
"""
"""Template of an entry of the list of devices: its name, and beneath it the motion of a device that is emulated."""
CONNECTING: Final = (
    "1. Wire the sensor to an Arduino Uno: VCC to 5V, GND to GND, SDA to A4, SCL to A5.",
    "2. Write the program uno_mpu6050 of the project's folder firmware onto the Uno. The README of this folder has the "
    "commands. Any program does as well that prints a line such as millis,ax,ay,az,gx,gy,gz once, then a line of these "
    "numbers for each sample.",
    "3. Choose the Uno's port in the list above, such as /dev/ttyACM0, /dev/ttyUSB0 or COM3. Its line has 115200 bits "
    "per second.",
)
"""Steps from the sensor to its readings, as the README of the firmware has them."""
NOTHING_THERE: Final = "This computer knows of nothing on this port."
"""Caption of a port that stands last in the list."""
RECORDS: Final = "The red button records what comes from now on."
FIRST_CONNECT: Final = "Connect a device first."
GUIDES: Final = "Six sides on a table, then free rotation."
FRAMES: Final = {
    "NED": "level when its z axis points down (frame NED)",
    "NWU": "level when its z axis points up (frame NWU)",
    "ENU": "level when its z axis points up, yaw from east (frame ENU)",
}
"""Frames by name, with the way a level device lies."""
LIES: Final[Frame] = "NWU"
"""Frame that is offered first: most boards lie with their z axis up, and so does the emulated device offered first."""


FIRST: Final = "six_sides"
"""Emulated device that is offered first: its motion is that of a calibration, so that each button of the page works."""


Opener = Callable[[Path], Awaitable[None]]
"""Opens a log in the studio."""


def page_with(opener: Opener) -> Callable[[], None]:
    """Return what builds the page for one browser.

    Parameters
    ----------
    opener : callable
        Opens a recording in the studio.
    """

    def build() -> None:
        _LivePage(opener)

    return build


def _ports() -> list[ListPortInfo]:
    """Return the serial ports by name."""
    from serial.tools import list_ports  # noqa: PLC0415 - only this page needs it

    return sorted(list_ports.comports(), key=lambda port: port.device)


def devices() -> dict[str, str]:
    """Return the captions of the list of devices: ports with something on them, emulated devices, the other ports."""
    ports = _ports()
    used = {port.device: "" for port in ports if port.hwid != "n/a"}
    emulated = {EMULATED + name: SCENARIOS[name].description for name in (FIRST, *SCENARIOS)}
    # No caption is a device's own text: the list's template would run what this text holds.
    return used | emulated | {port.device: NOTHING_THERE for port in ports if port.hwid == "n/a"}


def about(choice: str) -> str:
    """Say what an emulated device is: its sensors, its motion, and its errors; empty for another device.

    Parameters
    ----------
    choice : str
        An entry of the list of devices.
    """
    scenario = SCENARIOS.get(choice.removeprefix(EMULATED)) if choice.startswith(EMULATED) else None
    if scenario is None:
        return ""
    sensors = [SENSORS[sensor] for sensor in scenario.sensors]
    return (
        f"A simulated device that this computer plays, with {listed(sensors)}. {scenario.description} "
        "All of them have noise. Accelerometer and gyro have errors within the data sheet of an MPU-6050 as well."
    )


def _lies(moving: bool, side: str | None) -> str:
    """Say whether the device moves, and which side lies up, as the guide names it."""
    if moving:
        return "moving"
    return "at rest" if side is None else f"at rest, {side} up"


def _entry(source: Source) -> str:
    """Return the entry of the list of devices that a source was chosen by."""
    return EMULATED + source.scenario if source.scenario else source.port


class _LivePage:
    """The elements of one browser's page."""

    def __init__(self, opener: Opener) -> None:
        self._opener = opener
        for sheet in ("studio.css", "live/live.css"):
            ui.add_css(files("imufit.studio").joinpath(sheet).read_text(encoding="utf-8"))
        self._columns: tuple[str, ...] = ()
        self._plots: list[tuple[str, tuple[str, ...], ui.plotly]] = []
        self._body: Body | None = None
        self._wanted: Body | None = None
        self._directions: Directions | None = None
        self._held: str | None = None
        self._resulted: tuple[str, ...] = ()
        self._seconds = 10
        self._figures: dict[str, ui.label] = {}
        with ui.column().classes("studio-live"):
            with ui.row().classes("w-full items-center"):
                ui.label("Live device").classes("studio-title")
                ui.space()
                link_with_words("insights", "Studio", "./").props("data-mark=page-studio")
                light_or_dark().props("data-mark=dark")
            self._connection()
            with ui.element("div").classes("studio-live-columns"):
                with ui.column().classes("gap-3 min-w-0"):
                    # The guide is on top: its picture and its result are in sight, and its end moves nothing.
                    self._guide()
                    self._status()
                    self._recorder()
                with ui.column().classes("gap-3 min-w-0"):
                    self._traces()
        self._timer = ui.timer(EVERY, self._refresh)

    # --- elements

    def _connection(self) -> None:
        with ui.column().classes("studio-region gap-2"):
            with ui.row().classes("w-full items-end gap-3"):
                held = None if device.listening is None else _entry(device.listening.source)
                captions = devices()
                choices = list(dict.fromkeys([*captions, *filter(None, [held])]))
                self._choice = (
                    ui.select(
                        choices,
                        value=held or choices[0],
                        label="device",
                        with_input=True,
                        new_value_mode="add-unique",
                    )
                    .classes("grow")
                    .style("min-width: 13rem")
                    .props('data-testid="device"')
                )
                self._choice.add_slot("option", OPTION % json.dumps(captions))
                self._frame = ui.select(FRAMES, value=LIES, label="frame").style("min-width: 13rem; flex: 1 1 20rem")
                self._baud = ui.number("bits per second", value=115200, min=300, format="%d").style("width: 8rem")
                self._connect = ui.button("Connect", on_click=self._connect_or_not).props("unelevated")
            self._about = ui.label().classes("text-sm").props('data-testid="about"')
            with ui.expansion("How to connect an MPU6050").props("dense").classes("w-full text-sm"):
                for words in CONNECTING:
                    ui.label(words)
            with ui.expansion("Text without a header").props("dense").classes("w-full text-sm") as self._plain:
                self._header = ui.input("names of the columns", placeholder="t_ms,acc_x,acc_y,acc_z").classes("w-full")
                # Without this the placeholder is hidden by the field's own name.
                self._header.props("stack-label")
            self._problem = ui.label().classes("text-negative text-sm")

    def _status(self) -> None:
        with ui.column().classes("studio-region gap-2"):
            self._name = ui.label("Not connected").classes("text-sm")
            with ui.element("div").classes("studio-live-figures w-full"):
                for key, words in (
                    ("rate", "rate"),
                    ("rows", "rows"),
                    ("lost", "lost frames"),
                    ("damaged", "damaged"),
                    ("time", "time"),
                ):
                    with ui.element("div"):
                        self._figures[key] = ui.label().classes("studio-live-value").props(f'data-testid="{key}"')
                        ui.label(words).classes("text-xs opacity-75")
            self._rest = ui.label().classes("text-sm")
            self._scene = ui.column().classes("w-full gap-0")
            self._angles = ui.label().classes("text-sm")

    def _recorder(self) -> None:
        with ui.column().classes("studio-region gap-2"):
            with ui.row().classes("w-full items-center no-wrap gap-3"):
                self._red = ui.button(icon="fiber_manual_record", on_click=self._record_or_stop)
                self._red.props('round color=red-8 aria-label="record" title="record" data-testid="record"')
                self._file = ui.input("log to record", value=str(free_name(Path.cwd(), "recording").name))
                self._file.classes("grow").props('data-testid="file"')
            self._recorded = ui.label(FIRST_CONNECT).classes("text-sm").style("overflow-wrap: anywhere")
            self._recorded.props('data-testid="recorded"')
            with ui.row().classes("gap-2") as self._made:
                self._look = ui.button("Open in the studio", on_click=self._look_at).props("outline size=12px")
                self._look.props('data-testid="look"')
                ui.button("Download", icon="download", on_click=self._download).props("outline size=12px").props(
                    'data-testid="download"'
                )
            self._made.visible = False

    def _guide(self) -> None:
        with ui.column().classes("studio-region gap-2"):
            with ui.row().classes("w-full items-center no-wrap gap-3"):
                self._start = ui.button("Calibrate", on_click=self._calibrate_or_stop).props("outline")
                self._message = ui.label(GUIDES).classes("text-sm font-medium")
            # Quasar's own motion of the bar takes two seconds, and would lag behind the device.
            self._progress = ui.linear_progress(0.0, show_value=False).props("rounded instant-feedback")
            self._progress.visible = False
            with ui.row().classes("gap-1") as self._sides:
                self._chips = {side: ui.chip(side, color="grey-6").props("dense square") for side in SIDES}
            self._sides.visible = False
            self._drawn = ui.column().classes("w-full gap-0")
            self._result = ui.column().classes("w-full gap-1")

    def _traces(self) -> None:
        with ui.column().classes("studio-region gap-1"):
            with ui.row().classes("w-full items-center"):
                self._heading = ui.label("Readings").classes("font-medium")
                ui.space()
                ui.label("green: at rest").classes("text-sm")
                ui.select(
                    {seconds: f"{seconds} s" for seconds in WINDOWS}, value=self._seconds, on_change=self._longer
                ).props('dense options-dense aria-label="length of the traces"')
            self._panels = ui.column().classes("w-full gap-0")
            self._ask_for_rows("Connect a device to see its readings.")

    def _ask_for_rows(self, words: str) -> None:
        """Say in the place of the panels why there are none."""
        self._panels.clear()
        with self._panels:
            ui.label(words).classes("text-sm")

    # --- what a person does

    async def _connect_or_not(self) -> None:
        if device.listening is not None:
            await device.disconnect()
            return
        self._connect.disable()
        try:
            await device.connect(self._source())
            self._problem.text = ""
            if not self._plots:
                self._ask_for_rows("The readings stand here once the device sends some.")
        except InputError as error:
            self._problem.text = printable(str(error))
        finally:
            self._connect.enable()

    def _source(self) -> Source:
        choice = str(self._choice.value or "").strip()
        emulated = choice.removeprefix(EMULATED) if choice.startswith(EMULATED) else ""
        frame = cast(Frame, self._frame.value)
        return Source(
            port="" if emulated else choice,
            scenario=emulated,
            baud=int(self._baud.value or 115200),
            header=str(self._header.value or ""),
            frame=frame,
        )

    def _record_or_stop(self) -> None:
        listening = device.listening
        if listening is None:
            return
        if device.recorded.running:
            listening.stop()
        else:
            listening.record(self._path("recording"))

    async def _look_at(self) -> None:
        """Go to the studio with the log that was recorded last."""
        path = device.recorded.path
        if path is None:
            return
        ui.navigate.to("./")
        await self._opener(path)

    def _download(self) -> None:
        path = device.recorded.path
        if path is not None:
            ui.download.file(path)

    def _path(self, stem: str) -> Path:
        """Return the log to record: the one named, in the folder that the studio was started in, or a free name."""
        named = str(self._file.value or "").strip()
        return Path.cwd() / named if named else free_name(Path.cwd(), stem)

    def _calibrate_or_stop(self) -> None:
        listening = device.listening
        if listening is None:
            return
        if listening.stage is not None:
            listening.stop()
        else:
            listening.guide(free_name(Path.cwd(), "calibration"))

    def _longer(self, event: Any) -> None:
        self._seconds = int(event.value)

    # --- pictures

    def _refresh(self) -> None:
        listening = device.listening
        self._connect.text = "Connect" if listening is None else "Disconnect"
        for element in (self._choice, self._frame, self._baud, self._header):
            element.set_enabled(listening is None)
        # An emulated device has neither a serial line nor lines of text.
        choice = str(self._choice.value or "")
        self._about.text = about(choice)
        self._about.visible = bool(self._about.text)
        self._baud.visible = self._plain.visible = not choice.startswith(EMULATED)
        # A recording whose log is being written has its device no more.
        self._red.set_enabled(listening is not None)
        state = None if listening is None else listening.state
        # The last numbers stay beside the last readings.
        if listening is not None or not self._plots:
            for key, words in shown_state(state).items():
                self._figures[key].text = words
        self._show_recording(device.recorded)
        self._show_guide(listening)
        if listening is None:
            self._name.text = "Not connected"
            self._rest.text = self._angles.text = ""
            self._heading.text = "Last readings" if self._plots else "Readings"
            return
        self._heading.text = "Readings"
        if listening.problem:
            self._problem.text = printable(listening.problem)
        if state is None:
            self._name.text = "Waiting for rows"
            return
        waiting = state.trouble if state.trouble and not state.n else ""
        line = "line lost, trying again" if not state.connected else waiting
        self._name.text = ", ".join(each for each in (printable(state.device) or "device", line) if each)
        self._rest.text = "" if not state.n else _lies(listening.moving, listening.side)
        self._show_readings(listening)

    def _show_readings(self, listening: Listening) -> None:
        rolling, state = listening.rolling, listening.state
        if rolling is None or state is None:
            return
        if rolling.columns != self._columns:
            self._make_panels(rolling.columns)
        rests = [*listening.rests, *([listening.rest] if listening.rest is not None else [])]
        for title, names, plot in self._plots:
            plot.update_figure(panel(rolling, title, names, self._seconds, rests))
        name, q = _attitude(state.angles)
        if self._body is not None:
            self._body.show("measured", q, listening.source.frame)
        self._angles.text = (
            f"{angles_in_words(q)} (filter {name})" if q is not None else "The attitude is not known yet."
        )

    def _make_panels(self, columns: tuple[str, ...]) -> None:
        """Make the panels and the body of the device's columns."""
        self._columns = columns
        self._panels.clear()
        self._plots = []
        with self._panels:
            for title, names in groups(columns):
                plot = ui.plotly({"data": [], "layout": {}}).classes("w-full")
                self._plots.append((title, names, plot))
        self._scene.clear()
        with self._scene:
            self._body = Body(("measured",), compass="mag_x" in columns)

    def _show_recording(self, recorded: Recorded) -> None:
        self._red.props(f"icon={'stop' if recorded.running else 'fiber_manual_record'}")
        word = "stop" if recorded.running else "record"
        self._red.props(f'aria-label="{word}" title="{word}"')
        self._file.set_enabled(not recorded.running)
        self._made.visible = recorded.made
        if recorded.path is None:
            self._recorded.text = FIRST_CONNECT if device.listening is None else RECORDS
            return
        name = printable(recorded.path.name)
        if recorded.running:
            self._file.value = recorded.path.name
            said = recorded.message or "recording"
            self._recorded.text = f"{said} {name}: {recorded.rows} rows, {recorded.seconds:.0f} s"
            return
        saved = f" Saved as {printable(str(recorded.path.resolve()))}." if recorded.made else ""
        said = f"{name}: {recorded.message}.{saved}" if saved else f"{name}: {recorded.message}"
        if self._recorded.text != said:
            self._recorded.text = said
            self._file.value = free_name(Path.cwd(), "recording").name

    def _show_guide(self, listening: Listening | None) -> None:
        stage = None if listening is None else listening.stage
        self._start.text = "Calibrate" if stage is None else "Stop"
        # The guide records, too: one recording at a time.
        self._start.set_enabled(stage is not None or (listening is not None and not listening.recorded.running))
        self._progress.visible = self._sides.visible = stage is not None
        if stage is None:
            self._held = None
            self._draw(None)
            if listening is not None and listening.calibrated:
                self._show_result(listening)
            else:
                self._message.text = GUIDES
            return
        if self._resulted:
            self._result.clear()
            self._resulted = ()
        self._message.text = stage.message
        self._progress.value = stage.progress
        assert listening is not None
        self._held = held_side(self._held, listening.side, stage.progress, moving=listening.moving)
        self._mark((*stage.done, self._held))
        self._draw(stage)

    def _mark(self, done: Sequence[str | None]) -> None:
        """Tick the sides that are done."""
        for side, chip in self._chips.items():
            chip.props(f"color={'green-8' if side in done else 'grey-6'} text-color=white")
            chip.text = f"✓ {side}" if side in done else side

    def _draw(self, stage: Stage | None) -> None:
        """Draw the way to lay the device, or the directions that the field has still to point in."""
        side, turning = (None, None) if stage is None else (stage.side, stage.turning)
        if (side is None and self._wanted is not None) or (turning is None and self._directions is not None):
            self._drawn.clear()
            self._wanted = self._directions = None
        if side is not None:
            if self._wanted is None:
                with self._drawn:
                    self._how = ui.label().classes("text-sm").props('data-testid="how"')
                    self._wanted = Body(("wanted",), compass=False)
            self._how.text = how_to_lay(side)
            self._wanted.turn("wanted", side_rotation(side))
        elif turning is not None:
            if self._directions is None:
                with self._drawn:
                    self._directions = Directions()
            self._directions.show(turning.open, turning.field)

    def _show_result(self, listening: Listening) -> None:
        """Lay out what a calibration did, and the values that it gives, once."""
        self._message.text = "The calibration has ended."
        if self._resulted is listening.calibrated:
            return
        self._resulted = listening.calibrated
        self._result.clear()
        with self._result:
            for sentence in listening.calibrated:
                ui.label(printable(capital(sentence))).classes("text-sm").style("overflow-wrap: anywhere")
            _values(listening.estimated)
            model = listening.model
            if model is not None:
                ui.button("Download", icon="download", on_click=lambda: ui.download.file(model)).props(
                    'outline size=12px data-testid="download-model"'
                )


def _values(parameters: Sequence[Parameter]) -> None:
    """Lay out the parameters of each effect with their standard errors; effects that may be chance fold away."""
    by_effect: dict[str, list[Parameter]] = {}
    for item in parameters:
        by_effect.setdefault(item.effect, []).append(item)
    clear = {
        effect
        for effect, items in by_effect.items()
        if any(stands_out(item.value, item.standard_error) for item in items)
    }
    with ui.element("div").classes("w-full").props('data-testid="values"'):
        for effect in filter(clear.__contains__, by_effect):
            _values_of(effect, by_effect[effect])
        others = [effect for effect in by_effect if effect not in clear]
        if others:
            with ui.expansion(f"{quantity.counted(len(others), 'effect')} within the standard errors").props("dense"):
                for effect in others:
                    _values_of(effect, by_effect[effect])


def _values_of(effect: str, parameters: Sequence[Parameter]) -> None:
    """Lay out the parameters of one effect, one a line."""
    heading_of(effect)
    with ui.element("div").classes("studio-live-values"):
        for item in parameters:
            ui.label(item.name).classes("studio-muted")
            ui.label(item.shown).classes("text-sm")


def _attitude(angles: dict[str, Array]) -> tuple[str, Array | None]:
    """Return the last filter that knows the attitude, and the attitude: filters stand from the simplest on."""
    known = [name for name, three in angles.items() if np.isfinite(three).all()]
    if not known:
        return "", None
    name = known[-1]
    return name, np.asarray(_imufit.quaternion_from_euler(np.ascontiguousarray(angles[name].reshape(1, 3)))[0])
