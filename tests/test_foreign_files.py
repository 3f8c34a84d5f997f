"""Other makers' files are read right with no option, or a question is put that one pasted mapping answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_files import KINDS, WRITERS, Foreign, Part, Sound, sound, write
from imufit.errors import InputError
from imufit.log import Log, parse_mapping, read
from pasted import python_mappings, shell_mappings

SEEDS = {"handheld": 774101, "arm": 774102, "rest_first": 774103, "rest": 774104}
"""Seed of the log of each kind."""

ORDER_S = 2e-5
"""Time may be off by this, s: a double of seconds since 1970 or of days since 1899 keeps no more than 1e-6 s."""


def judge_sensor(name: str, got: np.ndarray | None, t: np.ndarray, part: Part | None, may_lack: bool) -> None:
    """Compare a sensor with what was printed: same samples, same times, same values."""
    if got is None and may_lack:
        return
    kept = np.zeros(len(t), bool) if got is None else np.isfinite(got).any(axis=1)
    if part is None:
        assert not kept.any(), f"{name} was read, but the file holds none: {got[kept][:2]}"
        return
    assert kept.any(), f"{name} was not read"
    assert got is not None
    wanted = np.isfinite(part.values).any(axis=1)
    assert kept.sum() == wanted.sum(), f"{name}: {kept.sum()} of {wanted.sum()} samples were read"
    values = part.values[wanted]
    size = np.sqrt(np.mean(values**2))
    np.testing.assert_allclose(got[kept], values, rtol=1e-5, atol=1e-5 * size, err_msg=f"{name} was read wrong")
    times, printed = t[kept], part.t[wanted]
    np.testing.assert_allclose(times - times[0], printed - printed[0], atol=ORDER_S, err_msg=f"times of {name}")


def judge(log: Log, foreign: Foreign) -> None:
    """Compare a log with what was printed."""
    for name in ("acc", "gyr", "mag"):
        judge_sensor(name, getattr(log, name), log.t, getattr(foreign, name), name in foreign.may_lack)


def judge_attitude(log: Log, body: Sound) -> None:
    """Where an attitude was taken as a reference, its numbers must stand in the right order."""
    if log.ref_q is None:
        return
    rows = np.isfinite(log.ref_q).all(axis=1)
    wanted = body.q[: rows.sum()] if rows.sum() == len(body.q) else body.q[:: round(len(body.q) / rows.sum())]
    agreement = np.abs(np.sum(log.ref_q[rows] * wanted, axis=1))
    assert np.all(agreement > 1 - 1e-5), "the reference attitude was read wrong"


def attempt(foreign: Foreign) -> tuple[Log | None, InputError | None]:
    """Read with no option: the log, or what imufit said."""
    try:
        return read(foreign.path), None
    except InputError as error:
        return None, error


def judge_question(error: InputError, foreign: Foreign) -> Log:
    """Paste the one mapping of a question: all that stands in the file must come out of it."""
    maps = shell_mappings(error.shell_remedy or "")
    assert len(maps) == 1, f"one mapping is wanted: {error}"
    mapping = parse_mapping(maps[0])
    assert python_mappings(str(error)) == [mapping], f"Python is told another mapping: {error}"
    log = read(foreign.path, mapping)
    for name in ("acc", "gyr", "mag"):
        part, got = getattr(foreign, name), getattr(log, name)
        if part is None or (got is None and name in foreign.may_lack):
            continue
        assert got is not None, f"the mapping leaves out {name}: {error}"
        kept = np.isfinite(got).any(axis=1)
        assert kept.sum() == len(part.values), f"{name}: {kept.sum()} of {len(part.values)} samples were read"
        # what was asked for is a unit or a rate: but for a factor the readings must be the printed ones
        factor = np.sum(got[kept] * part.values) / np.sum(part.values**2)
        np.testing.assert_allclose(got[kept], factor * part.values, rtol=1e-4, atol=1e-4 * abs(factor) * 50)
        assert factor > 0, f"{name} comes out with the opposite sign"
    return log


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", sorted(WRITERS))
def test_read_right_or_asked(tmp_path: Path, name: str, kind: str) -> None:
    body = sound(kind, SEEDS[kind])
    foreign = write(name, tmp_path / "made", body)
    due = WRITERS[name].due[kind]
    log, error = attempt(foreign)
    if log is not None:
        judge(log, foreign)
        judge_attitude(log, body)
        assert due != "asks", "the file does not tell, but was read without a question"
        return
    assert error is not None
    assert due != "reads", f"this file tells all, but imufit asks: {error}"
    refused = due == "refuses" and "--map '" not in (error.shell_remedy or "")
    if any((foreign.acc, foreign.gyr, foreign.mag)) and not refused:
        judge_question(error, foreign)
