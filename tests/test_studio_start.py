"""The command of the studio: its arguments, its address, and what it hands to the browser."""

import re
import subprocess
import sys
import time
import webbrowser

import pytest
from click.testing import CliRunner
from imufit.cli import engine
from imufit.cli.app import imufit
from imufit.lab.simulate import simulate
from imufit.lab.simulated_log import save_simulation

ADDRESS = "http://127.0.0.1:5000/some-token/"


@pytest.fixture
def started(monkeypatch):
    """What the engine and the browser were called with; the page that the browser opened, as it was then."""
    seen = {"opened": []}

    def studio(logs, reading, demo, *, port, ready):
        seen.update(logs=[str(log) for log in logs], reading=reading, demo=demo, port=port)
        ready(ADDRESS)

    def opened(address):
        from pathlib import Path
        from urllib.parse import unquote, urlsplit

        path = Path(unquote(urlsplit(address).path))
        seen["opened"].append((address, path.read_text(), path.parent.stat().st_mode & 0o777))

    monkeypatch.setattr(engine, "studio", studio)
    monkeypatch.setattr(webbrowser, "open", opened)
    return seen


def test_the_token_is_not_an_argument_of_the_browser(started, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(imufit, ["studio", "demo"])
    assert result.output == f"{ADDRESS}\n"
    assert started["demo"]
    assert started["logs"] == []
    ((address, page, mode),) = started["opened"]
    assert address.startswith("file://")
    assert "some-token" not in address
    assert re.search(r"url=([^\"]+)", page)[1] == ADDRESS
    assert mode == 0o700


def test_logs_port_and_no_browser(started, tmp_path):
    log = tmp_path / "walk.csv"
    log.write_text("t,acc_x,acc_y,acc_z\n0,0,0,9.8\n")
    result = CliRunner().invoke(imufit, ["studio", str(log), "--port", "5001", "--no-browser", "--frame", "ENU"])
    assert result.exit_code == 0
    assert started["logs"] == [str(log)]
    assert (started["port"], started["demo"], started["opened"]) == (5001, False, [])
    assert started["reading"].frame == "ENU"


@pytest.mark.parametrize("arguments", [["gone.parquet"], ["--port", "70000"]])
def test_what_cannot_be_is_refused(started, arguments):
    assert CliRunner().invoke(imufit, ["studio", *arguments]).exit_code == 2


def test_a_port_that_is_taken_is_named():
    import socket

    server = pytest.importorskip("imufit.studio.server")
    from imufit.errors import InputError

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port} cannot be used"):
            server.serve(port)


def test_a_server_that_is_told_to_end_does_not_wait_for_its_work(tmp_path):
    """The evidence of a long log takes minutes."""
    save_simulation(simulate("handheld", {}, 1, duration=300.0, rate=1000.0), tmp_path / "long.parquet")
    command = [sys.executable, "-m", "imufit", "studio", "long.parquet", "--no-browser"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        assert server.stdout.readline().startswith("http://127.0.0.1:")
        time.sleep(2.0)
        server.terminate()
        # The evidence takes a minute of two idle processors.
        try:
            server.wait(timeout=25.0)
        finally:
            server.kill()
        assert "Traceback" not in server.stderr.read()
