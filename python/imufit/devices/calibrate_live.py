"""A calibration on a running device: it is recorded while the wizard looks on, and the log is calibrated."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from imufit.calibrating.calibrate import calibrate
from imufit.calibrating.calibration import Calibration
from imufit.calibrating.wizard import Stage, Wizard
from imufit.devices.record import LiveConverter, record
from imufit.errors import InputError
from imufit.log import Log, read
from imufit.remedy import Remedy
from imufit.rests.poses import SIDES

PATIENCE: Final = 300.0
"""Time without anything new after which a live calibration ends, s."""


def calibrate_live(
    port: str,
    keep: Path,
    *,
    baud: int = 115200,
    form: str = "auto",
    header: str | None = None,
    mapping: Mapping[str, str] | None = None,
    cost: str | None = None,
    sensors: Sequence[str] = ("acc", "gyr", "mag"),
    rests: int = len(SIDES),
    settings: Mapping[str, float] | None = None,
    give_up: float = PATIENCE,
    show: Callable[[Stage], None] = lambda stage: None,
) -> tuple[Calibration, Log]:
    """Guide a person through a calibration of a running device.

    The six sides are wanted, in any order, and free rotation if there is a magnetometer. Everything that comes is
    recorded as `imufit.devices.record.record` does, and stays if this is stopped by Ctrl-C, ended or killed; the
    log is calibrated as `imufit.calibrating.calibrate` does.

    Parameters
    ----------
    port : str
        Whatever pyserial opens.
    keep : Path
        Log to be written: Parquet, CSV or NPZ. It must not exist.
    baud : int
        Bits per second.
    form : {"auto", "binary", "text"}
        Form of the wire protocol.
    header : str, optional
        Names of the columns in text form, for a device that prints none.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    cost, sensors, settings
        As for `imufit.calibrating.calibrate`; ``hold`` is 2 s for the person unless given.
    rests : int
        Good rests that are wanted, the six sides among them: rounds of quarter turns determine the gyro's misalignment.
    give_up : float
        Time without a new side or direction after which it ends, s.
    show : callable
        Called with where things stand, some ten times a second or more.

    Returns
    -------
    tuple
        The calibration and the log.

    Raises
    ------
    InputError
        The port cannot be opened, the log is in the way, it was stopped or ended, or the log does not determine a
        calibration; the recorded rows are kept.
    """
    looked = _Looking(Wizard(sensors, rests, settings), LiveConverter(mapping), give_up, show)
    record(
        port,
        keep,
        baud=baud,
        form=form,
        header=header,
        mapping=mapping,
        stopped=looked.is_over,
        watch=lambda _reception, rows, _texts: looked.see(rows),
    )
    if not looked.wizard.complete:
        why = f"given up after {give_up:g} s without anything new" if looked.is_late() else "stopped"
        raise InputError(
            f"{why}: {looked.wizard.wanted} missing",
            remedy=f"The received rows are in {keep}: "
            + Remedy(f"imufit.calibrate({str(keep)!r})", f"imufit calibrate {shlex.quote(str(keep))}")
            + " makes of it what it can.",
        )
    log = read(keep)
    return calibrate(log, cost, sensors=sensors, settings=settings), log


class _Looking:
    """Feeds the wizard with the recorded rows, and reports the end."""

    def __init__(self, wizard: Wizard, converter: LiveConverter, give_up: float, show: Callable[[Stage], None]) -> None:
        self.wizard = wizard
        self._converter, self._give_up, self._show = converter, give_up, show
        self._news: Any = None
        self._since = time.monotonic()

    def see(self, rows: Sequence[Any]) -> None:
        """Take rows as they arrived."""
        for part in rows:
            self.wizard.feed(self._converter.batch(part))
        stage = self.wizard.stage
        self._show(stage)
        now = (stage.done, stage.rests, stage.directions)
        if now != self._news:
            self._news, self._since = now, time.monotonic()

    def is_late(self) -> bool:
        """Whether nothing new came for too long."""
        return time.monotonic() - self._since > self._give_up

    def is_over(self) -> bool:
        """Whether the recording is to end."""
        return self.wizard.complete or self.is_late()
