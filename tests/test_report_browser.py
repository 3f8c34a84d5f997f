"""The report in a browser: it fits a phone, asks no host, and its chart zooms, shows values and switches effects."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import chromium, needs_chromium, watched
from imufit.report import page
from imufit.results import Parameter
from loop_results import BIAS, G_SENSITIVITY, comparison, ladder, noise, rows
from playwright.sync_api import Browser, Page

pytestmark = needs_chromium

HOSTILE = '<img src="https://example.com/x" onerror=document.title="taken"></script>$\\href{x}\u202emoor'
MISALIGNED = tuple(Parameter("acc.misalignment", name, 0.01, 1e-4, "1", 0.02) for name in ("xy", "xz", "yx", "yz"))
IRON = tuple(Parameter("mag.hard_iron", name, 4.0, 0.1, "uT", 20.0) for name in "xyz")
SAMPLES = "Bokeh.documents[0].get_model_by_name('samples').data"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Page of a ladder whose covariates and title have hostile names."""
    start = comparison()
    panels = tuple(
        replace(panel, covariate=HOSTILE if panel.covariate == "motor" else panel.covariate) for panel in start.panels
    )
    whole = ladder()
    result = replace(
        whole,
        comparison_start=replace(start, panels=panels),
        diagnosis=replace(whole.diagnosis, noise=noise()),
        fit=type("Fit", (), {"parameters": BIAS + G_SENSITIVITY + MISALIGNED + IRON}),
    )
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(
        page(ladder=result, rows=rows(effects=("gyr.bias", f"gyr.column:{HOSTILE}")), title=f"log {HOSTILE}"),
        encoding="utf-8",
    )
    return path


def opened(browser: Browser, report: Path, width: int = 1280, **options: object) -> Page:
    """Open the page and wait for its chart."""
    shown = browser.new_page(viewport={"width": width, "height": 900}, **options)
    shown.goto(report.as_uri())
    if options.get("java_script_enabled", True):
        shown.wait_for_selector("#chart-picture[data-ready]")
    return shown


@pytest.mark.parametrize("width", [380, 768, 1280])
def test_nothing_is_cut_off_however_narrow_the_screen_is(browser: Browser, report: Path, width: int) -> None:
    shown = opened(browser, report, width)
    shown.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    assert shown.evaluate("document.documentElement.scrollWidth") == width
    beyond = """[...document.querySelectorAll('body *')].filter((each) => !each.closest('.scroll, svg, #chart-picture')
        && each.getBoundingClientRect().right > innerWidth + 1).map((each) => each.outerHTML.slice(0, 80))"""
    assert shown.evaluate(beyond) == []
    shown.close()


def test_letters_of_the_figures_can_be_read_on_a_phone(browser: Browser, report: Path) -> None:
    shown = opened(browser, report, 380, java_script_enabled=False)
    least = """Math.min(...[...document.querySelectorAll('svg text')].map((each) => each.getBoundingClientRect())
        .filter((box) => box.height > 0).map((box) => Math.min(box.height, box.width + 99)))"""
    assert shown.evaluate(least) > 7.0
    shown.close()


def test_the_page_asks_no_host_and_hostile_names_do_nothing(browser: Browser, report: Path) -> None:
    shown = browser.new_page()
    asked, errors = watched(shown)
    dialogs: list[str] = []
    shown.on("dialog", lambda dialog: dialogs.append(dialog.message))
    shown.goto(report.as_uri())
    shown.wait_for_selector("#chart-picture[data-ready]")
    shown.select_option("#chart-channel", "gyr_y")
    assert [each for each in asked if not each.startswith(("file://", "data:", "blob:"))] == []
    assert len([each for each in asked if each.startswith("file://")]) == 1
    assert errors == []
    assert dialogs == []
    assert shown.title() == f"log {HOSTILE}"
    assert shown.locator("img").count() == 0
    shown.close()


def test_the_chart_switches_channels_and_effects(browser: Browser, report: Path) -> None:
    shown = opened(browser, report)
    assert shown.locator("#chart").is_visible()
    assert shown.locator(".still").is_hidden()
    trace = next(each for each in rows().traces if each.channel == "gyr_x")
    factor = 180.0 / np.pi

    def line(name: str) -> np.ndarray:
        return np.array(
            [np.nan if value is None else value for value in shown.evaluate(f"[...{SAMPLES}.{name}]")], dtype=float
        )

    np.testing.assert_allclose(line("residual"), factor * trace.residual, atol=1e-6)
    np.testing.assert_allclose(line("predicted"), factor * trace.predicted, atol=1e-6)
    shown.locator("#chart-effects input").first.uncheck()
    without = factor * (trace.residual + trace.parts["gyr.bias"])
    np.testing.assert_allclose(line("residual"), without, atol=1e-4 * np.nanmax(np.abs(without)))
    shown.select_option("#chart-channel", "acc_z")
    other = next(each for each in rows().traces if each.channel == "acc_z")
    np.testing.assert_allclose(line("measured"), other.measured, atol=1e-5)
    shown.close()


