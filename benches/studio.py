"""The studio on a log of 20 million rows and on a long live stream: times and memory.

A log is made chunk by chunk in a temporary directory (2.5 GB), drawn whole, and zoomed into 500 times: each window has
a random middle and a random width between 20 ms and the whole log, and three columns of 1200 pixels. Then the live page
of a running studio follows an emulated device, which sends several times faster than real, in Debian's Chromium.

Run: ``python benches/studio.py [--rows N] [--zooms N] [--seconds S] [--speed X] [--only rows|page|live] [--json FILE]
[--write]``. ``--json`` keeps the figures of parts that are measured one by one. ``--write`` puts the figures into
docs/studio.md.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from imufit.log import LogStream, Metadata
from imufit.log.parquet import ROW_GROUP
from imufit.log.writer import write_rows
from imufit.results import Table
from imufit.studio.traces import Traces
from marked import markdown, write_between

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = DOCS / "studio.md"
BEGIN, END = "<!-- measured by benches/studio.py -->", "<!-- end of what the studio's bench measured -->"
CHROMIUM = "/usr/bin/chromium"
WEBGL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
STEP = 1e-3
"""Time between two rows, s: 20 million rows are five and a half hours at 1 kHz."""
PIXELS = 1200
NAMES = ("acc_x", "acc_y", "acc_z"), ("gyr_x", "gyr_y", "gyr_z"), ("temp",), ("ref_qw",)
IMUFIT = [sys.executable, "-m", "imufit"]
LONGEST = 1800.0
"""Time after which the page is taken to hang, s."""
HAS_POINTS = """() => {
    const drawn = document.querySelector("[data-mark=trace].js-plotly-plot, [data-mark=trace] .js-plotly-plot");
    return drawn && drawn.data && drawn.data.length > 0 && drawn.data[0].x && drawn.data[0].x.length > 100;
}"""
"""Whether the trace has points."""
HAS_VERDICT = """() => document.querySelector("[data-mark=verdict]") !== null"""
FOLLOWS = """() => parseInt(document.querySelector("[data-testid=rows]").textContent) > 0"""
"""Whether rows have come."""
AT_REST = """() => document.querySelector("[data-mark=busy]").offsetParent === null"""
"""Whether all work is done."""
ZOOM = """([low, high]) => new Promise((done) => {
    const drawn = document.querySelector("[data-mark=trace].js-plotly-plot, [data-mark=trace] .js-plotly-plot");
    const old = drawn.data[0].x, begin = performance.now();
    const listen = () => {
        if (drawn.data[0].x === old) { return; }
        drawn.removeListener("plotly_afterplot", listen);
        done(performance.now() - begin);
    };
    drawn.on("plotly_afterplot", listen);
    Plotly.relayout(drawn, {"xaxis.range[0]": low, "xaxis.range[1]": high});
})"""
"""Zoom as a person does; the answer is the time until other points are drawn, ms."""
SHORTEST = 0.02
"""Narrowest window, s."""


def resident(process: int | str = "self") -> float:
    """Memory that a process holds now, MB."""
    fields = Path(f"/proc/{process}/status").read_text(encoding="ascii").split("VmRSS:")[1].split()
    return int(fields[0]) / 1024


def rows_of_a_long_log(rows: int) -> Iterator[dict[str, np.ndarray]]:
    """Give a sensor that is turned to and fro, with noise, a temperature and a reference, a row group at a time."""
    noise = np.random.default_rng(1).normal(size=(ROW_GROUP + 4096, 9))
    for start in range(0, rows, ROW_GROUP):
        n = min(ROW_GROUP, rows - start)
        t = STEP * (start + np.arange(n))
        own = noise[37 * (start // ROW_GROUP) % 4096 :][:n]
        yaw, zero = 0.3 * np.sin(0.5 * t), np.zeros(n)
        mean = [
            zero,
            zero,
            zero - 9.8,
            zero,
            zero,
            0.15 * np.cos(0.5 * t),
            20 * np.cos(yaw),
            -20 * np.sin(yaw),
            zero + 44,
        ]
        size = np.repeat([0.02, 0.001, 0.3], 3)
        names = [f"{sensor}_{axis}" for sensor in ("acc", "gyr", "mag") for axis in "xyz"]
        table = {name: mean[k] + size[k] * own[:, k] for k, name in enumerate(names)}
        attitude = {"ref_qw": np.cos(0.5 * yaw), "ref_qx": zero, "ref_qy": zero, "ref_qz": np.sin(0.5 * yaw)}
        yield {"t": t, **table, "temp": 25.0 + 3.0 * np.sin(t / 500.0), **attitude}


def long_log(folder: str, rows: int) -> Path:
    """Write a long log, a row group at a time."""
    path = Path(folder) / "long.parquet"
    write_rows(path, Metadata(), rows_of_a_long_log(rows))
    return path


def drawn(rows: int, zooms: int) -> list[tuple[str, str]]:
    """Draw a long log and zoom into it; return figures with their words."""
    with tempfile.TemporaryDirectory() as folder:
        path = long_log(folder, rows)
        begin = time.perf_counter()
        log = LogStream(path)
        opened = time.perf_counter() - begin
        before = resident()
        with Traces(log) as traces:
            begin = time.perf_counter()
            traces.build()
            built = time.perf_counter() - begin
            begin = time.perf_counter()
            traces.window(NAMES[0], *traces.span, PIXELS)
            whole = time.perf_counter() - begin
            times, worked, held, read = zoomed(traces, zooms)
            took, work = 1e3 * np.array(times), 1e3 * np.array(worked)
            return [
                (f"opening {rows:,} rows, every time stamp checked", f"{opened:.1f} s"),
                ("the pass that fills the pyramid", f"{built:.1f} s"),
                ("first picture, from opening on", f"{opened + built + whole:.1f} s"),
                ("picture of the whole log", f"{1e3 * whole:.0f} ms"),
                (f"{zooms} zoom steps, {read} of which read rows again: median", f"{np.median(took):.0f} ms"),
                ("99 of 100 zoom steps within", f"{np.percentile(took, 99):.0f} ms"),
                ("slowest zoom step", f"{took.max():.0f} ms"),
                ("processor time of a zoom step: 99 of 100 within", f"{np.percentile(work, 99):.0f} ms"),
                ("memory of the pyramid", f"{traces.bytes / 1e6:.0f} MB"),
                ("memory of the process before the pass", f"{before:.0f} MB"),
                ("after a tenth of the zoom steps", f"{held[len(held) // 10]:.0f} MB"),
                ("after all of them", f"{held[-1]:.0f} MB"),
                ("at most", f"{max(held):.0f} MB"),
            ]


def zoomed(traces: Traces, zooms: int) -> tuple[list[float], list[float], list[float], int]:
    """Take random windows; return times, processor times (s), memory after each (MB), and how many read rows again."""
    rng = np.random.default_rng(2)
    first, last = traces.span
    times, worked, held, reads = [], [], [], 0
    again = traces.rows_around

    def counted(*given, **named):
        nonlocal reads
        reads += 1
        return again(*given, **named)

    traces.rows_around = counted
    for k in range(zooms):
        width = np.exp(rng.uniform(np.log(SHORTEST), np.log(last - first)))
        middle = rng.uniform(first + width / 2, last - width / 2)
        begin, work = time.perf_counter(), time.process_time()
        found = traces.window(NAMES[k % len(NAMES)], middle - width / 2, middle + width / 2, PIXELS)
        times.append(time.perf_counter() - begin)
        worked.append(time.process_time() - work)
        held.append(resident())
        assert all(points.t.size <= 2 * PIXELS for points in found.values())
    return times, worked, held, reads


def paged(rows: int, zooms: int) -> list[tuple[str, str]]:
    """Open a long log in the studio's page and zoom into its trace; return figures with their words."""
    with tempfile.TemporaryDirectory() as folder, studio(folder, [long_log(folder, rows)]) as (server, page, address):
        begin = time.perf_counter()
        page.goto(address)
        stood = []
        for state in (HAS_POINTS, HAS_VERDICT, AT_REST):
            page.wait_for_function(state, timeout=1000 * LONGEST)
            stood.append(time.perf_counter() - begin)
        tools = page.context.new_cdp_session(page)
        rng = np.random.default_rng(3)
        last = rows * STEP
        times, held, heaps = [], [], []
        for _ in range(zooms):
            width = np.exp(rng.uniform(np.log(SHORTEST), np.log(last)))
            middle = rng.uniform(width / 2, last - width / 2)
            times.append(page.evaluate(ZOOM, [middle - width / 2, middle + width / 2]))
            tools.send("HeapProfiler.collectGarbage")
            heaps.append(tools.send("Runtime.getHeapUsage")["usedSize"] / 1e6)
            held.append(resident(server.pid))
    tenth = len(held) // 10
    return [
        (f"page on {rows:,} rows: the first picture of the readings stands after", f"{stood[0]:.1f} s"),
        ("the page's sentence on the evidence stands after", f"{stood[1]:.0f} s"),
        ("the residuals over time stand after", f"{stood[2]:.0f} s"),
        (f"{zooms} zooms of the page, until the new points are drawn: median", f"{np.median(times):.0f} ms"),
        ("99 of 100 zooms of the page within", f"{np.percentile(times, 99):.0f} ms"),
        ("slowest zoom of the page", f"{max(times):.0f} ms"),
        ("memory of the server after a tenth of the zooms", f"{held[tenth]:.0f} MB"),
        ("after all of them", f"{held[-1]:.0f} MB"),
        ("memory of the page's script after a tenth of the zooms", f"{heaps[tenth]:.1f} MB"),
        ("after all of them", f"{heaps[-1]:.1f} MB"),
    ]


