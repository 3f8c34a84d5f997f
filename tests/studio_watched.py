"""Requests and errors of a page of the studio, for tests in a browser."""

from urllib.parse import urlsplit


def strangers(page):
    """List that fills with the addresses outside this computer that a page asks for."""
    found = []

    def look(url):
        parts = urlsplit(url)
        if parts.scheme not in ("data", "blob") and parts.hostname != "127.0.0.1":
            found.append(url)

    page.on("request", lambda request: look(request.url))
    page.on("websocket", lambda socket: look(socket.url))
    return found


def problems(page):
    """List that fills with the errors of a page."""
    found = []
    page.on("pageerror", lambda error: found.append(str(error)))
    page.on("console", lambda message: found.append(message.text) if message.type == "error" else None)
    return found
