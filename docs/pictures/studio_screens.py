"""Screens of every view of the studio, on a desk and on a phone, light and dark, by Debian's Chromium.

python docs/pictures/studio_screens.py FOLDER            # every view
python docs/pictures/studio_screens.py FOLDER --docs     # and the pictures of docs/studio.md
"""

import argparse
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import imufit
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Root has no sandbox; the bodies in three dimensions need WebGL, which a machine without a screen computes."""
SLOW_MS = 90_000
"""Longest wait for a piece of work, ms."""
ROTATES_MS = 240_000
"""Longest wait for the free rotation of the emulated device, ms: its six sides take a minute and a half."""
SIZES = {1280: 900, 380: 800}
"""Height of the window by its width, px: a laptop and a phone."""
EFFECTS = {"acc.bias": {"x": 0.08, "y": -0.05, "z": 0.03}, "gyr.scale": {"x": 0.03, "y": -0.02, "z": 0.02}}
IN_DOCS = ("rests", "failing", "fallen", "mystery")
COLOURS = 128
"""Colours of a picture of the documents: the page has some 20, their smooth edges need the others."""


@contextmanager
def studio(folder: Path, *arguments: str) -> Iterator[str]:
    """Run the studio in a folder; its address."""
    command = [sys.executable, "-m", "imufit", "studio", *arguments, "--no-browser"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def marked(page: Page, mark: str) -> Locator:
    """Find the element with a mark."""
    return page.locator(f'[data-mark="{mark}"]').first


def idle(page: Page) -> None:
    """Wait until no work is under way."""
    for _ in range(3):
        page.wait_for_timeout(600)
        marked(page, "busy").wait_for(state="hidden")


def start(page: Page, _folder: Path) -> None:
    """Leave the page as it opens."""
    page.wait_for_timeout(800)


def failing(page: Page, folder: Path) -> None:
    """Open a log and look at the effect that is missing."""
    drop(page, folder / "walk.parquet")
    marked(page, "candidate-gyr.scale").locator(".studio-name").click()
    marked(page, "card-gyr.scale").wait_for()
    page.wait_for_timeout(900)


def bring(page: Page, *files: Path) -> None:
    """Give files to the page."""
    page.locator('[data-mark="upload"] input[type=file]').last.set_input_files([str(file) for file in files])


def drop(page: Page, *files: Path) -> None:
    """Bring files, and wait until they are judged."""
    bring(page, *files)
    marked(page, "verdict").or_(marked(page, "arrival")).first.wait_for()
    idle(page)


def fallen(page: Page, folder: Path) -> None:
    """Add both effects."""
    drop(page, folder / "walk.parquet")
    for effect in EFFECTS:
        marked(page, f"add-{effect}").click()
        marked(page, f"value-{effect}.x").wait_for()
        idle(page)
    page.mouse.move(2, 2)
    page.wait_for_timeout(700)


def two(page: Page, folder: Path) -> None:
    """Hold two models beside each other."""
    fallen(page, folder)
    marked(page, "second").click()
    marked(page, "switch-gyr.scale").click()
    marked(page, "two-sentence").wait_for()
    idle(page)


def reading(page: Page, folder: Path) -> None:
    """Show measured and predicted readings, and the attitude in three dimensions."""
    fallen(page, folder)
    page.get_by_role("button", name="reading", exact=True).click()
    marked(page, "body").get_by_text("Attitude in 3-D").click()
    page.locator(".studio-body canvas").first.wait_for()
    idle(page)


def rests(page: Page, folder: Path) -> None:
    """Open a log without a reference, which its rests judge, and look at what is missing."""
    drop(page, folder / "rests.csv")
    marked(page, "candidate-acc.scale").locator(".studio-name").click()
    marked(page, "card-acc.scale").wait_for()
    page.wait_for_timeout(900)


def files(page: Page, folder: Path) -> None:
    """Bring two files that belong together."""
    drop(page, folder / "sensor.csv", folder / "mocap.csv")


def broken(page: Page, folder: Path) -> None:
    """Bring a file that cannot be read."""
    bring(page, folder / "broken.csv")
    marked(page, "trouble").wait_for()
    page.wait_for_timeout(500)


def columns(page: Page, folder: Path) -> None:
    """Bring a file with columns of unknown names."""
    bring(page, folder / "columns.csv")
    marked(page, "mapping").wait_for()
    page.wait_for_timeout(500)


def unjudged(page: Page, folder: Path) -> None:
    """Open a log that has neither a reference nor rests."""
    bring(page, folder / "moving.csv")
    page.get_by_text("The log cannot be judged").wait_for()


def fault(page: Page, folder: Path) -> None:
    """Open a log in a wrong frame."""
    drop(page, folder / "frame.csv")


def edit(page: Page, folder: Path) -> None:
    """Edit a value."""
    fallen(page, folder)
    marked(page, "edit-acc.bias.x").click()
    page.wait_for_timeout(600)


def contradicted(page: Page, folder: Path) -> None:
    """Fix a value that the log contradicts."""
    drop(page, folder / "walk.parquet")
    marked(page, "add-gyr.scale").click()
    marked(page, "value-gyr.scale.x").wait_for()
    idle(page)
    marked(page, "edit-gyr.scale.x").click()
    page.locator("input[data-mark=edit-value], [data-mark=edit-value] input").first.fill("25")
    marked(page, "edit-take").click()
    marked(page, "contradicted-gyr.scale.x").wait_for()
    idle(page)


def copied(page: Page, folder: Path) -> None:
    """Copy the model as shell."""
    fallen(page, folder)
    page.get_by_role("button", name="Copy the model").click()
    marked(page, "copy-shell").click()
    page.wait_for_timeout(600)


def mystery(page: Page, _folder: Path) -> None:
    """Play a game to the reveal."""
    guess(page, _folder)
    page.get_by_label("Your answer: choose or type").click()
    page.get_by_role("option").nth(1).click()
    marked(page, "reveal").click()
    marked(page, "truth").wait_for()
    idle(page)


def guess(page: Page, _folder: Path) -> None:
    """Begin a game."""
    marked(page, "mystery").click()
    marked(page, "level-1").click()
    marked(page, "reveal").wait_for()
    idle(page)


def live(page: Page, _folder: Path) -> None:
    """Follow an emulated device."""
    page.goto(f"{page.url}live")
    page.get_by_label("device").click()
    page.get_by_role("option").filter(has=page.get_by_text("emulate six_sides", exact=True)).click()
    page.get_by_role("button", name="Connect", exact=True).click()
    page.get_by_text("at rest, ").wait_for()
    page.wait_for_timeout(4000)


def guided(page: Page, folder: Path) -> None:
    """Be guided through a calibration."""
    live(page, folder)
    page.get_by_role("button", name="Calibrate").click()
    page.get_by_test_id("how").wait_for()
    page.wait_for_timeout(4000)


def rotating(page: Page, folder: Path) -> None:
    """Turn the device freely, for the magnetometer."""
    guided(page, folder)
    page.get_by_text("The blue arrow is").wait_for(timeout=ROTATES_MS)
    page.wait_for_timeout(6000)


def calibrated(page: Page, folder: Path) -> None:
    """Look at the values at the end of a calibration."""
    guided(page, folder)
    page.get_by_test_id("values").wait_for(timeout=ROTATES_MS)
    page.wait_for_timeout(1500)


VIEWS: dict[str, Callable[[Page, Path], None]] = {
    view.__name__: view
    for view in (
        start,
        failing,
        fallen,
        two,
        reading,
        rests,
        files,
        broken,
        columns,
        unjudged,
        fault,
        edit,
        contradicted,
        copied,
        guess,
        mystery,
        live,
        guided,
        rotating,
        calibrated,
    )
}


def make_logs(folder: Path) -> None:
    """Write the logs that the views open."""
    log = imufit.simulate("handheld", EFFECTS, duration=60.0, rate=50.0, seed=4).to_log()
    log.write(folder / "walk.parquet")
    log.with_fields(ref_q=None, ref_p=None).write(folder / "sensor.csv")
    imufit.Log.from_arrays(log.t + 0.5, ref_q=log.ref_q).write(folder / "mocap.csv")
    moving = log.rows(300, 1500).with_fields(ref_q=None, ref_p=None, mag=None)
    moving.write(folder / "moving.csv")
    (folder / "columns.csv").write_text("t,U,V,W\n" + "".join(f"{0.01 * k},0,0,9.8\n" for k in range(200)))
    (folder / "broken.csv").write_text("t,acc_x,acc_y,acc_z\n0,1,2,9\n1,1,no,9\n")
    sides = imufit.simulate("six_sides", {"acc.scale": {"x": 0.02, "y": -0.01, "z": 0.03}}, duration=90.0, seed=4)
    laid = sides.to_log()
    imufit.Log(laid.t, acc=laid.acc, gyr=laid.gyr, mag=laid.mag).write(folder / "rests.csv")
    turned = imufit.simulate("handheld", {}, duration=60.0, rate=50.0, seed=6, frame="ENU").to_log()
    turned.write(folder / "frame.csv")
    (folder / "frame.toml").write_text((folder / "frame.toml").read_text().replace('"ENU"', '"NED"'))


def pictures(browser: Browser, view: str, screens: Sequence[tuple[int, str]], logs: Path, to: Path) -> None:
    """Bring the page to a view, then take it at several widths and schemes, the whole length of the page."""
    with tempfile.TemporaryDirectory() as own, studio(Path(own)) as address:
        width = screens[0][0]
        page = browser.new_page(viewport={"width": width, "height": SIZES[width]})
        page.set_default_timeout(SLOW_MS)
        page.goto(address)
        marked(page, "upload").wait_for()
        VIEWS[view](page, logs)
        for width, scheme in screens:
            page.set_viewport_size({"width": width, "height": SIZES[width]})
            page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
            page.wait_for_timeout(900)
            wide = page.evaluate("document.documentElement.scrollWidth")
            if wide > width:
                print(f"{view} at {width} px is {wide} px wide", file=sys.stderr)
            page.screenshot(path=to / f"{view}_{width}_{scheme}.png", full_page=True)
        page.close()


def main() -> None:
    """Take the screens."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--views", nargs="*", default=list(VIEWS), choices=list(VIEWS))
    parser.add_argument("--widths", nargs="*", type=int, default=list(SIZES), choices=list(SIZES))
    parser.add_argument("--schemes", nargs="*", default=["light", "dark"], choices=["light", "dark"])
    parser.add_argument("--docs", action="store_true", help="reduce the pictures of docs/studio.md")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as logs, sync_playwright() as playwright:
        make_logs(Path(logs))
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        screens = [(width, scheme) for width in given.widths for scheme in given.schemes]
        for view in given.views:
            pictures(browser, view, screens, Path(logs), given.folder)
            print(view, flush=True)
        browser.close()
    if given.docs:
        for view in (each for each in IN_DOCS if each in given.views):
            taken = Image.open(given.folder / f"{view}_1280_light.png").convert("RGB")
            small = taken.quantize(COLOURS, dither=Image.Dither.NONE)
            small.save(Path(__file__).parent / f"studio_{view}.png", optimize=True)


if __name__ == "__main__":
    main()
