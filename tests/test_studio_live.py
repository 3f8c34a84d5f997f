"""The live page in Chromium: an emulated device is followed, recorded and guided through a calibration."""

import re

import numpy as np
import pytest
from browser import WEBGL, chromium, needs_chromium
from imufit.lab.simulate import SCENARIOS
from imufit.log import read
from studio_browser import studio
from studio_watched import problems, strangers

pytestmark = needs_chromium
PATIENCE = 30_000  # ms
DRAWN = "[...document.querySelectorAll('.js-plotly-plot')].map(plot => plot.data?.[0]?.x?.length ?? 0)"
"""Points of the first trace of every figure."""


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    with studio(folder) as address, chromium(WEBGL) as browser:
        yield folder, address, browser


def number(page, name):
    return int(page.get_by_test_id(name).inner_text().replace(" ", "") or 0)


def words(page, part):
    """Text of one part of every figure."""
    return [text.strip() for text in page.locator(f".js-plotly-plot .{part}").all_text_contents()]


def wait_until(page, holds):
    """Look again until it holds."""
    for _ in range(PATIENCE // 100):
        if holds():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it did not come to that")


def connect(page, scenario):
    page.get_by_label("device").click()
    entry = page.get_by_role("option").filter(has=page.get_by_text(f"emulate {scenario}", exact=True))
    assert SCENARIOS[scenario].description in entry.inner_text()
    entry.click()
    about = page.get_by_test_id("about").inner_text()
    assert "with accelerometer, gyroscope, magnetometer and thermometer" in about
    assert about.endswith("errors within the data sheet of an MPU-6050 as well.")
    page.get_by_role("button", name="Connect", exact=True).click()
    wait_until(page, lambda: number(page, "rows") > 50)


def part_from_the_device(page):
    """Disconnect: the last numbers stay beside the last readings."""
    wait_until(page, lambda: max(page.evaluate(DRAWN), default=0) > 50)
    page.get_by_role("button", name="Disconnect").click()
    page.get_by_text("Not connected").wait_for(timeout=PATIENCE)
    assert number(page, "rows") > 50
    page.get_by_role("button", name="Light or dark").click()
    page.wait_for_function("() => document.body.classList.contains('body--dark')")


def the_recording_says_where_it_is(page, path, rows):
    """The whole path is stated, and the browser can have the file."""
    assert f"Saved as {path.resolve()}." in page.get_by_test_id("recorded").inner_text()
    with page.expect_download() as download:
        page.get_by_test_id("download").click()
    assert download.value.suggested_filename == path.name
    assert download.value.path().stat().st_size == path.stat().st_size > rows


def the_guide_shows_the_side(page):
    """Its picture is in sight, and its words name the arrow that is to point up or down."""
    page.get_by_test_id("how").wait_for(timeout=PATIENCE)
    wait_until(page, lambda: page.locator(".studio-body canvas").count() == 2)
    # Guided, a person sees the picture without scrolling, and which arrow is to point where.
    picture = page.locator(".studio-body canvas").first.bounding_box()
    assert picture["y"] + picture["height"] <= 900
    how = page.get_by_test_id("how").inner_text()
    assert re.search(r"[+-][xyz] is up when the [xyz] arrow points (up|down)", how)
    # The bar follows the device at once.
    assert (
        page.locator(".q-linear-progress__model").first.evaluate("bar => getComputedStyle(bar).transitionDuration")
        == "0s"
    )


def the_guide_begins_and_ends_in_its_place(page):
    """Neither its begin nor its end moves its button beneath the pointer."""
    start = page.get_by_role("button", name="Calibrate")
    place = start.bounding_box()
    start.click()
    the_guide_shows_the_side(page)
    page.get_by_role("button", name="Stop", exact=True).click()
    wait_until(page, lambda: page.locator(".studio-body canvas").count() == 1)
    assert (start.bounding_box()["x"], start.bounding_box()["y"]) == (place["x"], place["y"])


def test_unusable_port_and_hostile_names_are_text(served):
    folder, address, browser = served
    page = browser.new_page(viewport={"width": 380, "height": 800})
    wrong = problems(page)
    page.goto(f"{address}live")
    page.get_by_text("Connect a device first.").wait_for(timeout=PATIENCE)
    # The words come with the page; what is typed before the page is connected is lost.
    page.wait_for_function("() => window.did_handshake", timeout=PATIENCE)
    wait_until(page, lambda: page.get_by_test_id("record").is_disabled())
    assert page.get_by_role("button", name="Calibrate").is_disabled()
    # An emulated device has no bits per second.
    assert not page.get_by_label("bits per second").is_visible()
    field = page.get_by_label("device")
    field.click()
    field.fill("/dev/<img src=x onerror=document.title='taken'>")
    field.press("Enter")
    page.get_by_label("bits per second").wait_for(timeout=PATIENCE)
    page.get_by_role("button", name="Connect", exact=True).click()
    page.get_by_text("cannot be opened").or_(page.get_by_text("does not exist")).wait_for(timeout=PATIENCE)
    assert page.title() == "imufit live"
    # the counters stand in one row
    tops = page.locator(".studio-live-value").evaluate_all("all => all.map(item => item.offsetTop)")
    assert len(tops) == 5
    assert len(set(tops)) == 1
    # nothing is wider than a phone
    assert page.evaluate("document.documentElement.scrollWidth") <= 380
    assert wrong == []
    assert not list(folder.glob("recording*"))
    page.close()


def test_emulated_device_is_followed_recorded_and_guided(served):
    folder, address, browser = served
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    asked, wrong = strangers(page), problems(page)
    page.goto(f"{address}live")
    connect(page, "six_sides")

    # rows arrive, and so do the traces of every sensor and the attitude
    first = number(page, "rows")
    wait_until(page, lambda: number(page, "rows") > first + 50)
    wait_until(page, lambda: page.get_by_test_id("rate").inner_text().endswith("Hz"))
    panels = ["accelerometer", "gyroscope", "magnetometer", "temperature"]
    wait_until(page, lambda: words(page, "gtitle") == panels)
    assert words(page, "ytitle") == ["m/s²", "deg/s", "µT", "°C"]
    wait_until(page, lambda: min(page.evaluate(DRAWN)) > 50)
    page.get_by_text(re.compile(r"^at rest, [+-][xyz] up$")).wait_for(timeout=PATIENCE)
    angles = page.get_by_text("roll", exact=False).first
    angles.wait_for(timeout=PATIENCE)
    assert "(filter " in angles.inner_text()
    assert page.locator(".studio-body canvas").count() == 1

    # the red button records a log that imufit reads back; a page that is loaded again finds the recording running
    page.get_by_test_id("file").fill("walk.parquet")
    page.get_by_test_id("record").click()
    wait_until(page, lambda: "recording walk.parquet" in page.get_by_test_id("recorded").inner_text())
    # The guide records, too: it waits for the end of this recording.
    wait_until(page, lambda: page.get_by_role("button", name="Calibrate").is_disabled())
    page.wait_for_timeout(1500)
    page.reload()
    wait_until(page, lambda: "recording walk.parquet" in page.get_by_test_id("recorded").inner_text())
    page.get_by_test_id("record").click()
    wait_until(page, lambda: page.get_by_test_id("recorded").inner_text().startswith("walk.parquet: "))
    log = read(folder / "walk.parquet")
    assert log.n > 100
    # The device has errors within its data sheet: 0.08 g and 3 % of g.
    assert np.linalg.norm(log.acc, axis=1).mean() == pytest.approx(9.8, abs=1.1)
    assert f"{log.n} rows" in page.get_by_test_id("recorded").inner_text()
    the_recording_says_where_it_is(page, folder / "walk.parquet", log.n)

    # the times of the four panels stand over one another
    edges = page.evaluate("[...document.querySelectorAll('.js-plotly-plot')].map(plot => plot._fullLayout._size.l)")
    assert len(set(edges)) == 1

    # the guide names a side and draws it; stopping keeps the rows
    the_guide_begins_and_ends_in_its_place(page)
    wait_until(page, (folder / "calibration-1.parquet").exists)

    # the recording opens in the studio, and the device stays connected
    page.get_by_test_id("look").click()
    page.wait_for_function("() => document.querySelector('[data-mark=logs]')?.textContent === 'calibration-1.parquet'")
    wait_until(page, lambda: max(page.evaluate(DRAWN), default=0) > 50)
    # The studio shows that the device is followed.
    assert page.locator("[data-mark=live-sign]").inner_text().split("\n")[0] == "Live: listening"
    page.goto(f"{address}live")
    part_from_the_device(page)

    # so does it after the device has gone, on a page that is loaded again, too
    page.reload()
    page.get_by_test_id("look").click()
    page.wait_for_function("() => document.querySelector('[data-mark=logs]')?.textContent === 'calibration-1.parquet'")
    page.locator("[data-mark=live-sign]").wait_for(state="hidden")
    assert asked == []
    assert wrong == []
    page.close()
