"""The studio in a process of its own and a browser on it, for tests of its pages."""

import subprocess
import sys
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

CHROMIUM = "/usr/bin/chromium"
# WebGL by software: machines that run tests have no graphics card.
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@contextmanager
def studio(folder, *arguments):
    """Start `imufit studio` in a folder; gives the address that it prints."""
    command = [sys.executable, "-m", "imufit", "studio", "--no-browser", *map(str, arguments)]
    with (folder / "studio.err").open("w") as errors:
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=errors, text=True)
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(10.0)
            process.kill()
            process.stdout.close()


def strangers(page):
    """List that fills with the addresses outside this computer that a page asks for."""
    found = []

    def look(request):
        parts = urlsplit(request.url)
        if parts.scheme not in ("data", "blob") and parts.hostname != "127.0.0.1":
            found.append(request.url)

    page.on("request", look)
    page.on("websocket", lambda socket: look(type("Asked", (), {"url": socket.url})))
    return found


def problems(page):
    """List that fills with the errors of a page."""
    found = []
    page.on("pageerror", lambda error: found.append(str(error)))
    page.on("console", lambda message: found.append(message.text) if message.type == "error" else None)
    return found