def test_the_chart_zooms_into_what_is_dragged_over_and_shows_values(browser: Browser, report: Path) -> None:
    shown = opened(browser, report)
    picture = shown.locator("#chart-picture")
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    assert box is not None
    x_range = """(() => {
        const found = [...Bokeh.documents[0].roots()[0].references()].find((each) => each.type === 'Figure');
        return [found.x_range.start, found.x_range.end];
    })()"""
    before = shown.evaluate(x_range)
    y = box["y"] + 150
    shown.mouse.move(box["x"] + 0.3 * box["width"], y)
    shown.mouse.move(box["x"] + 0.5 * box["width"], y)
    shown.wait_for_timeout(200)
    values = shown.locator(".bk-tooltip-custom, .bk-tooltip-row-label, .bk-tooltip-row-value").all_text_contents()
    assert {"time, s: ", "measured: ", "predicted: ", "residual before: ", "residual now: "} <= set(values)
    shown.mouse.move(box["x"] + 0.3 * box["width"], y)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 0.5 * box["width"], y + 60, steps=5)
    shown.mouse.up()
    shown.wait_for_timeout(200)
    after = shown.evaluate(x_range)
    assert after[1] - after[0] < 0.4 * (before[1] - before[0])
    shown.close()


def test_a_finger_on_the_chart_scrolls_the_page(browser: Browser, report: Path) -> None:
    shown = opened(browser, report, 380, has_touch=True, is_mobile=True)
    layers = shown.locator("#chart-picture .bk-events")
    assert layers.count() == 2
    assert {layers.nth(k).evaluate("(each) => getComputedStyle(each).touchAction") for k in range(2)} == {"auto"}
    shown.close()


def test_a_figure_in_space_turns(browser: Browser, report: Path) -> None:
    shown = opened(browser, report)
    _, errors = watched(shown)
    figures = shown.locator(".space.turns")
    assert figures.count() == 2
    ends = """(held) => [...held.querySelectorAll('polyline')].map((each) => each.getAttribute('points'))"""
    for k in range(2):
        figure = figures.nth(k)
        figure.scroll_into_view_if_needed()
        still = set(figure.locator("svg text").all_text_contents())
        figure.press("ArrowRight")
        before = figure.evaluate(ends)
        assert before
        words = figure.locator("svg text").all_text_contents()
        named = {word for word in words if word.startswith(("acc", "mag"))}
        assert len(named) == 3
        assert named <= still
        box = figure.bounding_box()
        assert box is not None
        x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
        shown.mouse.move(x, y)
        shown.mouse.down()
        shown.mouse.move(x + 60, y + 10, steps=4)
        shown.mouse.up()
        after = figure.evaluate(ends)
        assert len(after) == len(before)
        assert after != before
        shown.mouse.move(x - 60, y)
        assert figure.evaluate(ends) == after
    assert errors == []
    shown.close()


def test_without_scripts_the_still_figures_stay(browser: Browser, report: Path) -> None:
    shown = opened(browser, report, java_script_enabled=False)
    assert shown.locator("#chart").is_hidden()
    assert shown.locator(".still figure").first.is_visible()
    assert shown.locator(".still .desk svg").first.is_visible()
    shown.close()


def test_on_paper_the_still_figures_stand_in_the_light_and_folds_are_open(browser: Browser, report: Path) -> None:
    shown = opened(browser, report, color_scheme="dark")
    shown.emulate_media(media="print")
    assert shown.locator("#chart").is_hidden()
    assert shown.locator(".still .desk svg").first.is_visible()
    assert shown.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    shown.close()


def test_figures_and_chart_follow_the_dark_palette(browser: Browser, report: Path) -> None:
    for scheme, paper in (("light", "rgb(255, 255, 255)"), ("dark", "rgb(21, 23, 26)")):
        shown = opened(browser, report, color_scheme=scheme)
        assert shown.evaluate("getComputedStyle(document.body).backgroundColor") == paper
        fill = "getComputedStyle(document.querySelector('#fall .desk svg path')).fill"
        assert shown.evaluate(fill) == paper
        shown.close()
