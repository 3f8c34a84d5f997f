"""From a serial device to a log, come what may: unplugging, resets, a full disk, a crash."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

from imufit.devices.record.arrived import Arrived
from imufit.devices.record.beginning import beginning_path
from imufit.devices.record.finish import check_target, make_log, unreadable
from imufit.devices.record.journal import DiskError, Journal
from imufit.devices.record.live_rows import check_mapping
from imufit.devices.record.part import part_path, read_part
from imufit.devices.record.reception import Reception, listen
from imufit.devices.record.rig import Rig
from imufit.devices.record.signals import requests_to_end
from imufit.devices.record.transport import Line
from imufit.errors import InputError
from imufit.log.metadata import Frame
from imufit.remedy import recovering
from imufit.results import Recording

Watch = Callable[[Reception, list[Arrived], list[str]], None]
"""Called after each read with where the rows come from, the rows, and messages of the device."""


def record(
    port: str,
    log: str | Path,
    *,
    baud: int = 115200,
    form: str = "auto",
    header: str | None = None,
    mapping: Mapping[str, str] | None = None,
    frame: Frame = "NED",
    duration: float | None = None,
    give_up: float | None = None,
    force: bool = False,
    stopped: Callable[[], bool] = lambda: False,
    watch: Watch | None = None,
    rig: Rig | None = None,
) -> Recording:
    """Record a device until it is stopped: by Ctrl-C, SIGTERM, `duration`, `give_up` or `stopped`.

    While it runs, rows are appended to ``LOG.part``; at the end they become the log. After a crash
    :func:`imufit.devices.record.recover` makes the log of what is there. A line that is lost is opened again, and the
    gap is marked in the log's metadata. The time of the rows is the device's, put on the host's clock.

    Parameters
    ----------
    port : str
        Whatever pyserial opens: ``/dev/ttyUSB0``, ``COM3``, a pseudo-terminal, ``socket://127.0.0.1:5000``.
    log : str or Path
        Log to write: ``.parquet``, ``.csv`` or ``.npz``.
    baud : int
        Bits per second.
    form : {"auto", "binary", "text"}
        Form of the wire protocol.
    header : str, optional
        Names of the columns in text form, for a device that prints none.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    frame : {"NED", "ENU", "NWU"}
        Reference frame that the log names: for a sensor that lies z up, NWU or ENU.
    duration : float, optional
        Length of the recording, s.
    give_up : float, optional
        Ends the recording when the line was lost for so long, s; without it waits for ever.
    force : bool
        Whether an existing log may be overwritten.
    stopped : callable, optional
        Ends the recording when it returns True.
    watch : callable, optional
        Called after each read, some hundred times a second.
    rig : Rig, optional
        The one-axis rig that the device is on: its commanded angle becomes the column `ref_angle`.

    Returns
    -------
    Recording
        What was recorded.

    Raises
    ------
    InputError
        The port cannot be opened, the log is in the way, nothing whole came, or the disk is full. The rows recorded
        until then stay: in the log, or in the part that the message names.
    """
    path = Path(log)
    check_mapping(mapping)
    if rig is not None and mapping and "ref_angle" in mapping:
        raise InputError(
            "ref_angle is both mapped and the angle of a rig", column="ref_angle", remedy="Leave one of them out."
        )
    check_target(path, force)
    line = Line(port, baud)
    reception = Reception(line, form, header)
    with requests_to_end() as interrupted:
        line.open()
        try:
            journal = Journal(path, reception, mapping, frame, rig)
            begin = time.monotonic(), time.process_time()
            try:
                end = _run(
                    journal,
                    reception,
                    watch,
                    duration=duration,
                    give_up=give_up,
                    stopped=lambda: interrupted() or stopped(),
                    rig=rig,
                )
            finally:
                journal.close()
            passed = max(time.monotonic() - begin[0], 1e-9)
            share = (time.process_time() - begin[1]) / passed
        finally:
            line.close()
        return _finished(path, journal, reception, end=end, share=share)


def _run(
    journal: Journal,
    reception: Reception,
    watch: Watch | None,
    *,
    duration: float | None,
    give_up: float | None,
    stopped: Callable[[], bool],
    rig: Rig | None,
) -> tuple[str, InputError | None]:
    """Record; return why it ended, and the error if the end was not ordinary."""
    try:
        for rows in listen(reception, duration=duration, give_up=give_up, stopped=stopped):
            texts = reception.take_texts()
            if rig is not None:
                # Before any row is written a crash would lose the angle, but keep the bytes that rows come out of.
                rows_came = journal.n > 0
                for angle in rig.typed(rows_came):
                    if rows_came:
                        journal.command(angle)
            journal.take(rows, texts)
            if watch is not None:
                watch(reception, rows, texts)
        away = reception.line.lost_since
        why = "stopped" if stopped() else "line lost" if away is not None and give_up is not None else "duration"
        if away is None:  # what had arrived by then
            journal.take(reception.poll(), reception.take_texts())
        journal.take(reception.finish(), reception.take_texts())
        journal.end(why, away)
    except DiskError as error:
        return "disk full", error
    except InputError as error:
        return "other columns", error
    return why, None


class Recorder:
    """Records rows that come anyway, from one moment to another: the caller reads the line and hands the rows on.

    The rows are as safe as those of `record`: they are appended to ``LOG.part``, and `recover` makes a log of what a
    crash leaves.

    Parameters
    ----------
    log : str or Path
        Log to write: ``.parquet``, ``.csv`` or ``.npz``.
    reception : Reception
        Where the rows come from.
    mapping : mapping, optional
        Source text for target columns.
    frame : {"NED", "ENU", "NWU"}
        Reference frame that the log names.

    Raises
    ------
    InputError
        The log is in the way, or cannot be written.
    """

    def __init__(
        self, log: str | Path, reception: Reception, *, mapping: Mapping[str, str] | None = None, frame: Frame = "NED"
    ) -> None:
        self.path = Path(log)
        check_target(self.path, force=False)
        self._reception = reception
        self._journal = Journal(self.path, reception, mapping, frame)
        self._begin = time.monotonic()

    @property
    def n(self) -> int:
        """Rows that are written."""
        return self._journal.n

    @property
    def seconds(self) -> float:
        """Time since the beginning, s."""
        return time.monotonic() - self._begin

    def take(self, rows: list[Arrived], texts: list[str]) -> None:
        """Keep rows, and messages of the device.

        Parameters
        ----------
        rows : list of Arrived
            As they came.
        texts : list of str
            Messages of the device.

        Raises
        ------
        InputError
            The disk is full, or the device sends other columns of which no log can be made: call `finish` with it.
        """
        self._journal.take(rows, texts)

    def finish(self, problem: InputError | None = None) -> Recording:
        """Make the log.

        Parameters
        ----------
        problem : InputError, optional
            The error that ended the recording.

        Raises
        ------
        InputError
            Nothing was recorded, the disk is full, or `problem`; the message says where the rows are.
        """
        why = "stopped"
        try:
            if problem is None:
                self._journal.end(why, self._reception.line.lost_since)
        except DiskError as error:
            problem = error
        finally:
            self._journal.close()
        if problem is not None:
            why = "disk full" if isinstance(problem, DiskError) else "other columns"
        return _finished(self.path, self._journal, self._reception, end=(why, problem))


def _finished(
    path: Path,
    journal: Journal,
    reception: Reception,
    *,
    end: tuple[str, InputError | None],
    share: float | None = None,
) -> Recording:
    """Make the log of the parts, and delete them."""
    why, problem = end
    # unexplained bytes are not a recording; of others the rows are in the parts
    beginning_path(path).unlink(missing_ok=True)
    if journal.n == 0:
        for part in journal.paths:
            part.unlink(missing_ok=True)
        if problem is not None:
            raise problem
        nothing = reception.nothing_whole or "no row came while it was being recorded"
        raise InputError(f"nothing was recorded from {reception.line.port}: {nothing}")
    stop = f"the recording stopped: {problem.problem}; " if problem else ""
    try:
        recording = converted(journal.paths, path, ended=why, cpu_share=share)
    except InputError as error:
        raise InputError(
            f"{stop}{journal.n} rows are safe in {part_path(path)}, but no log was made of them: {error.problem}",
            remedy="Make room, then run " + recovering(part_path(path)),
        ) from None
    if problem is not None:
        raise InputError(f"{stop}the {recording.n} rows before that are in {path}", remedy=problem.advice)
    return recording


def converted(
    paths: list[Path], log: Path, *, ended: str | None = None, cpu_share: float | None = None, keep: bool = False
) -> Recording:
    """Make a log of parts, and delete them once it is on the disk and can be read.

    Parameters
    ----------
    paths : list of Path
        The parts, in order.
    log : Path
        The log.
    ended : str, optional
        For `Recording.ended`; without it the state of the parts.
    cpu_share : float, optional
        For `Recording.cpu_share`.
    keep : bool
        Whether the parts stay.

    Raises
    ------
    InputError
        They hold no rows, or the log cannot be written. The parts stay.
    """
    parts = [part for part in map(read_part, paths) if part is not None]
    rows = sum(part.n for part in parts)
    if rows == 0:
        raise InputError(
            "no whole batch of rows is in it", file=paths[0], remedy="There is nothing to save: delete it."
        )
    recording = make_log(parts, log, ended, cpu_share)
    note = unreadable(log, rows)
    if note:
        object.__setattr__(recording, "notes", (*recording.notes, note.rstrip(".")))
    if not keep:
        for path in reversed(paths):
            path.unlink(missing_ok=True)
    return recording
