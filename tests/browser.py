"""Debian's Chromium for tests of pages: no screen, no network, one browser for all tests of a file."""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = shutil.which("chromium")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None and "CI" not in os.environ, reason="Debian's Chromium is not installed"
)
"""Mark of tests that need it; a machine of CI without it fails."""
WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Arguments for WebGL by software: machines that run tests have no graphics card."""


@contextmanager
def chromium(arguments: Sequence[str] = ()) -> Iterator[Browser]:
    """Start Chromium and stop it at the end."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", *arguments])
        try:
            yield browser
        finally:
            browser.close()


def watched(page: Page) -> tuple[list[str], list[str]]:
    """Return the addresses that a page asks for and the errors that it reports, both filled as they come."""
    asked: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type in ("error", "warning") else None)
    return asked, errors
