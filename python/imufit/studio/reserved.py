"""Room that a region keeps: once its content was tall, what lies below stays in its place when the content shrinks."""

from __future__ import annotations

from typing import Final

from nicegui import ui

TALLEST: Final = "studio-tallest"
"""Variable of the style sheet that holds the height, px; the sheet says on which screens the region keeps it."""
SCRIPT: Final = f"""
(() => {{
  const content = document.getElementById('CONTENT');
  let about = '', width = 0, tallest = 0;
  new ResizeObserver(() => {{
    // Other content, or the same in another width, needs another height.
    if (content.dataset.about !== about || content.offsetWidth !== width) tallest = 0;
    about = content.dataset.about;
    width = content.offsetWidth;
    tallest = Math.max(tallest, content.scrollHeight);
    content.parentElement.style.setProperty('--{TALLEST}', tallest + 'px');
  }}).observe(content);
}})();
"""


class Reserved:
    """A column whose frame keeps the tallest height that the column had.

    Parameters
    ----------
    column : ui.column
        The column.
    """

    def __init__(self, column: ui.column) -> None:
        self._column = column
        self._about = ""
        ui.run_javascript(SCRIPT.replace("CONTENT", str(column.html_id)))

    def about(self, subject: str) -> None:
        """Name the subject of the content: for another subject the height is taken anew.

        Parameters
        ----------
        subject : str
            Letters, digits, ``-`` and ``.`` alone.
        """
        if subject != self._about:
            self._about = subject
            self._column.props(f"data-about={subject}")
