"""Faults of a line and their times, one function a kind."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from imufit.errors import InputError


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong once.

    Attributes
    ----------
    at : float
        Time since the device was switched on, s; it strikes the first sample from then on.
    kind : str
        Out of `FAULTS`.
    length : float
        Bytes, samples or seconds, as the kind has it.
    """

    at: float
    kind: str
    length: float


@dataclass(frozen=True)
class Piece:
    """Bytes on their way.

    Attributes
    ----------
    data : bytes
        What is sent.
    row : int or None
        Sample of which these are the bytes.
    whole : bool
        Whether these are all of its bytes, unaltered.
    """

    data: bytes
    row: int | None = None
    whole: bool = True


Change = Callable[[list[Piece], Fault, np.random.Generator], list[Piece]]


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    Attributes
    ----------
    words : str
        What happens.
    unit : str
        What its length counts.
    length : float
        Length unless stated otherwise.
    change : callable
        Changes the pieces of the sample that is struck.
    """

    words: str
    unit: str
    length: float
    change: Change


def _garbage(pieces: list[Piece], fault: Fault, rng: np.random.Generator) -> list[Piece]:
    """Put random bytes before the sample or into it; some of them end a frame."""
    junk = rng.integers(0, 256, max(1, int(fault.length)))
    junk[rng.random(len(junk)) < 0.1] = 0
    noise = Piece(junk.astype(np.uint8).tobytes())
    if rng.random() < 0.5:
        return [noise, *pieces]
    return [part for piece in pieces for part in _parted(piece, noise, rng)]


def _parted(piece: Piece, noise: Piece, rng: np.random.Generator) -> list[Piece]:
    if piece.row is None or len(piece.data) < 4:
        return [piece]
    # Not right before its end: an end among the random bytes would leave it whole.
    at = int(rng.integers(1, len(piece.data) - 2))
    return [Piece(piece.data[:at], piece.row, False), noise, Piece(piece.data[at:], piece.row, False)]


def _drop(pieces: list[Piece], _fault: Fault, _rng: np.random.Generator) -> list[Piece]:
    """Leave the sample out, although it was counted."""
    return [piece if piece.row is None else replace(piece, data=b"", whole=False) for piece in pieces]


def _crc(pieces: list[Piece], _fault: Fault, rng: np.random.Generator) -> list[Piece]:
    """Damage a byte of the sample."""
    return [_damaged(piece, rng) for piece in pieces]


def _damaged(piece: Piece, rng: np.random.Generator) -> Piece:
    if piece.row is None or not piece.data:
        return piece
    data, at = bytearray(piece.data), int(rng.integers(len(piece.data)))
    data[at] ^= int(rng.integers(1, 256))
    return replace(piece, data=bytes(data), whole=False)


def _unplug(pieces: list[Piece], _fault: Fault, rng: np.random.Generator) -> list[Piece]:
    """Break off within the sample; the line is closed behind it."""
    *before, last = pieces
    if not last.data:
        return pieces
    return [*before, replace(last, data=last.data[: int(rng.integers(len(last.data)))], whole=False)]


def _reset(pieces: list[Piece], _fault: Fault, _rng: np.random.Generator) -> list[Piece]:
    """Change nothing: the device begins anew behind the sample."""
    return pieces


FAULTS: Mapping[str, Kind] = {
    "drop": Kind("samples are left out, although they were counted", "samples", 1.0, _drop),
    "crc": Kind("a byte of a sample is damaged", "samples", 1.0, _crc),
    "garbage": Kind("random bytes, before a sample or within it", "bytes", 40.0, _garbage),
    "unplug": Kind("the line is closed within a sample and comes back; the device goes on", "s", 2.0, _unplug),
    "reset": Kind("the device begins anew: next start, sequence and clock from 0", "s of silence", 0.0, _reset),
}
"""Kinds by name, in the order in which they strike one sample."""


def parse_fault(text: str) -> Fault:
    """Read ``KIND@SECOND`` or ``KIND@SECOND:LENGTH``.

    Parameters
    ----------
    text : str
        As given on the command line.

    Raises
    ------
    InputError
        Another text.
    """
    kind, at_sign, rest = text.partition("@")
    at, colon, length = rest.partition(":")
    _check_kind(kind)
    try:
        found = Fault(float(at), kind, float(length) if colon else FAULTS[kind].length)
    except ValueError:
        found = Fault(float("nan"), kind, 0.0)
    if not (at_sign and 0.0 <= found.at < np.inf and 0.0 <= found.length < np.inf):
        raise InputError(
            f"the fault {text!r} does not read KIND@SECOND or KIND@SECOND:LENGTH",
            remedy=f"Write for instance {kind}@3 or {kind}@3:2, the length in {FAULTS[kind].unit}.",
        )
    return found


def parse_fault_rate(text: str) -> tuple[str, float]:
    """Read ``KIND=PER_SECOND``.

    Parameters
    ----------
    text : str
        As given on the command line.

    Raises
    ------
    InputError
        Another text.
    """
    kind, _, rate = text.partition("=")
    _check_kind(kind)
    try:
        value = float(rate)
    except ValueError:
        value = float("nan")
    if not 0.0 <= value < np.inf:
        raise InputError(
            f"the fault rate {text!r} does not read KIND=PER_SECOND", remedy=f"Write for instance {kind}=0.5."
        )
    return kind, value


def _check_kind(kind: str) -> None:
    if kind not in FAULTS:
        raise InputError(f"the fault {kind!r} is not known", remedy=f"Use one of {', '.join(FAULTS)}.")


class Schedule:
    """Faults in the order of their times, those given and those that come by chance.

    Parameters
    ----------
    faults : sequence of Fault
        Those given.
    rates : mapping of str to float
        Of those by chance, how many of a kind come in a second on average.
    rng : numpy.random.Generator
        Chance.
    """

    def __init__(self, faults: Sequence[Fault], rates: Mapping[str, float], rng: np.random.Generator) -> None:
        for kind in [*(fault.kind for fault in faults), *rates]:
            _check_kind(kind)
        self._order = list(FAULTS)
        self._rates, self._rng = rates, rng
        self._queue: list[tuple[float, int, float, bool]] = []
        for fault in faults:
            self._put(fault, False)
        for kind in rates:
            self._draw(kind, 0.0)

    def _put(self, fault: Fault, by_chance: bool) -> None:
        heapq.heappush(self._queue, (fault.at, self._order.index(fault.kind), fault.length, by_chance))

    def _draw(self, kind: str, after: float) -> None:
        if self._rates[kind] > 0.0:
            at = after + self._rng.exponential(1.0 / self._rates[kind])
            self._put(Fault(at, kind, FAULTS[kind].length), True)

    @property
    def next(self) -> float:
        """Time of the next fault, s; infinite if none comes."""
        return self._queue[0][0] if self._queue else np.inf

    def due(self, t: float) -> list[Fault]:
        """Return the faults that strike the sample at time `t` (s), in order; each once.

        Parameters
        ----------
        t : float
            Time since the device was switched on, s.
        """
        found: list[Fault] = []
        more: list[Fault] = []
        while self.next <= t:
            at, order, length, by_chance = heapq.heappop(self._queue)
            fault = Fault(at, self._order[order], length)
            if by_chance:
                self._draw(fault.kind, at)
            found.append(fault)
            if FAULTS[fault.kind].unit == "samples" and length >= 2.0:
                # the samples after this one
                more.append(Fault(float(np.nextafter(t, np.inf)), fault.kind, length - 1.0))
        for fault in more:
            self._put(fault, False)
        return sorted(found, key=lambda fault: self._order.index(fault.kind))
