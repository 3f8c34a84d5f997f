"""A studio in a process of its own, and the parts of its page."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager

SLOW_MS = 60_000
"""Time that a step may take on a busy machine, ms: ten times what the slowest takes on a quiet one."""


@contextmanager
def studio(folder, *arguments):
    """Run `imufit studio`; the address it prints."""
    process = subprocess.Popen(
        [sys.executable, "-m", "imufit", "studio", *arguments, "--no-browser"],
        cwd=folder,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "IMUFIT_DEBUG": "1"},
    )
    try:
        yield process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)
        process.stdout.close()


def marked(page, mark):
    """The element with a mark."""
    return page.locator(f'[data-mark="{mark}"]').first


def figure(page, mark):
    """Data and layout of a figure as Plotly holds them."""
    return page.evaluate(
        """mark => {
            const found = document.querySelector(`[data-mark="${mark}"]`);
            const plot = found.data ? found : found.querySelector('.js-plotly-plot');
            return JSON.parse(JSON.stringify({data: plot.data, layout: plot.layout}));
        }""",
        mark,
    )


def bars(page):
    """Heights of the bars of the fall of the error, the expected one left out."""
    return next(trace["y"] for trace in figure(page, "fall")["data"] if trace["name"] == "held-out error")


def wait_for_bars(page, count):
    """Wait until so many bars stand, and all work is done; return their heights."""

    def stand():
        page.wait_for_function(
            """count => {
                const found = document.querySelector('[data-mark="fall"]');
                const plot = found && (found.data ? found : found.querySelector('.js-plotly-plot'));
                const trace = plot && plot.data && plot.data.find(item => item.name === 'held-out error');
                return trace && trace.y.length === count && trace.y.every(value => value !== null);
            }""",
            arg=count,
            timeout=SLOW_MS,
        )

    # A log that is read anew takes the bars of the one before away, and brings its own when the work is done.
    stand()
    idle(page)
    stand()
    return bars(page)


def idle(page):
    """Wait until no work is under way: twice, since one piece follows another."""
    for _ in range(2):
        page.wait_for_timeout(450)
        page.wait_for_function(
            """() => { const busy = document.querySelector('[data-mark="busy"]');
                       return !busy || busy.offsetParent === null; }""",
            timeout=SLOW_MS,
        )
