"""Follows one device in a thread: rolling rows, attitude, rests, a recording, and the guide through a calibration.

Nothing here draws. The line is read by `imufit.devices.monitor.Monitor`, rows are recorded by
`imufit.devices.record.Recorder`, and the guide is `imufit.calibrating.Wizard`.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.calibrating import Calibration, Stage, Wizard, calibrate
from imufit.devices.emulate import Emulator
from imufit.devices.emulate.data_sheet import data_sheet_errors
from imufit.devices.monitor import Monitor, MonitorState
from imufit.devices.record import Recorder
from imufit.devices.record.arrived import Arrived
from imufit.devices.record.attitude import sensors_in
from imufit.devices.record.reception import Reception
from imufit.errors import InputError
from imufit.log import read
from imufit.log.columns import GROUPS, SENSOR_NAMES
from imufit.log.metadata import Frame
from imufit.rests.poses import SIDES
from imufit.results import Parameter, Recording
from imufit.results.phrasing import capital, listed
from imufit.studio.live.rolling import Rolling

Array = NDArray[np.float64]

EVERY: Final = 0.1
"""Time from one state to the next, s."""
SENSOR: Final = 222
"""Seed of the errors of an emulated device: always the same sensor, so that two calibrations of it agree. Its zero rate
of 1 to 2 deg/s is that of most such sensors; the 20 deg/s that the data sheet allows turn the attitude by 15 deg."""
RESTS: Final = 100
"""Rests that are remembered: an hour of them on a screen of a minute."""


@dataclass(frozen=True)
class Source:
    """The device to follow.

    Attributes
    ----------
    port : str
        Whatever pyserial opens; empty for an emulated device.
    scenario : str
        Scenario of `imufit simulate` that an emulated device measures; empty for a port.
    baud : int
        Bits per second of the port.
    header : str
        Names of the columns, for a device that sends text without them; empty otherwise.
    frame : {"NED", "ENU", "NWU"}
        Reference frame of the angles.
    speed : float
        Seconds of an emulated device in a second.
    rate : float or None
        Rows a second of an emulated device; None for the scenario's own.
    """

    port: str = ""
    scenario: str = ""
    baud: int = 115200
    header: str = ""
    frame: Frame = "NED"
    speed: float = 1.0
    rate: float | None = None


@dataclass(frozen=True)
class Rest:
    """A time at which the device lay still.

    Attributes
    ----------
    begin, end : float
        s of the stream.
    good : bool
        Whether it can be used for a calibration: long enough and without a shake.
    """

    begin: float
    end: float
    good: bool


@dataclass(frozen=True)
class Recorded:
    """The state of the recorder.

    Attributes
    ----------
    path : Path or None
        Log that is being recorded, or that was recorded last.
    running : bool
        Whether it is being recorded.
    seconds : float
        Length so far, s.
    rows : int
        Rows on the disk.
    message : str
        Result or problem of the last recording.
    made : bool
        Whether the log is there to be opened.
    """

    path: Path | None = None
    running: bool = False
    seconds: float = 0.0
    rows: int = 0
    message: str = ""
    made: bool = False


class Listening:
    """Follows a device until `close`.

    Parameters
    ----------
    source : Source
        The device.

    Attributes
    ----------
    state : MonitorState or None
        The last state; None before the first one.
    rolling : Rolling or None
        The last rows; None before the columns are known.
    rests : deque of Rest
        Rests so far, the last ones.
    rest : Rest or None
        The present rest, or the one that a movement has interrupted and may have ended; None without one.
    moving : bool
        Whether the device moves.
    side : str or None
        Side that points up by the readings, as the guide names it; None where none does.
    problem : str
        Why following ended by itself; empty while it runs.
    stage : Stage or None
        Where the calibration stands; None while none is guided.
    calibrated : tuple of str
        Sentences of the last calibration, or its problem.
    estimated : tuple of Parameter
        Parameters of the last calibration.
    model : Path or None
        File of the model of the last calibration; None where none was saved.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self.state: MonitorState | None = None
        self.rolling: Rolling | None = None
        self.rests: deque[Rest] = deque(maxlen=RESTS)
        self.rest: Rest | None = None
        self.moving = True
        self.side: str | None = None
        self.problem = ""
        self.stage: Stage | None = None
        self.calibrated: tuple[str, ...] = ()
        self.estimated: tuple[Parameter, ...] = ()
        self.model: Path | None = None
        self._judge = _imufit.PoseJudge()
        self._over = threading.Event()
        self._emulator: Emulator | None = None
        self._wizard: Wizard | None = None
        self._lock = threading.Lock()
        self._wanted: Path | None = None
        self._recorder: Recorder | None = None
        self._recorded = Recorded()
        self._texts: list[str] = []
        self._making: list[threading.Thread] = []
        self._thread = threading.Thread(target=self._run, name="imufit live", daemon=True)
        self._opened = threading.Event()
        self._refused: InputError | None = None

    def open(self) -> None:
        """Open the line and follow the device from then on.

        Raises
        ------
        InputError
            The port cannot be opened.
        """
        if not (self.source.port or self.source.scenario):
            raise InputError("no port is named", remedy="Name a port, or choose an emulated device.")
        self._thread.start()
        self._opened.wait()
        if self._refused is not None:
            raise self._refused

    def close(self) -> None:
        """End a recording, and let go of the device."""
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join()
        for made in self._making:
            made.join()

    @property
    def running(self) -> bool:
        """Whether the device is being followed."""
        return self._thread.is_alive() and not self._over.is_set()

    # --- the thread that reads the line

    def _run(self) -> None:
        try:
            self._follow()
        except InputError as error:
            self.problem = str(error)
            if not self._opened.is_set():
                self._refused = error
        finally:
            self._opened.set()
            self._want_no_more()
            self._stop_recorder(None)
            if self._emulator is not None:
                self._emulator.__exit__(None, None, None)

    def _follow(self) -> None:
        source = self.source
        port = source.port
        if not port:
            # A socket on this computer: the device begins when it is listened to, on every operating system.
            self._emulator = Emulator(
                source.scenario,
                on="socket://127.0.0.1:0",
                loop=True,
                speed=source.speed,
                rate=source.rate,
                frame=source.frame,
                effects=data_sheet_errors(SENSOR),
            ).__enter__()
            port = self._emulator.port
        monitor = Monitor(
            port,
            frame=source.frame,
            every=EVERY,
            stopped=self._over.is_set,
            see=self._see,
            baud=source.baud,
            header=source.header or None,
            watch=self._watch,
        )
        with monitor:
            self._opened.set()
            for state in monitor:
                self._texts += state.messages
                self.state = state

    def _watch(self, reception: Reception, rows: list[Arrived]) -> None:
        """Record the rows as they arrived, if that is wanted."""
        with self._lock:
            wanted = self._wanted
        recorder = self._recorder
        if wanted is None:
            if recorder is not None:
                self._stop_recorder(None)
            return
        try:
            if recorder is None:
                recorder = self._recorder = Recorder(wanted, reception, frame=self.source.frame)
                self._texts = []
            texts, self._texts = self._texts, []
            recorder.take(rows, texts)
            self._recorded = Recorded(recorder.path, True, recorder.seconds, recorder.n)
        except InputError as error:
            self.stop()
            if recorder is None:
                self._recorded = Recorded(wanted, message=str(error))
            else:
                self._stop_recorder(error)

    def _stop_recorder(self, problem: InputError | None) -> None:
        """Make the log in a thread of its own: the line is read on meanwhile."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        seconds, wizard = recorder.seconds, self._wizard
        self._recorded = Recorded(recorder.path, True, seconds, recorder.n, "writing the log")

        def make() -> None:
            try:
                recording = recorder.finish(problem)
            except InputError as error:
                self._recorded = Recorded(recorder.path, False, seconds, recorder.n, str(error))
                return
            self._recorded = Recorded(recorder.path, False, seconds, recording.n, in_words(recording), True)
            if wizard is not None and wizard.complete:
                self._calibrate(recorder.path)

        thread = threading.Thread(target=make, name="imufit log", daemon=True)
        self._making = [each for each in self._making if each.is_alive()] + [thread]
        thread.start()

    def _see(self, batch: dict[str, Array]) -> None:
        """Take rows that the filters have taken."""
        columns = tuple(name for name, values in batch.items() if name != "t" and values.dtype != object)
        if self.rolling is None or self.rolling.columns != columns:
            self.rolling = Rolling(columns)
        self.rolling.add(batch)
        self._judge_rests(batch)
        wizard = self._wizard
        if wizard is not None:
            self.stage = wizard.feed(batch)
            if wizard.complete:
                self._want_no_more()

    def _judge_rests(self, batch: Mapping[str, Array]) -> None:
        sensors = sensors_in(tuple(batch))
        if "acc" not in sensors:
            return
        acc = np.column_stack([batch[name] for name in GROUPS["acc"]]).tolist()
        gyr = np.column_stack([batch[name] for name in GROUPS["gyr"]]).tolist() if "gyr" in sensors else None
        for row, t in enumerate(batch["t"].tolist()):
            judged = self._judge.step(t, acc[row], None if gyr is None else gyr[row])
            closed = judged["closed"]
            if closed is not None:
                self.rests.append(Rest(*closed["time"], closed["flaw"] is None))
            if closed is not None or not judged["open"]:
                self.rest = None
            self.moving = judged["state"] == "moving"
            self.side = None if judged["side"] is None else SIDES[judged["side"]]
            if not self.moving:
                begin = t if self.rest is None else self.rest.begin
                self.rest = Rest(begin, t, judged["state"] == "held")

    # --- requests of a page

    @property
    def recorded(self) -> Recorded:
        """The state of the recorder."""
        return self._recorded

    def record(self, path: Path) -> None:
        """Begin a recording with the next rows.

        Parameters
        ----------
        path : Path
            Log to write, ``.parquet``, ``.csv`` or ``.npz``; it must not exist.
        """
        self._recorded = Recorded(path, True)
        with self._lock:
            self._wanted = path

    def stop(self) -> None:
        """End the recording, and make the log of it."""
        self._wizard = self.stage = None
        self._want_no_more()

    def _want_no_more(self) -> None:
        """Take no more rows; a recording without any has ended, and the others end with the next look at the line."""
        with self._lock:
            wanted, self._wanted = self._wanted, None
        if wanted is not None and self._recorder is None:
            self._recorded = Recorded(wanted, message="stopped before the first row")

    def guide(self, path: Path) -> None:
        """Guide through a calibration, which is recorded; at its end the log is calibrated and the model saved beside.

        Parameters
        ----------
        path : Path
            Log to write; it must not exist.
        """
        columns = () if self.rolling is None else self.rolling.columns
        self.calibrated, self.estimated, self.model = (), (), None
        self._wizard = Wizard(sensors_in(columns) or ("acc", "gyr", "mag"))
        self.stage = self._wizard.stage
        self.record(path)

    def _calibrate(self, path: Path) -> None:
        try:
            result = calibrate(read(path))
            model = path.with_suffix(".toml")
            result.save(model)
        except InputError as error:
            self.calibrated = (str(error),)
        else:
            self.model = model.resolve()
            self.estimated = tuple(result.model.listed())
            self.calibrated = (*in_sentences(result), f"Saved as {self.model}.")
        self._wizard = self.stage = None


def in_sentences(result: Calibration) -> tuple[str, ...]:
    """Say what a calibration did to each sensor that has an error, and once which sensors show none.

    Parameters
    ----------
    result : Calibration
        The calibration.
    """
    faulty = tuple(sensor.sentence() for sensor in result.sensors.values() if sensor.shows_error)
    right = [SENSOR_NAMES[name] for name, sensor in result.sensors.items() if not sensor.shows_error]
    if not right:
        return faulty
    names = listed(right)
    shows = "shows no error beyond its" if len(right) == 1 else "show no error beyond their"
    needless = "" if faulty else " The model need not be used."
    return (*faulty, f"{capital(names)} {shows} standard errors: the readings are right as they are.{needless}")


def in_words(recording: Recording) -> str:
    """Return what was recorded, in one line.

    Parameters
    ----------
    recording : Recording
        The recording.
    """
    lost = f", {recording.lost} lost" if recording.lost else ""
    return f"{recording.n} rows in {recording.duration_s:.1f} s{lost}"


def free_name(folder: Path, stem: str, taken: Callable[[Path], bool] = Path.exists) -> Path:
    """Return the name of a log that is free in a folder.

    Parameters
    ----------
    folder : Path
        The folder.
    stem : str
        Beginning of the name.
    taken : callable
        Whether a name is taken.
    """
    number = 1
    while taken(path := folder / f"{stem}-{number}.parquet") or taken(path.with_suffix(".toml")):
        number += 1
    return path


def shown_state(state: MonitorState | None) -> dict[str, Any]:
    """Return the figures of a state that a page shows, as text by name.

    Parameters
    ----------
    state : MonitorState or None
        The state; None before the first one.
    """
    if state is None or not state.n:
        return {"rate": "–", "rows": "0", "lost": "0", "damaged": "0", "time": "–"}
    return {
        "rate": f"{state.rate_hz:.0f} Hz",
        "rows": f"{state.n:,}".replace(",", " "),
        "lost": f"{state.lost}",
        "damaged": f"{state.damaged}",
        "time": f"{state.t:.1f} s",
    }
