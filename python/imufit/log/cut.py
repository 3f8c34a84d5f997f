"""Pieces of a log of any size, cut into chunks of one size with margins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from imufit.log.log import Chunk, Log, check_chunk_size, concatenate


def cut(pieces: Iterable[Log], rows: int, margin: int) -> Iterator[Chunk]:
    """Cut a sequence of pieces into chunks with margins, holding no more rows than that takes.

    Parameters
    ----------
    pieces : iterable of Log
        Parts of one log, in order.
    rows : int
        Rows of a chunk's core.
    margin : int
        Rows of context on either side, fewer at the ends of the log.
    """
    check_chunk_size(rows, margin)
    held: list[Log] = []
    first = start = total = 0  # row of the first held one, of the next chunk, after the last held one
    for piece in pieces:
        held.append(piece)
        total += piece.n
        if total < start + rows + margin:
            continue
        log = concatenate(held)
        while total >= start + rows + margin:
            yield _chunk(log, first, start, start + rows, margin)
            start += rows
        keep = max(first, start - margin)
        held = [log.rows(keep - first, log.n)]
        first = keep
    if held:
        log = concatenate(held)
        for begin in range(start, total, rows):
            yield _chunk(log, first, begin, min(begin + rows, total), margin)


def _chunk(log: Log, first: int, start: int, stop: int, margin: int) -> Chunk:
    low, high = max(0, start - margin - first), min(stop + margin - first, log.n)
    return Chunk(log.rows(low, high), start, start - first - low, stop - first - low)
