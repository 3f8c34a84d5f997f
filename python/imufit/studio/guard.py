"""Who may ask the studio's server: the browser that was given the token, on a page of this server, on this computer."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]

HOST: Final = "127.0.0.1"
NAMES: Final = (HOST, "localhost")
"""Names of this computer by which a browser may address the server; any other points to DNS rebinding."""
REFUSED: Final = 403
POLICY_VIOLATION: Final = 1008
"""Code with which a websocket is closed that may not be opened (RFC 6455, section 7.4.1)."""
MESSAGE: Final = b"This address lacks the token. Open the address that imufit studio printed.\n"


class Guard:
    """An ASGI application that hands on only requests with the token in their path, from this server's own pages.

    Parameters
    ----------
    app : callable
        The application behind it.
    token : str
        First part of every path.
    port : int
        Port that the server listens on.
    """

    def __init__(self, app: Application, token: str, port: int) -> None:
        self.app = app
        self._token = token.encode()
        self._hosts = {f"{name}:{port}" for name in NAMES}
        self._origins = {f"http://{host}" for host in self._hosts}
        connect = " ".join(f"ws://{host}" for host in sorted(self._hosts))
        # The page's frameworks compile their templates in the browser, hence 'unsafe-eval'.
        policy = (
            "default-src 'self' data: blob:; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
            f"style-src 'self' 'unsafe-inline'; connect-src 'self' {connect} data: blob:; "
            "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
        )
        self._added = [
            (b"content-security-policy", policy.encode()),
            (b"referrer-policy", b"no-referrer"),
            (b"x-content-type-options", b"nosniff"),
            (b"cross-origin-resource-policy", b"same-origin"),
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif not self._allowed(scope):
            await _refuse(scope, receive, send)
        else:
            await self.app(scope, receive, self._with_headers(send))

    def _allowed(self, scope: Scope) -> bool:
        """Return whether token, host and origin are this server's."""
        headers = [(name.lower(), value.decode("latin-1")) for name, value in scope["headers"]]
        hosts = [value for name, value in headers if name == b"host"]
        origins = [value for name, value in headers if name == b"origin"]
        given = scope["path"].split("/", 2)[1] if scope["path"].startswith("/") else ""
        return (
            len(hosts) == 1
            and hosts[0] in self._hosts
            and all(origin in self._origins for origin in origins)
            and hmac.compare_digest(given.encode(), self._token)
        )

    def _with_headers(self, send: Send) -> Send:
        """Return `send` that adds what keeps a browser from asking any other host."""

        async def sent(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *self._added]
            await send(message)

        return sent


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer a request that may not be asked."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(MESSAGE)).encode())]
    await send({"type": "http.response.start", "status": REFUSED, "headers": headers})
    await send({"type": "http.response.body", "body": MESSAGE})
