"""A table of finished text, printed as plain text or HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape


@dataclass(frozen=True)
class Table:
    """Title, header and rows of text.

    Attributes
    ----------
    title : str
        Title of the table; may be empty.
    header : tuple of str
        One name per column; a leading ``>`` aligns the column right.
    rows : tuple of tuple of str
        Cells.
    blocks : bool
        Whether a terminal shows each row as a block of its own, a line for each cell: so it is where cells hold lists.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    blocks: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Column names without the alignment mark."""
        return tuple(name.removeprefix(">") for name in self.header)

    @property
    def right(self) -> tuple[bool, ...]:
        """Which columns are aligned right."""
        return tuple(name.startswith(">") for name in self.header)

    def without_empty_columns(self) -> Table:
        """Return the table without the columns of which every cell is empty."""
        kept = [k for k in range(len(self.header)) if any(row[k] for row in self.rows)]
        rows = tuple(tuple(row[k] for k in kept) for row in self.rows)
        return replace(self, header=tuple(self.header[k] for k in kept), rows=rows)

    def transposed(self) -> Table:
        """Return the table with a column for each row: the first cells are its header, as numbers where some are."""
        mark = ">" if any(self.right[1:]) else ""
        header = (self.names[0], *(f"{mark}{row[0]}" for row in self.rows))
        columns = list(zip(self.names, *self.rows, strict=True))[1:]
        return replace(self, header=header, rows=tuple(columns))

    def __str__(self) -> str:
        widths = [max(len(cell) for cell in column) for column in zip(self.names, *self.rows, strict=True)]

        def line(cells: Sequence[str]) -> str:
            parts = (
                cell.rjust(width) if right else cell.ljust(width)
                for cell, width, right in zip(cells, widths, self.right, strict=True)
            )
            return "  ".join(parts).rstrip()

        lines = [self.title] if self.title else []
        lines += [line(self.names), line(["-" * width for width in widths]), *(line(row) for row in self.rows)]
        return "\n".join(lines)

    def html(self) -> str:
        """HTML table for a notebook."""

        def cells(tag: str, row: Sequence[str]) -> str:
            style = {True: ' style="text-align:right"', False: ' style="text-align:left"'}
            return "".join(
                f"<{tag}{style[right]}>{escape(cell)}</{tag}>" for cell, right in zip(row, self.right, strict=True)
            )

        body = "".join(f"<tr>{cells('td', row)}</tr>" for row in self.rows)
        caption = f"<p><b>{escape(self.title)}</b></p>" if self.title else ""
        return f"{caption}<table><thead><tr>{cells('th', self.names)}</tr></thead><tbody>{body}</tbody></table>"


def page(sentences: Sequence[str], tables: Sequence[Table]) -> str:
    """Sentences and tables as plain text, one blank line between them."""
    return "\n\n".join([*(text for text in sentences if text), *(str(table) for table in tables if table.rows)])


def html(sentences: Sequence[str], tables: Sequence[Table]) -> str:
    """Sentences and tables as HTML for a notebook."""
    texts = "".join(f"<p>{escape(text)}</p>" for text in sentences if text)
    return f"<div>{texts}{''.join(table.html() for table in tables if table.rows)}</div>"
