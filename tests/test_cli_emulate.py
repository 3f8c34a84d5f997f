"""``imufit emulate``: the port on its first line, what was sent at its end, and what it refuses."""

import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pyarrow.parquet as pq
import pytest
import serial
from emulated import keys
from imufit import Log, _imufit
from test_cli_errors import fails

DEADLINE = 30.0


@contextmanager
def emulate(*arguments, tell="stdout"):
    """Run the command; yields the process and the port that it tells."""
    command = [sys.executable, "-c", "import sys; from imufit.cli.app import main; sys.exit(main())", "emulate"]
    process = subprocess.Popen(
        [*command, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process, getattr(process, tell).readline().strip()
    finally:
        process.kill()
        process.communicate()


def read_until_it_hangs_up(port):
    decoder, end = _imufit.WireDecoder(), time.monotonic() + DEADLINE
    with serial.serial_for_url(port, timeout=0) as line:
        try:
            while time.monotonic() < end:
                decoder.feed(line.read(65536))
                time.sleep(0.002)
        except (serial.SerialException, OSError):
            pass
    return decoder.take()


@pytest.mark.parametrize("on", ["pty", "socket://127.0.0.1:0"])
def test_port_stands_on_the_first_line_and_the_truth_in_the_file(tmp_path, on):
    sent, told = tmp_path / "sent.parquet", tmp_path / "told.json"
    options = ("--rate", 500, "--duration", 3, "--speed", "max", "--on", on, "--fault", "drop@1:20", "--seed", 2)
    with emulate("poses", *options, "--sent", sent, "--json", told) as (process, port):
        assert port.startswith("/dev/" if on == "pty" else "socket://127.0.0.1:")
        batches = read_until_it_hangs_up(port)
        out, err = process.communicate(timeout=DEADLINE)
    assert (process.returncode, err) == (0, "")
    assert "1500 samples over 3.0 s: 1480 sent whole" in " ".join(out.split())
    table = pq.read_table(sent).to_pandas()
    np.testing.assert_array_equal(keys(batches), table[table.intact][["start", "sequence", "stamp"]].to_numpy())
    summary = json.loads(told.read_text())
    assert {k: summary[k] for k in ("samples", "intact", "starts")} == {"samples": 1500, "intact": 1480, "starts": 1}
    assert [fault["kind"] for fault in summary["faults"]] == ["drop"] * 20


def test_ctrl_c_ends_it_with_its_summary_which_alone_stands_on_standard_output():
    with emulate("handheld", "--loop", "--wait", "--json", "-", tell="stderr") as (process, port):
        assert port.startswith("/dev/")
        with serial.serial_for_url(port, timeout=DEADLINE) as line:
            assert len(line.read(2000)) == 2000
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=DEADLINE)
    assert (process.returncode, err) == (0, "")
    summary = json.loads(out)
    assert summary["port"] == port
    assert 0 < summary["samples"] < 6000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], "neither a scenario nor a file"),
        (["poses", "--rate", "0"], "neither a number above 0 nor max"),
        (["poses", "--speed", "slow"], "neither a number above 0 nor max"),
        (["poses", "--rate", "9000", "--baud", "115200"], "the highest that fits"),
        (["poses", "--fault", "flood@1"], "'flood' is not known"),
        (["poses", "--fault-rate", "crc"], "does not read KIND=PER_SECOND"),
        (["poses", "--fault", "unplug@1"], "Give --link"),
        (["poses", "--effect", "acc.bios"], "did you mean acc.bias"),
        (["poses", "--on", "socket://example.org:1"], "not this machine"),
        (["poses", "--sent", "sent.csv"], ".parquet"),
        (["walk.csv", "--device", "mpu6050"], "has no gyr_x"),
        (["walk.csv", "--sent", "walk.csv"], ".parquet"),
    ],
)
def test_what_cannot_be_emulated_is_told_in_one_line(capsys, monkeypatch, tmp_path, arguments, words):
    monkeypatch.chdir(tmp_path)
    Log.from_arrays(np.arange(20) * 0.01, acc=np.ones((20, 3))).write(tmp_path / "walk.csv")
    assert words in fails(capsys, "emulate", *arguments)
