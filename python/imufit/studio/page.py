"""The studio's main page: sentence, model, panels, candidates, and the fall of the error."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib.resources import files
from typing import Final

from nicegui import ui

from imufit.studio.desk import Desk
from imufit.studio.tabs import Tabs
from imufit.studio.view_body import BodyView
from imufit.studio.view_candidates import CandidateView
from imufit.studio.view_fall import FallView
from imufit.studio.view_model import ModelView
from imufit.studio.view_noise import NoiseView
from imufit.studio.view_panels import PanelView
from imufit.studio.view_top import Head, Top, takes_drops
from imufit.studio.view_two import TwoView
from imufit.studio.view_words import WordsView

AHEAD_S: Final = 0.02
"""Time that the server has for sending the numbers of a change, s."""


def page_of(desk: Desk, sign: Callable[[], None]) -> Callable[[], None]:
    """Return what builds the page of a desk for one browser.

    Parameters
    ----------
    desk : Desk
        The state that all pages share.
    sign : callable
        Lays the sign of what runs on another page.
    """
    tabs = Tabs()
    style = files("imufit.studio").joinpath("studio.css").read_text(encoding="utf-8")

    def build() -> None:
        ui.add_css(style)
        takes_drops(desk)
        head = Head(desk, sign)
        tabs.lay_notice()
        with ui.element("main").classes("studio") as main:
            with _region("top"):
                top = Top(desk)
            with ui.element("div").classes("studio-figures"):
                with _region("two") as beside:
                    two = TwoView(desk)
                with _region("middle") as middle:
                    panels = PanelView(desk)
                    noise = NoiseView(desk)
                    body = BodyView(desk)
            with _region("right") as right:
                candidates = CandidateView(desk, panels)
            with _region("fall") as steps:
                fall = FallView(desk)
            with _region("left") as left:
                model = ModelView(desk)
                fall.lay_names()
                vocabulary = WordsView(desk)

        def numbers() -> None:
            middle.visible = desk.session is not None
            judged = desk.session is not None and not desk.session.refused
            for region in (right, steps, left):
                region.visible = judged
            main.classes(**({"remove": "studio-rows"} if judged else {"add": "studio-rows"}))
            for view in (head, model, fall, two):
                view.refresh()
            beside.visible = two.kept

        def pictures() -> None:
            for view in (top, candidates, panels, vocabulary):
                view.refresh()
            noise.renew()
            body.renew()

        async def pictures_after() -> None:
            # Numbers are on their way to the browser before figures are made, which takes longer.
            await asyncio.sleep(AHEAD_S)
            pictures()

        desk.changed.subscribe(numbers)
        desk.changed.subscribe(pictures_after)
        numbers()
        pictures()

    return build


def _region(name: str) -> ui.element:
    return ui.element("section").classes(f"studio-region studio-{name}")
