"""A device on a one-axis rig: the angle that is commanded, and typed, stands beside the rows."""

from __future__ import annotations

import math
import os
import time
from pathlib import Path
from typing import Any

import imufit
import numpy as np
import pytest
from cli_stand_in import run
from imufit.devices.record import Rig, TypedAngles, record, recover
from imufit.devices.record.rig import angle_of
from imufit.errors import InputError
from recording_device import NINE, Pty, Sender

DEG = math.pi / 180.0


@pytest.fixture
def pty():
    line = Pty()
    yield line
    line.close()


class Session:
    """A recording whose device has a clock that is right, and whose operator types at given numbers of rows."""

    def __init__(self, pty: Pty, typed: dict[int, str], rows: int, device: Sender | None = None) -> None:
        self.said: list[str] = []
        self._theirs, self._ours = os.pipe()
        self.rig = Rig("x", 5.0 * DEG, TypedAngles(self.said.append, self._theirs))
        self._pty, self._typed, self._rows = pty, dict(typed), rows
        self._device = Sender() if device is None else device
        self._sent = 0
        self._begin, self._passed = time.monotonic(), 0.0

    def watch(self, _reception: Any, rows: Any, _texts: Any) -> None:
        if self._sent == 0:
            self._pty.send(self._device.announce())
        if self._sent < self._rows:
            for at in [at for at in self._typed if at <= self._sent]:
                os.write(self._ours, self._typed.pop(at).encode())
                time.sleep(0.03)
            passed = time.monotonic() - self._begin
            stamps = np.linspace(self._passed, passed, 6)[1:]
            self._passed = passed
            self._pty.send(self._device.samples(range(self._sent, self._sent + 5), (1e6 * stamps).astype(np.int64)))
            self._sent += 5
            time.sleep(0.01)

    def stopped(self) -> bool:
        return self._sent >= self._rows and self._idle()

    def _idle(self) -> bool:
        self._sent += 1
        return self._sent > self._rows + 50


def recorded(pty: Pty, path: Path, typed: dict[int, str], rows: int = 600, **more: Any) -> tuple[imufit.Log, Session]:
    session = Session(pty, typed, rows, **more)
    record(pty.port, path, rig=session.rig, watch=session.watch, stopped=session.stopped)
    return imufit.read(path), session


def courses(log: imufit.Log) -> list[float | None]:
    """Angles of a log in their order, deg, each once; None for no angle."""
    assert log.ref_angle is not None
    found: list[float | None] = []
    for angle in np.round(log.ref_angle / DEG, 6):
        value = None if np.isnan(angle) else float(angle)
        if not found or found[-1] != value:
            found.append(value)
    return found


def test_an_angle_stands_in_every_row_with_the_axis_in_the_metadata(pty: Pty, tmp_path: Path) -> None:
    log, _ = recorded(pty, tmp_path / "log.parquet", {})
    assert log.metadata.rig_axis == "x"
    assert courses(log) == [5.0]
    assert log.ref_q is not None
    np.testing.assert_allclose(log.ref_q[:, 1], math.sin(2.5 * DEG), atol=1e-12)


def test_typed_angles_hold_from_then_on_and_none_while_the_rig_moves(pty: Pty, tmp_path: Path) -> None:
    typed = {200: "m\n", 300: "10\n", 400: "\n", 450: "ten\n", 500: "-0.2rad\n"}
    log, session = recorded(pty, tmp_path / "log.parquet", typed, rows=800)
    assert courses(log) == [5.0, None, 10.0, None, pytest.approx(-0.2 / DEG)]
    assert any("'ten' is not an angle" in text for text in session.said)
    assert log.ref_angle is not None
    moving = np.flatnonzero(np.isnan(log.ref_angle))
    assert abs(moving[0] - 200) < 40


def test_an_angle_that_is_typed_before_rows_come_is_refused(pty: Pty, tmp_path: Path) -> None:
    log, session = recorded(pty, tmp_path / "log.parquet", {0: "10\n"})
    assert courses(log) == [5.0]
    assert any("no row has come yet" in text for text in session.said)


class Crash(BaseException):
    """What ends a recording at once."""


def test_a_crash_keeps_the_angles(pty: Pty, tmp_path: Path) -> None:
    session = Session(pty, {200: "m\n", 300: "10\n"}, 500)

    def stopped() -> bool:
        if session.stopped():
            raise Crash
        return False

    path = tmp_path / "log.parquet"
    with pytest.raises(Crash):
        record(pty.port, path, rig=session.rig, watch=session.watch, stopped=stopped)
    assert not path.exists()
    recover(tmp_path / "log.parquet.part")
    log = imufit.read(path)
    assert log.metadata.rig_axis == "x"
    assert courses(log) == [5.0, None, 10.0]


def test_a_device_that_sends_the_angle_itself_is_refused(pty: Pty, tmp_path: Path) -> None:
    columns = [*NINE[:3], ("ref_angle", *NINE[0][1:])]
    with pytest.raises(InputError, match="sends ref_angle itself"):
        recorded(pty, tmp_path / "log.parquet", {}, device=Sender(columns=columns))


def test_a_mapped_angle_and_a_rig_are_refused(pty: Pty, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="both mapped and the angle of a rig"):
        record(pty.port, tmp_path / "log.parquet", mapping={"ref_angle": "5[deg]"}, rig=Rig("x", 0.0))


@pytest.mark.parametrize(
    ("text", "angle"),
    [
        ("5", 5 * DEG),
        ("5deg", 5 * DEG),
        (" -5 deg ", -5 * DEG),
        ("0.1rad", 0.1),
        ("1e1[deg]", 10 * DEG),
        ("+.5", DEG / 2),
    ],
)
def test_angles_are_read_in_degrees_unless_they_name_a_unit(text: str, angle: float) -> None:
    assert angle_of(text) == pytest.approx(angle, rel=1e-12)


@pytest.mark.parametrize("text", ["", "five", "5m", "nan", "inf", "1e300", "5 5", "deg"])
def test_what_is_not_an_angle_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is not an angle"):
        angle_of(text)


def test_typing_is_read_as_it_comes_and_an_end_ends_it() -> None:
    theirs, ours = os.pipe()
    typed = TypedAngles(lambda _text: None, theirs)
    assert typed() == []
    os.write(ours, b"1")
    assert typed() == []
    os.write(ours, b"0\n20deg\n")
    np.testing.assert_allclose(typed(), [10.0 * DEG, 20.0 * DEG])
    os.close(ours)
    assert typed() == []
    assert typed() == []
    os.close(theirs)


def test_the_command_wants_angle_and_axis_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for half in (("--angle", "5deg"), ("--axis", "x")):
        code, _, err = run(capsys, "record", "nowhere", "-o", str(tmp_path / "log.parquet"), *half)
        assert code == 2
        assert "belong together" in " ".join(err)
    code, _, err = run(capsys, "record", "nowhere", "-o", str(tmp_path / "log.parquet"), "--angle", "5m", "--axis", "x")
    assert code == 2
    assert "'5m' is not an angle" in " ".join(err)