@contextmanager
def studio(folder: str, logs: Sequence[Path] = ()) -> Iterator[tuple[subprocess.Popen[str], Any, str]]:
    """Run a studio and Debian's Chromium; give the server, an empty page, and the address of the studio."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - only the parts with a page need it

    command = [*IMUFIT, "studio", "--no-browser", *map(str, logs)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=WEBGL)
            try:
                page = browser.new_page(viewport={"width": 1280, "height": 900})
                yield server, page, server.stdout.readline().strip()
            finally:
                browser.close()
    finally:
        server.terminate()
        server.wait(timeout=30)


def live(seconds: float, speed: float) -> list[tuple[str, str]]:
    """Follow an emulated device on the live page; return figures with their words."""
    device = [*IMUFIT, "emulate", "handheld", "--loop", "--speed", str(speed), "--on", "socket://127.0.0.1:0"]
    emulator = subprocess.Popen(device, stdout=subprocess.PIPE, text=True)
    try:
        with tempfile.TemporaryDirectory() as folder, studio(folder) as (server, page, address):
            page.goto(f"{address}live")
            field = page.get_by_label("device")
            field.click()
            field.fill(emulator.stdout.readline().strip())
            field.press("Enter")
            page.get_by_role("button", name="Connect", exact=True).click()
            page.wait_for_function(FOLLOWS)
            tools = page.context.new_cdp_session(page)
            held, heaps = [], []
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                page.wait_for_timeout(2000)
                tools.send("HeapProfiler.collectGarbage")
                heaps.append(tools.send("Runtime.getHeapUsage")["usedSize"] / 1e6)
                held.append(resident(server.pid))
            counts = {name: page.get_by_test_id(name).inner_text() for name in ("rows", "lost", "rate")}
    finally:
        emulator.terminate()
        emulator.wait(timeout=30)
    tenth = len(held) // 10
    return [
        (f"live page for {seconds:g} s at {counts['rate']}: rows shown", counts["rows"]),
        ("frames lost", counts["lost"]),
        ("memory of the server after a tenth of the time", f"{held[tenth]:.0f} MB"),
        ("at the end", f"{held[-1]:.0f} MB"),
        ("at most", f"{max(held):.0f} MB"),
        ("memory of the page's script after a tenth of the time", f"{heaps[tenth]:.1f} MB"),
        ("at the end", f"{heaps[-1]:.1f} MB"),
    ]


def main() -> None:
    """Measure, and print or write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=20_000_000)
    parser.add_argument("--zooms", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=180.0)
    parser.add_argument("--speed", type=float, default=10.0)
    parser.add_argument("--only", choices=("rows", "page", "live"))
    parser.add_argument("--json", type=Path, help="file of figures: those of a part measured now replace its old ones")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    parts = {
        "rows": lambda: drawn(given.rows, given.zooms),
        "page": lambda: paged(given.rows, given.zooms),
        "live": lambda: live(given.seconds, given.speed),
    }
    found = json.loads(given.json.read_text()) if given.json is not None and given.json.exists() else {}
    for name in parts if given.only is None else (given.only,):
        found[name] = parts[name]()
    if given.json is not None:
        given.json.write_text(json.dumps(found, indent=1))
    rows = tuple(tuple(row) for name in parts for row in found.get(name, ()))
    text = markdown(Table("", ("", ">measured"), rows))
    if given.write:
        write_between(PAGE, BEGIN, END, text)
    else:
        print(text)


if __name__ == "__main__":
    main()
