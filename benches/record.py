"""`imufit emulate` and `imufit record` side by side, as processes of their own: what is lost, when it is said to be.

Two devices, each in real time on a pty: nine axes and a thermometer as floats at 1 kHz, and a GY-86 at the highest
rate that a line of 921 600 baud carries. The device's clock goes 40 ppm fast. Printed for each: samples that the device
sent and that the log lacks, by how much the log's times are off the host's time at which each sample was taken (the
emulator knows it; median, 99.9th percentile, largest), the drift found, and what each process takes of one core.

Run: ``python benches/record.py [--duration S]``; without it 60 s and 600 s.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from imufit import read

IMUFIT = [sys.executable, "-c", "import sys; from imufit.cli.app import main; sys.exit(main())"]
DRIFT = 40.0
DEVICES = (
    ("9 axes, floats, 1 kHz", 60.0, ["--rate", "1000"]),
    ("GY-86, 921 600 baud", 600.0, ["--device", "gy86", "--baud", "921600", "--rate", "max"]),
)


def run(duration: float, device: list[str], folder: Path) -> dict[str, object]:
    """Emulate and record once; return what came of it."""
    sent, log, told = folder / "sent.parquet", folder / "log.parquet", folder / "record.json"
    options = ["--loop", "--duration", str(duration), "--wait", "--clock-drift", str(DRIFT), "--sent", str(sent)]
    emulator = subprocess.Popen([*IMUFIT, "emulate", "handheld", *device, *options], stdout=subprocess.PIPE, text=True)
    assert emulator.stdout is not None
    port = emulator.stdout.readline().strip()
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(
        [*IMUFIT, "record", port, "-o", str(log), "--give-up", "2", "--quiet", "--json", str(told)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    passed = time.monotonic() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    emulator.communicate(timeout=60)
    recording, table, made = json.loads(told.read_text()), pq.read_table(sent).to_pandas(), read(log)
    whole = table[table.intact]
    lost = len(whole) - made.n
    off = np.full(1, np.nan)
    if not lost:
        began = datetime.fromisoformat(recording["began"]).timestamp()
        off = 1e3 * np.abs(began + made.t - whole.t_host.to_numpy())
    return {
        "rate": len(table) / duration,
        "sent": len(whole),
        "unread": len(table) - len(whole),
        "lost": lost,
        "gaps": len(recording["gaps"]),
        "off": [float(np.median(off)), float(np.quantile(off, 0.999)), float(off.max())],
        "drift": recording["clock"]["drift_ppm"],
        "recording": recording["cpu_share"],
        "whole": used / passed,
    }


def main() -> None:
    """Print one row for each device."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--duration", type=float, help="Length of each run, s.")
    chosen = parser.parse_args().duration
    print(f"{'device':<24}{'s':>6}{'Hz':>7}{'sent':>10}{'lost':>6}{'gaps':>6}", end="")
    print(
        f"{'off by, ms: median':>20}{'99.9 %':>9}{'largest':>9}{'drift ppm':>11}{'CPU recording':>15}{'all of it':>11}"
    )
    for name, length, device in DEVICES:
        duration = chosen or length
        with tempfile.TemporaryDirectory() as folder:
            found = run(duration, device, Path(folder))
        middle, high, top = found["off"]
        print(f"{name:<24}{duration:>6.0f}{found['rate']:>7.0f}{found['sent']:>10}{found['lost']:>6}", end="")
        print(f"{found['gaps']:>6}{middle:>20.3f}{high:>9.3f}{top:>9.3f}{found['drift']:>11.2f}", end="")
        print(f"{found['recording']:>15.1%}{found['whole']:>11.1%}", flush=True)


if __name__ == "__main__":
    main()
