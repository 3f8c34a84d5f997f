"""Room that a region keeps: once its content was tall, what lies below stays in its place when the content shrinks."""

from __future__ import annotations

from typing import Final

from nicegui import ui

TALLEST: Final = "studio-tallest"
"""Variable of the style sheet that holds the height, px; the sheet says on which screens the region keeps it."""
FRAME: Final = "studio-kept-room"
"""Class of the element that keeps the height."""
SCRIPT: Final = f"""
(() => {{
  const content = document.getElementById('CONTENT');
  const frame = content.parentElement;
  let about = '', width = 0, tallest = 0;
  const keep = () => {{
    // Other content, or the same in another width, needs another height. While the pointer is in the frame itself,
    // no press can go astray below, and room that stands empty is given back.
    if (content.dataset.about !== about || content.offsetWidth !== width || frame.matches(':hover')) tallest = 0;
    about = content.dataset.about;
    width = content.offsetWidth;
    tallest = Math.max(tallest, content.getBoundingClientRect().height);
    frame.style.setProperty('--{TALLEST}', tallest + 'px');
  }};
  new ResizeObserver(keep).observe(content);
  frame.addEventListener('pointerenter', keep);
}})();
"""


class Reserved:
    """A column whose frame keeps the tallest height that the column had.

    Parameters
    ----------
    column : ui.column
        The column, alone in an element that `FRAME` names.
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
