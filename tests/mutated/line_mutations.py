"""Mutations of a text file: lines, cells and columns of it."""

from random import Random

from mutated.hostile import NAMES, NUMBERS, TEXTS

SEPARATORS = (",", ";", "\t", " ", "|", ", ", "  ", "\x00", "\x1f")


def _lines(data: bytes) -> list[str]:
    return data.decode("utf-8", "surrogateescape").split("\n")


def _bytes(lines: list[str]) -> bytes:
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def _row(rng: Random, lines: list[str]) -> int:
    return rng.randrange(min(len(lines), 6)) if rng.random() < 0.3 else rng.randrange(len(lines))


def _cells(line: str) -> list[str]:
    return line.split(",")


def insert_line(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    cells = len(_cells(lines[0]))
    new = rng.choice(
        (
            "",
            ",",
            "," * (cells - 1),
            "," * cells,
            ",".join(["nan"] * cells),
            rng.choice(TEXTS),
            rng.choice(NAMES),
            "# comment",
            "# face_begin +X",
            "# face_end +Q",
            lines[0],
            "x=1 y=2 z=3",
            "a" * 100_000,
            "1," * 3000,
        )
    )
    lines.insert(_row(rng, lines), new)
    return _bytes(lines)


def delete_line(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    at = _row(rng, lines)
    del lines[at : at + rng.choice((1, 1, 5, 100))]
    return _bytes(lines)


def repeat_line(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    at = _row(rng, lines)
    lines[at:at] = [lines[at]] * rng.choice((1, 1, 3, 300))
    return _bytes(lines)


def shuffle_lines(rng: Random, data: bytes) -> bytes:
    head, *rest = _lines(data)
    which = rng.randrange(3)
    if which == 0:
        rng.shuffle(rest)
    elif which == 1:
        rest.reverse()
    else:
        at = _row(rng, rest or [""])
        rest = rest[at:] + rest[:at]
    return _bytes([head, *rest])


def few_lines(rng: Random, data: bytes) -> bytes:
    return _bytes(_lines(data)[: rng.choice((1, 2, 3, 10, 199, 200, 201))])


def change_cell(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    for _ in range(rng.choice((1, 1, 1, 5, 200))):
        at = _row(rng, lines)
        cells = _cells(lines[at])
        cells[rng.randrange(len(cells))] = rng.choice(rng.choice((NUMBERS, TEXTS)))
        lines[at] = ",".join(cells)
    return _bytes(lines)


def change_column(rng: Random, data: bytes) -> bytes:
    """Give a whole column one value."""
    head, *rest = _lines(data)
    column, value = rng.randrange(len(_cells(head))), rng.choice(rng.choice((NUMBERS, TEXTS)))
    changed = []
    for line in rest:
        cells = _cells(line)
        if column < len(cells):
            cells[column] = value
        changed.append(",".join(cells))
    return _bytes([head, *changed])


def rename_column(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    cells = _cells(lines[0])
    cells[rng.randrange(len(cells))] = rng.choice(NAMES)
    lines[0] = ",".join(cells)
    return _bytes(lines)


def add_column(rng: Random, data: bytes) -> bytes:
    head, *rest = _lines(data)
    value = rng.choice(rng.choice((NUMBERS, TEXTS)))
    name = rng.choice(NAMES) if rng.random() < 0.8 else rng.choice(_cells(head))
    return _bytes([f"{head},{name}", *(f"{line},{value}" if line else line for line in rest)])


def drop_column(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    column = rng.randrange(len(_cells(lines[0])))
    whole = rng.random() < 0.7
    return _bytes(
        [
            ",".join(cell for k, cell in enumerate(_cells(line)) if k != column) if whole or n == 0 else line
            for n, line in enumerate(lines)
        ]
    )


def other_separator(rng: Random, data: bytes) -> bytes:
    separator = rng.choice(SEPARATORS)
    return _bytes([line.replace(",", separator) for line in _lines(data)])


def decimal_commas(_rng: Random, data: bytes) -> bytes:
    return data.replace(b",", b";").replace(b".", b",")


def without_header(_rng: Random, data: bytes) -> bytes:
    return _bytes(_lines(data)[1:])


def preamble(rng: Random, data: bytes) -> bytes:
    return _bytes([rng.choice((*NAMES, *TEXTS)) for _ in range(rng.choice((1, 2, 30)))] + _lines(data))


def line_ends(rng: Random, data: bytes) -> bytes:
    return data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\r", b"\n\n", b"\x0b", b"\x0c", b"\x85", b"")))


def quoted(rng: Random, data: bytes) -> bytes:
    lines = _lines(data)
    at = _row(rng, lines)
    lines[at] = ",".join(f'"{cell}"' for cell in _cells(lines[at])) + rng.choice(("", '"', '""'))
    return _bytes(lines)


LINE_MUTATIONS = (
    insert_line,
    insert_line,
    delete_line,
    repeat_line,
    shuffle_lines,
    few_lines,
    change_cell,
    change_cell,
    change_column,
    change_column,
    rename_column,
    rename_column,
    add_column,
    add_column,
    drop_column,
    other_separator,
    decimal_commas,
    without_header,
    preamble,
    line_ends,
    quoted,
)
