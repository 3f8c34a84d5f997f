"""Tabs of the browser that show the one session: each one says so where there are more."""

from __future__ import annotations

from typing import Final

from nicegui import Client, ui

EVERY: Final = 1.0
"""Time between two counts of the tabs, s."""


class Tabs:
    """The tabs in which the studio's page is open."""

    def __init__(self) -> None:
        self._clients: list[Client] = []

    @property
    def count(self) -> int:
        """Tabs that are connected now."""
        self._clients = [client for client in self._clients if not client.is_deleted]
        return sum(client.has_socket_connection for client in self._clients)

    def lay_notice(self) -> None:
        """Count the page that is being built, and lay the notice that it shows beside another one."""
        self._clients.append(ui.context.client)
        notice = ui.label().classes("studio-tabs").props("data-mark=tabs role=status")

        def look() -> None:
            notice.set_text(notice_of(self.count))
            notice.visible = bool(notice.text)

        look()
        ui.timer(EVERY, look)


def notice_of(count: int) -> str:
    """Say in how many tabs the studio is open; empty for one.

    Parameters
    ----------
    count : int
        The number of tabs.
    """
    if count < 2:
        return ""
    tabs, all_of_them = ("two", "Both show") if count == 2 else (str(count), "All of them show")
    return f"This studio is open in {tabs} tabs. {all_of_them} the same session."
