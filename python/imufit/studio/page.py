"""The studio's main page: regions left, middle, right and bottom, one below the other on a phone."""

from __future__ import annotations

from nicegui import ui


def build() -> None:
    """Make the page."""
    ui.label("imufit")
    with ui.element("main").classes("studio"):
        for region in ("left", "middle", "right", "bottom"):
            ui.element("section").classes(f"studio-{region}")
