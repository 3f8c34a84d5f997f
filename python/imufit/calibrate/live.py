"""A calibration on a running device: rows go to the wizard and into a log, and the log is calibrated."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.calibrate.calibrate import calibrate
from imufit.calibrate.calibration import Calibration
from imufit.calibrate.poses import SIDES
from imufit.calibrate.wizard import Stage, Wizard
from imufit.errors import InputError
from imufit.log import Log, Metadata
from imufit.log.assemble import group_fields
from imufit.log.place import Place
from imufit.record import LiveRows

Array = NDArray[np.float64]

PATIENCE: Final = 300.0
"""Time without anything new after which a live calibration is given up, s."""


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

    The six sides are wanted, in any order, and free rotation if there is a magnetometer; then the log of everything
    that came is calibrated as `imufit.calibrate.calibrate` does. It is written in any case, also if this is
    interrupted or given up.

    Parameters
    ----------
    port : str
        Whatever pyserial opens.
    keep : Path
        Log to be written: Parquet, CSV or NPZ.
    baud : int
        Bits per second.
    form : {"auto", "binary", "text"}
        Form of the wire protocol.
    header : str, optional
        Names of the columns in text form, for a device that prints none.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    cost, sensors, settings
        As for `imufit.calibrate.calibrate`; ``hold`` is 2 s for the person unless given.
    rests : int
        Good rests that are wanted, the six sides among them: rounds of quarter turns tell the gyro's misalignment.
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
        The port cannot be opened, it was given up, or the log does not tell a calibration; the log is kept.
    """
    wizard = Wizard(sensors, rests, settings)
    held: list[dict[str, Array]] = []
    with LiveRows(port, baud=baud, form=form, header=header, mapping=mapping, idle=True) as rows:
        try:
            _guide(rows, wizard, held, give_up, show)
        finally:
            log = _log_of(held, keep, rows.name)
            if log is not None:
                log.write(keep)
    if log is None:
        raise InputError(rows.trouble or "nothing came from the device", file=port)
    if not wizard.complete:
        raise InputError(
            f"given up after {give_up:g} s without anything new: {wizard.wanted} missing",
            remedy=f"What came is in {keep}: imufit calibrate {keep} makes of it what it can.",
        )
    return calibrate(log, cost, sensors=sensors, settings=settings), log


def _guide(
    rows: LiveRows,
    wizard: Wizard,
    held: list[dict[str, Array]],
    give_up: float,
    show: Callable[[Stage], None],
) -> None:
    """Feed the wizard until it is complete, or nothing new came for too long."""
    news, since = None, time.monotonic()
    for batch in rows:
        if batch["t"].size:
            held.append(batch)
        stage = wizard.feed(batch)
        show(stage)
        now = (stage.done, stage.rests, stage.directions)
        if now != news:
            news, since = now, time.monotonic()
        if wizard.complete or time.monotonic() - since > give_up:
            return


def _log_of(held: Sequence[dict[str, Array]], keep: Path, name: str) -> Log | None:
    """Make one log of all batches; None without any."""
    if not held:
        return None
    columns = dict.fromkeys(column for batch in held for column in batch)
    table = {
        column: np.concatenate([batch.get(column, np.full(len(batch["t"]), np.nan)) for batch in held])
        for column in columns
    }
    metadata = Metadata(sensor=name or None)
    fields = group_fields(table.pop("t"), table, {}, start=0, metadata=metadata, place=Place())
    return Log(**fields, metadata=metadata, path=keep)
