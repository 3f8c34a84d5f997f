"""Screens of the report at the width of a phone and of a desk, light and dark, taken with Chromium.

python docs/pictures/report_screens.py FOLDER [--docs]

FOLDER gets every screen as PNG, whole and in pieces of the height of a screen. With ``--docs`` the two pictures of
docs/report.md are written beside this file, too.
"""

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import imufit
from imufit.comparing import compare_with_rows, rows_of_fit
from imufit.report import page
from PIL import Image
from playwright.sync_api import sync_playwright

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SIZES = {380: 820, 1280: 900}
"""Widths and heights of the screens, pixels: a small phone and a laptop."""
SCHEMES = ("light", "dark")
HIDDEN = ("acc.scale", "acc.misalignment", "gyr.bias_temperature", "mag.hard_iron", "mag.soft_iron")
IN_DOCS = {"report_desk": (1280, "light", "#fall", 1100), "report_phone": (380, "dark", "#traces", 380)}
"""Pictures of docs/report.md: screen, section and width, pixels."""


def reports(folder: Path) -> dict[str, Path]:
    """Write the pages that are looked at: every kind of result, with many effects, a rest, and no reference."""
    log = imufit.simulate("arm", dict.fromkeys(HIDDEN), size="large").to_log()
    start = imufit.SensorModel().fit(log)
    ladder = imufit.ladder(log)
    diagnosis = start.diagnose()
    added = start.add(diagnosis.best or HIDDEN[0])
    poses = imufit.simulate("poses", {"acc.bias": None, "acc.scale": None}, 2, 60.0, size="large").to_log()
    poses = poses.with_fields(ref_q=None, ref_p=None, ref_angle=None)
    at_rest = imufit.SensorModel().fit(poses)
    before, rows = compare_with_rows(start.model, log)
    pages = {
        "ladder": page(ladder=ladder, rows=rows_of_fit(ladder.fit, ladder.start), title="The error ladder"),
        "diagnose": page(before, diagnosis, rows=rows_of_fit(start, candidate=diagnosis.best), title="Which effect"),
        "add": page(before, addition=added, rows=rows_of_fit(added.fit, start), title=f"{added.effect} added"),
        "compare": page(before, rows=rows, title="Where the model fails"),
        "rests": page(diagnosis=at_rest.diagnose(), rows=rows_of_fit(at_rest), title="Without a reference"),
    }
    found = {}
    for name, text in pages.items():
        found[name] = folder / f"{name}.html"
        found[name].write_text(text, encoding="utf-8")
    return found


def screens(browser: "Browser", name: str, path: Path, folder: Path) -> None:
    """Take one page at every width and in every scheme, all folds open."""
    for width, height in SIZES.items():
        for scheme in SCHEMES:
            shown = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
            shown.goto(path.as_uri())
            if shown.locator("#chart-picture").count():
                shown.wait_for_selector("#chart-picture[data-ready]")
            shown.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
            shown.wait_for_timeout(300)
            whole = folder / f"{name}_{width}_{scheme}.png"
            shown.screenshot(path=whole, full_page=True)
            picture = Image.open(whole)
            piece = 2 * height
            for number, top in enumerate(range(0, picture.height, piece)):
                part = picture.crop((0, top, picture.width, min(top + piece, picture.height)))
                part.save(folder / f"{name}_{width}_{scheme}_{number:02d}.png")
            shown.close()


def for_docs(browser: "Browser", path: Path) -> None:
    """Take the pictures of docs/report.md."""
    for name, (width, scheme, section, kept) in IN_DOCS.items():
        shown = browser.new_page(viewport={"width": width, "height": SIZES[width]}, color_scheme=scheme)
        shown.goto(path.as_uri())
        shown.wait_for_selector("#chart-picture[data-ready]")
        shown.locator(section).scroll_into_view_if_needed()
        target = Path(__file__).parent / f"{name}.png"
        shown.locator(section).screenshot(path=target)
        picture = Image.open(target).convert("RGB")
        scaled = picture.resize((kept, round(picture.height * kept / picture.width)))
        scaled.quantize(200).save(target, optimize=True)
        shown.close()


def main(folder: str, *options: str) -> None:
    """Write the pages and their screens."""
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    found = reports(target)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        for name, path in found.items():
            screens(browser, name, path, target)
        if "--docs" in options:
            for_docs(browser, found["ladder"])
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
