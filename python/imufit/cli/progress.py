"""A progress bar on standard error that only long work brings up."""

from __future__ import annotations

import sys
import threading
from types import TracebackType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

PATIENCE_S: Final = 2.0
"""Time before the bar comes, s: most commands are done by then, and a person begins to wonder."""


class ProgressBar:
    """Called by the library as ``progress(done, total, label)``; a context manager that takes the bar away again.

    The bar shows the step, the progress within the step, and the time since the start. Where the calls count the
    whole work, the bar shows the share done and the time left as well; else both are unknown.

    Parameters
    ----------
    counted : bool
        Whether the calls count the whole work: filters or files, one after another, and not passes within a search.
    """

    def __init__(self, counted: bool = False) -> None:
        self._counted = counted
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._step, self._pass = "", ""
        self._share = 0.0
        self._closed = False

    def __call__(self, done: int, total: int, label: str) -> None:
        """Take note of how far the work is, and show it once the bar is there."""
        if (done, total) == (0, 1):
            self._step, self._pass = label, ""
        else:
            # A finished count is over: the bar must not stand at 100 % while something else works on.
            self._pass = label if self._counted or done < total else ""
            self._share = max(self._share, done / total)
        with self._lock:
            self._show()

    def __enter__(self) -> ProgressBar:
        if sys.stderr.isatty():
            self._timer = threading.Timer(PATIENCE_S, self._open)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._timer is not None:
            self._timer.cancel()
        with self._lock:
            self._closed = True
            if self._bar is not None:
                self._bar.stop()

    @property
    def words(self) -> str:
        """Step and what is done within the step."""
        return ", ".join(part for part in (self._step, self._pass) if part) or "working"

    def _open(self) -> None:
        """Put the bar on the screen."""
        from rich.console import Console  # noqa: PLC0415
        from rich.progress import (  # noqa: PLC0415
            BarColumn,
            Progress,
            SpinnerColumn,
            TaskProgressColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        left = (TaskProgressColumn(), TimeRemainingColumn(), TextColumn("left,")) if self._counted else ()
        with self._lock:
            if self._closed:
                return
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=20),
                *left,
                TimeElapsedColumn(),
                TextColumn("so far"),
                console=Console(stderr=True),
                transient=True,
            )
            self._task = self._bar.add_task(self.words, total=None)
            self._bar.start()
            self._show()

    def _show(self) -> None:
        """Renew the text of the bar."""
        if self._bar is None or self._task is None or self._closed:
            return
        known = self._counted and self._share > 0.0
        self._bar.update(
            self._task, completed=self._share if known else 0.0, total=1.0 if known else None, description=self.words
        )
