"""The studio in Debian's Chromium: the loop, undo, two models, dropped files, the game, and what is refused."""

import base64
import json
import re
import socket
import subprocess
import sys
import tomllib
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import imufit
import numpy as np
import pytest
from browser import chromium as started_chromium
from browser import needs_chromium
from imufit.figures import quantity
from imufit.lab.simulate import simulate
from imufit.studio import charts
from studio_browser import SLOW_MS, bars, figure, idle, marked, studio, wait_for_bars

pytestmark = needs_chromium

EFFECTS = {"acc.bias": {"x": 0.08, "y": -0.05, "z": 0.03}, "gyr.scale": {"x": 0.03, "y": -0.02, "z": 0.02}}
HOSTILE = (
    "<script>window.broken=1</script>",
    "<img src=x onerror=window.broken=1>",
    "=HYPERLINK(0)",
    "\u202egnp.exe",
    "{{constructor}}",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("browser")
    log = simulate("handheld", EFFECTS, duration=40.0, rate=50.0, seed=4).to_log()
    log.write(path / "walk.parquet")
    log.with_fields(ref_q=None, ref_p=None).write(path / "sensor.csv")
    imufit.Log.from_arrays(log.t + 0.5, ref_q=log.ref_q).write(path / "mocap.csv")
    table = np.column_stack([log.t, log.acc / 9.80665, np.degrees(log.gyr), log.ref_q])
    np.savetxt(path / "odd.csv", table, delimiter=",", header="t,U,V,W,P,Q,R,ref_qw,ref_qx,ref_qy,ref_qz", comments="")
    (path / "broken.csv").write_text("t,acc_x,acc_y,acc_z\n0,1,2,9\n1,1,no,9\n")
    quiet = simulate("handheld", {}, duration=60.0, rate=50.0, seed=4).to_log()
    acc = quiet.acc.copy()
    acc[:, 0] = np.interp(quiet.t - 0.004, quiet.t, acc[:, 0])
    quiet.with_fields(acc=acc).write(path / "late.parquet")
    log.with_fields(covariates=dict.fromkeys(HOSTILE, log.t % 1.0)).write(path / "hostile.parquet")
    return path


@pytest.fixture(scope="module")
def chromium():
    with started_chromium() as running:
        yield running


@pytest.fixture(scope="module")
def address(folder):
    with studio(folder) as found:
        yield found


@pytest.fixture
def page(chromium, address):
    context = chromium.new_context(viewport={"width": 1280, "height": 900}, accept_downloads=True)
    opened = context.new_page()
    asked, problems = [], []
    opened.on("request", lambda request: asked.append(request.url))
    opened.on("pageerror", lambda error: problems.append(str(error)))
    opened.set_default_timeout(SLOW_MS)
    opened.goto(address)
    save = marked(opened, "save")
    if save.is_enabled():
        # The model of the test before gives way unasked.
        with opened.expect_download():
            save.click()
    yield opened
    context.close()
    assert asked
    hosts = {urlsplit(url).hostname for url in asked if urlsplit(url).scheme not in ("data", "blob")}
    assert hosts == {"127.0.0.1"}
    assert problems == []


def drop(page, *paths):
    """Give files to the page as a drop does."""
    if marked(page, "open").is_visible() and not marked(page, "upload").is_visible():
        marked(page, "open").click()
    page.locator('[data-mark="upload"] input[type=file]').last.set_input_files([str(path) for path in paths])


def state_of(page, key):
    """Whether a parameter is estimated or fixed, as the model shows it."""
    return marked(page, f"pin-{key}").locator(".studio-present").inner_text()


def answer(folder, *arguments):
    """Run the program; its JSON."""
    done = subprocess.run(
        [sys.executable, "-m", "imufit", *arguments, "--json", "-"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def test_a_file_that_is_dropped_anywhere_on_the_page_is_opened(page, folder):
    content = base64.b64encode((folder / "walk.parquet").read_bytes()).decode()
    # The page takes files once its own script has run.
    page.wait_for_function("!document.body.dispatchEvent(new DragEvent('dragover', {bubbles: true, cancelable: true}))")
    page.evaluate(
        """content => {
            const bytes = Uint8Array.from(atob(content), letter => letter.charCodeAt(0));
            const carried = new DataTransfer();
            carried.items.add(new File([bytes], 'carried.parquet'));
            const named = kind => new DragEvent(kind, {dataTransfer: carried, bubbles: true, cancelable: true});
            document.querySelector('main').dispatchEvent(named('drop'));
        }""",
        content,
    )
    wait_for_bars(page, 1)
    assert marked(page, "logs").inner_text() == "carried.parquet"


def test_the_loop_gives_the_numbers_of_the_command_line(page, folder):
    drop(page, folder / "walk.parquet")
    (start,) = wait_for_bars(page, 1)
    ladder = answer(folder, "ladder", "walk.parquet")
    assert start == ladder["ratio_start"]
    # The failing panel: the residual leaves the noise of one sample.
    panel = figure(page, "panel")
    now = next(trace for trace in panel["data"] if trace["name"] == "now")
    noise = next(trace for trace in panel["data"] if trace["name"] == "noise")
    assert max(abs(value) for value in now["y"]) > max(noise["y"])
    assert "residual of" in panel["layout"]["yaxis"]["title"]["text"]
    for count, step in enumerate(ladder["steps"], 2):
        marked(page, f"candidate-{step['effect']}").hover()
        page.wait_for_function(
            """() => document.querySelector('[data-mark="panel"] .legend')
                     && document.querySelector('[data-mark="panel"]').textContent.includes('with ')"""
        )
        marked(page, f"add-{step['effect']}").click()
        heights = wait_for_bars(page, count)
        assert heights[-1] == step["after"] < heights[-2]
        expected = next(trace for trace in figure(page, "fall")["data"] if trace["name"] == "expected")
        # Behind it stands the mark of the next step, if one is proposed.
        assert dict(zip(expected["x"], expected["y"], strict=True))[count - 1] == step["expected"]
    for effect, parameters in ladder["parameters"].items():
        for name, item in parameters.items():
            shown = marked(page, f"value-{effect}.{name}").inner_text()
            assert shown == quantity.with_error(item["value"], item["standard_error"], item["unit"])
    assert "noise floor" in marked(page, "verdict").inner_text()

    step_back_and_compare(page, ladder)
    copy_and_save(page, folder)
    open_the_noise(page, folder)


def step_back_and_compare(page, ladder):
    """Undo, redo, switch an effect off beside the second model, and fix a value."""
    marked(page, "undo").click()
    idle(page)
    assert marked(page, f"switch-{ladder['steps'][-1]['effect']}").count() == 0
    marked(page, "redo").click()
    idle(page)
    marked(page, "second").click()
    marked(page, "two").get_by_text("The kept model is the present one.").wait_for()
    # The two are the same yet: one line is enough.
    assert marked(page, "two").locator("xpath=..").bounding_box()["height"] < 60
    first = ladder["steps"][0]["effect"]
    marked(page, f"switch-{first}").click()
    wait_for_bars(page, len(ladder["steps"]) + 2)
    page.wait_for_function("""() => document.querySelector('[data-mark="trace"]').textContent.includes('kept model')""")
    assert "The kept model stands lower" in marked(page, "two-sentence").inner_text()
    evidence = marked(page, "two-evidence").inner_text().replace("\u00a0", " ")
    assert "The log prefers the kept model: the odds are more than 1 000 000 to 1 for the kept one" in evidence
    marked(page, "second").click()
    marked(page, f"switch-{first}").click()
    heights = wait_for_bars(page, len(ladder["steps"]) + 3)
    assert heights[-1] == ladder["ratio_end"]
    marked(page, f"edit-{first}.x").click()
    value = marked(page, "edit-value").locator("input").or_(page.locator("input[data-mark=edit-value]")).first
    value.fill("")
    marked(page, "edit-take").click()
    page.get_by_text("Give a number.").wait_for()
    value.fill("0.25")
    value.press("Enter")
    heights = wait_for_bars(page, len(ladder["steps"]) + 4)
    assert heights[-1] > heights[-2]
    assert marked(page, f"value-{first}.x").inner_text().startswith("0.25 ")
    assert state_of(page, f"{first}.x") == "fixed"
    # a game asks before it takes the place of a model that was built
    marked(page, "mystery").click()
    marked(page, "level-1").click()
    marked(page, "replace").wait_for()
    page.get_by_text("Save the session first?").wait_for()
    marked(page, "replace-cancel").click()
    marked(page, "replace").wait_for(state="detached")
    assert bars(page) == heights
    # An effect that is switched off is in the model already: to add it is to switch it on.
    marked(page, f"switch-{first}").click()
    marked(page, f"add-{first}").get_by_text("Switch on").wait_for()
    idle(page)
    marked(page, "undo").click()
    wait_for_bars(page, len(heights) + 1)
    over = next(trace["text"] for trace in figure(page, "fall")["data"] if trace.get("mode") == "markers+text")
    assert [k for k, text in enumerate(over) if text.startswith("now")] == [len(heights) - 1]
    marked(page, "pin-" + f"{first}.x").wait_for()


def copy_and_save(page, folder):
    """Copy the model as Python; save the session and drop its file."""
    before = bars(page)
    page.get_by_role("button", name="Copy the model").click()
    marked(page, "copy-python").click()
    assert "import imufit" in marked(page, "copied").inner_text()
    page.get_by_role("button", name="Close").click()
    with page.expect_download() as download:
        marked(page, "save").click()
    saved = folder / "walk-session.toml"
    download.value.save_as(saved)
    assert 'kind = "imufit session"' in saved.read_text()
    drop(page, saved)
    page.wait_for_timeout(1000)
    assert wait_for_bars(page, len(before)) == before


def open_the_noise(page, folder):
    """Allan deviation of the longest rest, as `imufit allan` finds it."""
    page.get_by_text("Noise at rest").click()
    found = imufit.allan(imufit.read(folder / "walk.parquet"))
    marked(page, "allan-gyr").wait_for()
    drawn = next(trace for trace in figure(page, "allan-gyr")["data"] if trace["name"] == "x")
    channel = found.channels["gyr_x"]
    assert drawn["x"] == pytest.approx(channel.tau)
    assert drawn["y"] == pytest.approx(quantity.shown_unit(channel.unit)[0] * channel.deviation)


def test_two_tabs_say_that_they_show_one_session(chromium, page, address):
    assert not marked(page, "tabs").is_visible()
    other = chromium.new_page()
    other.goto(address)
    for tab in (page, other):
        tab.get_by_text("This studio is open in two tabs. Both show the same session.").wait_for()
    other.close()
    marked(page, "tabs").wait_for(state="hidden")


def test_the_fall_stands_in_sight_beside_the_candidates(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    for mark in ("fall", "panel"):
        box = marked(page, mark).bounding_box()
        assert box["y"] + box["height"] < 900
    add = page.get_by_role("button", name="Add", exact=True).first.bounding_box()
    assert add["y"] < 900


def test_a_finding_has_its_figure_and_its_words_their_definitions(page, folder):
    drop(page, folder / "late.parquet")
    title = "document.querySelector('[data-mark=panel] .xtitle')"
    page.wait_for_function(f"() => {title} && {title}.textContent.includes('change of the specific force explains')")
    assert "acc_x still depends on df/dt" in marked(page, "verdict").inner_text()
    word = marked(page, "verdict").get_by_text("df/dt", exact=True)
    shown = "element => getComputedStyle(element, '::after').content"
    assert word.evaluate(shown) == "none"
    for point in (word.focus, word.hover):
        point()
        assert "how fast an ideal reading changes" in word.evaluate(shown)
        word.blur()
    page.set_viewport_size({"width": 390, "height": 800})
    page.wait_for_function("() => document.documentElement.scrollWidth === 390")
    for button in page.locator(".studio-head button").all():
        assert button.inner_text().strip()
        assert button.get_attribute("title") == button.get_attribute("aria-label")


READABLE = """() => {
    const numbers = (colour) => colour.match(/[0-9.]+/g).map(Number);
    const light = (colour) => {
        const part = (value) => value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
        const [red, green, blue] = numbers(colour).map((value) => part(value / 255));
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    };
    const beneath = (item) => {
        const colour = getComputedStyle(item).backgroundColor;
        return numbers(colour)[3] === 0 ? beneath(item.parentElement) : colour;
    };
    return [...document.querySelectorAll('button:not([disabled]), a')].filter((item) => item.offsetParent)
        .map((item) => {
            const both = [light(getComputedStyle(item).color), light(beneath(item))];
            const ratio = (Math.max(...both) + 0.05) / (Math.min(...both) + 0.05);
            return [item.textContent, ratio, parseFloat(getComputedStyle(item).fontSize), beneath(item)];
        });
}"""
"""Words, contrast by the formula of the accessibility guidelines (WCAG 2.1), size and ground of all buttons."""


def test_buttons_can_be_read_in_light_and_dark_and_icons_show_their_words(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    grounds = set()
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(
            f"() => document.body.classList.contains('body--dark') === {str(scheme == 'dark').lower()}"
        )
        page.wait_for_timeout(800)
        found = page.evaluate(READABLE)
        assert {"Add", "residual"} <= {words for words, *_ in found}
        assert [item for item in found if item[1] < 4.5] == []
        assert [item for item in found if item[0].strip() and item[2] < 12.0] == []
        grounds |= {ground for *_, ground in found}
    assert len(grounds) >= 6  # page, card and button of both
    marked(page, "add-acc.bias").click()
    wait_for_bars(page, 2)
    shown = "element => getComputedStyle(element, '::after').content"
    assert state_of(page, "acc.bias.x") == "estimated"
    for words in (
        "Undo",
        "Remove accelerometer bias",
        "Edit accelerometer bias x",
    ):
        button = page.get_by_label(words, exact=True)
        button.hover()
        assert button.evaluate(shown) == f'"{words}"'
        page.mouse.move(0, 0)
        page.keyboard.press("Tab")
        button.focus()
        assert button.evaluate(shown) == f'"{words}"'
        button.blur()


def within(page, *elements):
    """Whether elements lie within the window."""
    height = page.viewport_size["height"]
    boxes = [element.bounding_box() for element in elements]
    return all(box["y"] >= -1.0 and box["y"] + box["height"] <= height + 1.0 for box in boxes)


@pytest.mark.parametrize("width", [380, 1280])
def test_the_card_of_a_candidate_opens_in_sight_where_its_name_is_pressed(page, folder, width):
    page.set_viewport_size({"width": width, "height": 600})
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    rows = page.locator('[data-mark^="candidate-"]')
    for k in (1, 3):
        row = rows.nth(k)
        effect = row.get_attribute("data-mark").removeprefix("candidate-")
        name, card = row.locator(".studio-name"), marked(page, f"card-{effect}")
        # The words come first, the id behind them is smaller.
        words, symbol = (name.locator(".nicegui-label, div").nth(i) for i in (0, 1))
        assert (words.inner_text().lower(), symbol.inner_text()) == (imufit.explain(effect).name.lower(), effect)
        size = "element => parseFloat(getComputedStyle(element).fontSize)"
        assert words.evaluate(size) > symbol.evaluate(size)
        # The name stands at the lower edge of the window: beneath it, there is no room for the card.
        name.evaluate("element => element.scrollIntoView({block: 'end', behavior: 'instant'})")
        name.click()
        card.get_by_text("physics:").wait_for()
        page.wait_for_timeout(800)
        assert within(page, name, card)
        assert name.get_attribute("aria-expanded") == "true"
    # A card that was opened before stays, so that no row moved from beneath the pointer.
    assert page.locator('[data-mark^="card-"]:visible').count() == 2
    name.click()
    card.wait_for(state="hidden")


def add_gyr_scale(page, folder):
    """Open the log and add the first of its two effects."""
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    marked(page, "add-gyr.scale").click()
    wait_for_bars(page, 2)


def test_a_contradicted_value_is_named_in_the_place_of_the_figures_of_candidates(page, folder):
    add_gyr_scale(page, folder)
    assert page.get_by_text("% probable").count() > 0
    assert marked(page, "contradicted-gyr.scale.x").count() == 0
    assert marked(page, "holds").count() == 0
    marked(page, "edit-gyr.scale.x").click()
    page.locator("input[data-mark=edit-value], [data-mark=edit-value] input").first.fill("25")
    marked(page, "edit-take").click()
    warning = marked(page, "contradicted-gyr.scale.x")
    warning.wait_for()
    idle(page)
    # The warning stands under the value that it is about.
    value = marked(page, "value-gyr.scale.x").bounding_box()
    assert 0.0 < warning.bounding_box()["y"] - value["y"] < 40.0
    assert "standard errors of the other values grow" in marked(page, "holds").inner_text()
    assert marked(page, "without-figures").is_visible()
    wrong = " ".join(marked(page, "wrong-value").inner_text().split())
    assert wrong == "Wrong value: gyroscope scale error x gyr.scale.x"
    assert page.get_by_text("% probable").count() == 0
    assert charts.NEXT not in figure(page, "fall")["layout"]["xaxis"]["ticktext"]
    assert state_of(page, "gyr.scale.x") == "fixed"
    marked(page, "free-gyr.scale.x").click()
    warning.wait_for(state="detached")
    wait_for_bars(page, 4)
    assert state_of(page, "gyr.scale.x") == "estimated"
    assert page.get_by_text("% probable").count() > 0


def test_the_field_of_a_value_has_its_digits_and_leaves_the_value_as_it_is(page, folder):
    add_gyr_scale(page, folder)
    shown = marked(page, "value-gyr.scale.x").inner_text().split(" ± ")[0]
    marked(page, "edit-gyr.scale.x").click()
    field = page.locator("input[data-mark=edit-value], [data-mark=edit-value] input").first
    assert len(field.input_value()) <= len(shown)
    assert float(field.input_value()) == float(shown)
    marked(page, "edit-take").click()
    wait_for_bars(page, 3)
    with page.expect_download() as download:
        marked(page, "save").click()
    held = tomllib.loads(download.value.path().read_text())["steps"][-1]["stack"][0]["held"]["x"]
    # The value itself was fixed, not its digits.
    fitted = imufit.fit(imufit.read(folder / "walk.parquet")).add("gyr.scale").fit.params["gyr.scale.x"].value
    assert held == fitted != float(shown) / 100.0


PROPOSED = """() => [...document.querySelectorAll('[data-mark=panel] .legendtext')]
    .some((item) => item.textContent.startsWith('with '))"""
"""Whether the figure shows what an effect would explain."""


def test_a_list_that_moves_under_a_resting_pointer_changes_nothing(page, folder):
    page.set_viewport_size({"width": 1280, "height": 700})
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    row = page.locator('[data-mark^="candidate-"]').nth(1)
    # The pointer rests on the heading of the list, where the row comes to lie once the page has moved.
    box, heading = (item.bounding_box() for item in (row, page.get_by_role("heading", name="Candidates")))
    pointer, down = [box["x"] + 20, heading["y"] + 5], round(box["y"] - heading["y"])
    page.mouse.move(*pointer)
    page.wait_for_timeout(700)
    assert not page.evaluate(PROPOSED)
    page.evaluate(f"window.scrollBy({{top: {down}, behavior: 'instant'}})")
    page.wait_for_timeout(1200)
    beneath = "([x, y]) => document.elementFromPoint(x, y).closest('[data-pointed]').dataset.mark"
    assert page.evaluate(beneath, pointer) == row.get_attribute("data-mark")
    assert not page.evaluate(PROPOSED)
    page.mouse.move(pointer[0] + 3, pointer[1])
    page.wait_for_function(PROPOSED)


def test_what_lies_under_the_sentence_stays_in_its_place(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    places = [marked(page, "panel").bounding_box()["y"]]
    for count, effect in enumerate(EFFECTS, 2):
        marked(page, f"add-{effect}").click()
        # While the work is under way, too.
        places.append(page.evaluate("document.querySelector('.studio-middle').offsetTop"))
        wait_for_bars(page, count)
        places.append(page.evaluate("document.querySelector('.studio-middle').offsetTop"))
    assert len(set(places[1:])) == 1


def test_a_switch_stays_beneath_the_pointer_while_two_models_are_compared(page, folder):
    add_gyr_scale(page, folder)
    marked(page, "second").click()
    marked(page, "two").get_by_text("The kept model is the present one.").wait_for()
    place = marked(page, "pin-gyr.scale.z").bounding_box()
    for count, axis in enumerate("xy", 3):
        marked(page, f"pin-gyr.scale.{axis}").get_by_text("fixed").click()
        wait_for_bars(page, count)
        assert marked(page, "pin-gyr.scale.z").bounding_box() == place
    # A value that is fixed where the log has it leaves no residual.
    assert marked(page, "holds").count() == 0
    # A dialog leaves the figures in their place, those that stay in sight while the page scrolls, too.
    page.evaluate("window.scrollTo({top: 400, behavior: 'instant'})")
    top = marked(page, "panel").bounding_box()
    marked(page, "edit-gyr.scale.z").click()
    marked(page, "edit-take").wait_for()
    assert marked(page, "panel").bounding_box() == top


def test_room_on_top_is_given_back_under_the_pointer(page, folder):
    drop(page, folder / "late.parquet")
    wait_for_bars(page, 1)
    height = "document.querySelector('.studio-top').offsetHeight"
    before = page.evaluate(height)
    notes = marked(page, "notes").get_by_role("button").first
    for _ in range(2):
        notes.click()
        page.wait_for_timeout(600)
    assert page.evaluate(height) == before


@pytest.mark.parametrize("width", [900, 1000])
def test_candidates_and_their_figure_are_in_sight_together(page, folder, width):
    page.set_viewport_size({"width": width, "height": 800})
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    page.locator('[data-mark^="candidate-"]').first.scroll_into_view_if_needed()
    figure_box, row = (item.bounding_box() for item in (marked(page, "panel"), marked(page, "candidate-acc.bias")))
    assert figure_box["y"] >= 0.0
    assert figure_box["y"] + figure_box["height"] <= 800
    assert row["x"] + row["width"] < figure_box["x"]


def test_the_page_has_one_scroll_and_names_its_steps(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    page.get_by_text("more candidates").click()
    page.wait_for_timeout(600)
    scrolls = """() => [...document.querySelectorAll('main *')].filter((item) =>
        item.scrollHeight > item.clientHeight + 1 && /auto|scroll/.test(getComputedStyle(item).overflowY)).length"""
    assert page.evaluate(scrolls) == 0
    # The figures stay in sight beside the last candidate.
    page.locator('[data-mark^="candidate-"]').last.scroll_into_view_if_needed()
    assert marked(page, "panel").bounding_box()["y"] >= 0.0
    marked(page, "add-acc.bias").click()
    wait_for_bars(page, 2)
    # An unfolded list stays so.
    assert page.locator('[data-mark^="candidate-"]').last.is_visible()
    steps = marked(page, "steps").locator(".studio-step").all_inner_texts()
    assert [step.split() for step in steps[:2]] == [
        ["0", "ideal", "sensor"],
        ["1", "+", "accelerometer", "bias", "acc.bias"],
    ]
    assert figure(page, "fall")["layout"]["xaxis"]["ticktext"][:2] == ["0", "1"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_button_that_cannot_be_pressed_looks_so(page, scheme):
    page.emulate_media(color_scheme=scheme)
    marked(page, "mystery").click()
    marked(page, "level-1").click()
    reveal = marked(page, "reveal")
    reveal.wait_for()
    idle(page)
    look = """element => { const look = getComputedStyle(element);
        return [look.backgroundColor, look.cursor, getComputedStyle(element, '::before').borderTopStyle]; }"""
    assert reveal.is_disabled()
    assert reveal.evaluate(look) == ["rgba(0, 0, 0, 0)", "not-allowed", "dashed"]
    answer = page.get_by_label("Your answer: choose or type")
    answer.click()
    # The list of answers is grouped.
    page.get_by_role("option").first.wait_for()
    heads = page.locator(".q-menu .q-item__label--header").all_inner_texts()
    assert heads[:2] == ["Accelerometer", "Gyroscope"][: len(heads)]
    assert heads
    answer.fill("gyr.scale")
    answer.press("Enter")
    page.wait_for_timeout(800)
    assert reveal.evaluate(look)[:2] != ["rgba(0, 0, 0, 0)", "not-allowed"]


def test_the_model_is_copied_as_the_c_header_of_the_command_line(page, folder):
    add_gyr_scale(page, folder)
    marked(page, "copy").click()
    marked(page, "copy-c").click()
    model = imufit.fit(imufit.read(folder / "walk.parquet")).add("gyr.scale").fit.model
    assert marked(page, "copied").inner_text().strip() == imufit.export(model, "c-header").strip()
    with page.expect_download() as download:
        marked(page, "save-header").click()
    assert download.value.suggested_filename == "imufit_calibration.h"


def test_the_verdict_and_the_fallen_bars_are_in_one_view_on_a_phone(page, folder):
    page.set_viewport_size({"width": 380, "height": 800})
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    for count, effect in enumerate(EFFECTS, 2):
        marked(page, f"add-{effect}").click()
        wait_for_bars(page, count)
        page.wait_for_timeout(1000)
        assert within(page, marked(page, "verdict"), marked(page, "fall"))


def test_advice_on_a_recording_that_is_too_short_stands_with_the_verdict(page, folder):
    log = simulate("handheld", {}, duration=8.0, rate=50.0, seed=4).to_log().with_fields(ref_q=None, ref_p=None)
    log.write(folder / "short.parquet")
    drop(page, folder / "short.parquet")
    marked(page, "verdict").wait_for()
    idle(page)
    advice = marked(page, "next")
    assert advice.is_visible()
    assert "lay the sensor down in at least 8" in advice.inner_text()
    # It is said once.
    marked(page, "notes").click()
    page.wait_for_timeout(800)
    assert page.get_by_text("lay the sensor down in at least 8").count() == 1


def test_a_log_does_not_replace_a_model_that_is_not_saved(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    page.locator('[data-mark^="add-"]').first.click()
    wait_for_bars(page, 2)
    drop(page, folder / "late.parquet")
    marked(page, "unsaved").wait_for()
    assert "walk.parquet" in marked(page, "logs").inner_text()
    marked(page, "arrivals-cancel").click()
    marked(page, "unsaved").wait_for(state="detached")
    assert len(bars(page)) == 2
    drop(page, folder / "late.parquet")
    marked(page, "offer-open").click()
    wait_for_bars(page, 1)
    assert "late.parquet" in marked(page, "logs").inner_text()


def test_a_typed_answer_counts(page):
    marked(page, "mystery").click()
    marked(page, "level-1").click()
    marked(page, "reveal").wait_for()
    idle(page)
    assert marked(page, "reveal").is_disabled()
    assert marked(page, "unanswered").is_visible()
    answer = page.get_by_label("Your answer: choose or type")
    for key, name, words in (
        ("Enter", "gyr.scale", "Gyroscope scale error (gyr.scale)"),
        ("Tab", "acc.bias", "Accelerometer bias (acc.bias)"),
    ):
        answer.fill(name)
        answer.press(key)
        page.wait_for_timeout(800)
        assert answer.input_value() == words
    assert not marked(page, "unanswered").is_visible()
    marked(page, "reveal").click()
    assert "you named accelerometer bias (acc.bias)" in marked(page, "truth").inner_text()


def test_a_session_does_not_replace_a_model_that_is_not_saved(page, folder, tmp_path):
    session = tmp_path / "other-session.toml"
    session.write_text(
        'kind = "imufit session"\nformat = 1\nposition = 1\nlogs = [{ file = "lost.parquet" }]\n'
        '[[steps]]\naction = "start"\neffect = ""\nstack = []\n'
        '[[steps]]\naction = "add"\neffect = "acc.bias"\nstack = [{ effect = "acc.bias", on = true, held = {} }]\n'
    )
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    page.locator('[data-mark^="add-"]').first.click()
    wait_for_bars(page, 2)
    drop(page, session)
    marked(page, "unsaved").wait_for()
    marked(page, "session-cancel").click()
    marked(page, "unsaved").wait_for(state="detached")
    assert len(bars(page)) == 2
    drop(page, session)
    marked(page, "offer-session").click()
    marked(page, "wanted").wait_for()


def test_a_session_asks_for_its_log(page, folder, tmp_path):
    session = tmp_path / "lost-session.toml"
    session.write_text(
        'kind = "imufit session"\nformat = 1\nposition = 1\nlogs = [{ file = "lost.parquet" }]\n'
        '[[steps]]\naction = "start"\neffect = ""\nstack = []\n'
        '[[steps]]\naction = "add"\neffect = "acc.bias"\nstack = [{ effect = "acc.bias", on = true, held = {} }]\n'
    )
    drop(page, session)
    page.get_by_text("lost-session.toml wants lost.parquet").wait_for()
    page.locator(".q-dialog").wait_for(state="detached")
    (tmp_path / "lost.parquet").write_bytes((folder / "walk.parquet").read_bytes())
    drop(page, tmp_path / "lost.parquet")
    assert len(wait_for_bars(page, 2)) == 2
    assert "lost.parquet" in marked(page, "logs").inner_text()
    assert marked(page, "wanted").count() == 0


def test_two_files_are_joined_and_a_broken_one_is_refused(page, folder):
    drop(page, folder / "broken.csv")
    marked(page, "trouble").wait_for()
    assert "row" in marked(page, "trouble").inner_text()
    page.get_by_role("button", name="Dismiss").click()
    drop(page, folder / "sensor.csv", folder / "mocap.csv")
    marked(page, "offer-join").click()
    marked(page, "verdict").wait_for()
    idle(page)
    assert "sensor.csv" in marked(page, "logs").inner_text()
    assert "s late (correlation 1.000" in marked(page, "joined").inner_text()
    # Rows of the reference between the sensor's own are no gap.
    assert any(trace["name"] == "residual now" for trace in figure(page, "spectrum")["data"])


def test_names_from_a_file_are_text(page, folder):
    drop(page, folder / "hostile.parquet")
    page.wait_for_function("() => document.querySelector('[data-mark=logs]').textContent.includes('hostile')")
    marked(page, "verdict").wait_for()
    idle(page)
    page.get_by_text("more candidates").click()
    for name in HOSTILE[:3]:
        assert page.get_by_text(f"acc.column:{name}").count() > 0
    page.get_by_text(f"acc.column:{HOSTILE[0]}", exact=True).first.click()
    marked(page, "covariate").click()
    # The share of the excess that the covariate explains stands behind its name.
    name = re.escape(HOSTILE[0]).replace("/", r"\/")
    # The list draws what is in sight: typing brings the column there.
    page.keyboard.type(f"{HOSTILE[0]} (")
    page.get_by_role("option", name=re.compile(rf"^{name} \((< )?[\d.]+ %\)$")).click()
    # The legend has the name of the effect that is looked at, too.
    title = "document.querySelector('[data-mark=panel] .xtitle')"
    page.wait_for_function(f"() => {title} && {title}.textContent.includes('<script>')")
    assert "&lt;script&gt;" in figure(page, "panel")["layout"]["xaxis"]["title"]["text"]
    assert HOSTILE[0] in marked(page, "panel").text_content()
    assert page.evaluate("window.broken") is None
    assert "\u202e" not in page.content()


def test_a_game_is_played_and_revealed(page):
    marked(page, "mystery").click()
    marked(page, "level-1").click()
    marked(page, "reveal").wait_for()
    idle(page)
    assert page.get_by_text("probable").count() == 0
    marked(page, "fold-Accelerometer").get_by_text("Accelerometer:").click()
    marked(page, "add-acc.bias").click()
    wait_for_bars(page, 2)
    # Who added an effect has answered with it.
    marked(page, "reveal").click()
    marked(page, "truth").wait_for()
    text = page.locator('[data-mark="truth"]').all_inner_texts()
    assert len(text) == 2
    assert "was hidden, and you named accelerometer bias (acc.bias)" in text[0]
    assert text[1].count("probability") == 1
    rows = marked(page, "hidden-values").locator("tr").all_inner_texts()
    assert rows[0].split() == ["hidden", "estimated", "±", "standard", "error"]
    assert all("±" in row for row in rows[1:])
    assert marked(page, "lesson").inner_text()
    assert page.get_by_text("probable").count() > 0
    another_game_asks_first(page)
    marked(page, "game-close").click()
    marked(page, "truth").wait_for(state="detached")
    assert marked(page, "verdict").is_visible()


def another_game_asks_first(page):
    """Another game does not take the place of a model that is not saved unasked."""
    marked(page, "again").click()
    marked(page, "replace-cancel").click()
    marked(page, "replace-cancel").wait_for(state="detached")
    assert len(bars(page)) == 2


def test_a_new_game_takes_the_old_answers_away_while_it_is_made(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    add = page.locator('[data-mark^="add-"]').first
    add.click()
    wait_for_bars(page, 2)
    marked(page, "mystery").click()
    marked(page, "level-1").click()
    with page.expect_download() as download:
        marked(page, "save-first").click()
    assert download.value.suggested_filename == "walk-session.toml"
    page.wait_for_function("() => document.querySelector('[data-mark=busy]')?.textContent.includes('Hiding')")
    marked(page, "verdict").wait_for(state="detached", timeout=1000)
    marked(page, "reveal").wait_for()
    idle(page)


def test_a_candidate_of_another_sensor_says_that_it_does_not_act_on_the_channel(page, folder):
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    channel = figure(page, "panel")["layout"]["yaxis"]["title"]["text"].removeprefix("residual of ").split(",")[0]
    other = "gyr.bias" if channel.startswith("accelerometer") else "acc.bias"
    page.get_by_text("more candidates").click()
    marked(page, f"candidate-{other}").hover()
    name = imufit.explain(other).name
    page.get_by_text(f"{name[0].upper()}{name[1:]} does not act on {channel}.").wait_for()


def test_the_choice_of_light_or_dark_holds_on_the_next_page(page, address):
    page.emulate_media(color_scheme="light")
    marked(page, "dark").click()
    dark = "() => document.body.classList.contains('body--dark')"
    page.wait_for_function(dark)
    page.goto(f"{address}live")
    page.wait_for_function(dark)
    marked(page, "dark").click()
    page.wait_for_function("() => document.body.classList.contains('body--light')")
    page.goto(address)
    marked(page, "dark").wait_for()
    page.wait_for_timeout(800)
    assert not page.evaluate(f"({dark})()")


def status(address, **headers):
    """The answer's code to a request."""
    try:
        return urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10).status
    except urllib.error.HTTPError as error:
        return error.code


def handshake(address, path, origin):
    """The first line that a websocket's handshake is answered with."""
    parts = urlsplit(address)
    with socket.create_connection((parts.hostname, parts.port), timeout=10) as connection:
        lines = (
            f"GET {path}/_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1",
            f"Host: {parts.netloc}",
            f"Origin: {origin}",
            "Connection: Upgrade",
            "Upgrade: websocket",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        )
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        return connection.recv(4096).decode("latin-1").splitlines()[0]


def test_a_wrong_token_host_or_origin_is_refused(address):
    parts = urlsplit(address)
    own, bare = f"http://{parts.netloc}", f"http://{parts.netloc}/"
    token = parts.path.strip("/")
    assert status(address) == 200
    assert status(address, Origin=own) == 200
    assert status(bare) == 403
    assert status(f"{bare}{token[:-1]}{'y' if token.endswith('x') else 'x'}/") == 403
    assert status(address, Host=f"evil.example:{parts.port}") == 403
    assert status(address, Origin="http://evil.example") == 403
    assert status(address, Origin="null") == 403
    assert status(address, Origin=f"http://127.0.0.1:{parts.port + 1}") == 403
    assert " 101 " in handshake(address, f"/{token}", own)
    assert " 403 " in handshake(address, f"/{token}", "http://evil.example")
    assert " 403 " in handshake(address, "/wrong", own)
    with socket.socket() as outside:
        # Other addresses of this computer are not listened on.
        outside.settimeout(2.0)
        assert outside.connect_ex(("127.0.0.2", parts.port)) != 0


def test_a_second_origin_cannot_open_the_page(chromium, address):
    page = chromium.new_page()
    page.goto("data:text/html,<p>another page</p>")
    outcome = page.evaluate(
        "address => fetch(address).then(answer => answer.type + answer.status).catch(error => 'refused')", address
    )
    assert outcome == "refused"
    page.set_content(f'<iframe src="{address}"></iframe>')
    page.wait_for_timeout(500)
    assert page.frames[1].locator(".studio").count() == 0
    page.close()


def test_the_demonstration_leads_to_a_named_effect_and_a_fallen_error(chromium, folder):
    with studio(folder, "demo") as address:
        page = chromium.new_page(viewport={"width": 380, "height": 800})
        page.set_default_timeout(SLOW_MS)
        page.goto(address)
        (start,) = wait_for_bars(page, 1)
        assert page.evaluate("document.documentElement.scrollWidth") <= 380
        page.get_by_role("button", name="Add", exact=True).first.click()
        after = wait_for_bars(page, 2)[-1]
        assert after < 1.1 < start
        page.wait_for_timeout(1000)
        assert within(page, marked(page, "verdict"), marked(page, "fall"))
        marked(page, "reveal").click()
        marked(page, "truth").wait_for()
        assert marked(page, "truth").inner_text() == "Accelerometer scale error (acc.scale) was hidden."
        run_what_is_copied(page, folder, after)
        page.close()


def run_what_is_copied(page, folder, ratio):
    """Save the log of a demonstration and run the copied program beside it."""
    page.get_by_role("button", name="Copy the model").click()
    marked(page, "copy-python").click()
    program = marked(page, "copied").inner_text()
    with page.expect_download() as download:
        marked(page, "save-log").click()
    download.value.save_as(folder / download.value.suggested_filename)
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True)
    assert float(done.stdout.splitlines()[0]) == ratio


def test_a_button_applies_the_remedy_of_a_fault(page, folder):
    simulate("handheld", {}, duration=40.0, rate=50.0, seed=6, frame="ENU").to_log().write(folder / "frame.csv")
    sidecar = folder / "frame.toml"
    sidecar.write_text(sidecar.read_text().replace('"ENU"', '"NED"'))
    drop(page, folder / "frame.csv", sidecar)
    page.get_by_role("button", name="Read in frame ENU").click()
    page.wait_for_function("() => !document.querySelector('[data-mark=fault]')")
    assert wait_for_bars(page, 1)[0] < 1.1


def test_columns_that_cannot_be_guessed_are_named_in_a_field(page, folder):
    drop(page, folder / "odd.csv")
    marked(page, "mapping").wait_for()
    assert "odd.csv" in marked(page, "arrival").inner_text()
    marked(page, "mapping").fill("acc_x=U[furlong]")
    page.keyboard.press("Enter")
    page.get_by_text("In odd.csv: column acc_x: the unit [furlong] is not known").wait_for()
    assert marked(page, "mapping").input_value() == "acc_x=U[furlong]"
    names = {f"acc_{axis}": f"{column}[g]" for axis, column in zip("xyz", "UVW", strict=True)}
    names |= {f"gyr_{axis}": f"{column}[deg/s]" for axis, column in zip("xyz", "PQR", strict=True)}
    marked(page, "mapping").fill(",".join(f"{name}={column}" for name, column in names.items()))
    page.get_by_role("button", name="Read", exact=True).click()
    (start,) = wait_for_bars(page, 1)
    mapping = [word for name, column in names.items() for word in ("--map", f"{name}={column}")]
    assert start == pytest.approx(answer(folder, "ladder", "odd.csv", *mapping)["ratio_start"], rel=1e-12)


TARGETS = """() => [...document.querySelectorAll(
        'button, a, [role=button], [role=switch], .q-expansion-item .q-item, .q-field__control')]
    .filter((item) => item.offsetParent)
    .map((item) => [item.getAttribute('aria-label') || item.textContent.trim(), item.getBoundingClientRect()])
    .filter(([, box]) => Math.min(box.width, box.height) < 44).map(([words]) => words)"""
"""Whatever is tapped and is smaller than the 44 px of the accessibility guidelines."""


def a_swipe_scrolls_and_buttons_zoom(context, page):
    """A finger that moves down over the trace, the last figure, scrolls the page up and leaves the window as it is."""
    spans = "() => document.querySelector('[data-mark=trace]')._fullLayout.xaxis.range.map(Number)"
    marked(page, "trace").scroll_into_view_if_needed()
    page.wait_for_timeout(800)  # the page may still be on its way to the bars
    before, place = page.evaluate(spans), page.evaluate("scrollY")
    box = marked(page, "trace").bounding_box()
    finger = context.new_cdp_session(page)
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.4 * box["height"]
    finger.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for k in range(11):
        finger.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y + 12 * k}]})
        page.wait_for_timeout(30)
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_function("place => Math.abs(scrollY - place) > 50", arg=place)
    assert page.evaluate(spans) == before
    assert not marked(page, "zoom-mouse").is_visible()
    assert page.get_by_text("Tap an effect").is_visible()
    assert not page.get_by_text("Point at an effect").is_visible()
    marked(page, "zoom-finger").get_by_label("Zoom in").tap()
    middle, half = 0.5 * sum(before), 0.25 * (before[1] - before[0])
    page.wait_for_function(
        f"([a, b]) => {{ const [c, d] = ({spans})(); return Math.abs(a - c) + Math.abs(b - d) < 1e-6 * (b - a); }}",
        arg=[middle - half, middle + half],
    )
    marked(page, "zoom-finger").get_by_label("All of it").tap()
    page.wait_for_function(f"([a, b]) => Math.abs(({spans})()[0] - a) < 1e-6 * (b - a)", arg=before)


def test_a_finger_finds_everything_that_is_tapped(chromium, address, folder):
    context = chromium.new_context(viewport={"width": 380, "height": 800}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.set_default_timeout(SLOW_MS)
    page.goto(address)
    drop(page, folder / "walk.parquet")
    wait_for_bars(page, 1)
    page.locator('[data-mark^="add-"]').first.tap()
    wait_for_bars(page, 2)
    idle(page)
    assert page.evaluate(TARGETS) == []
    # The icons of the head stand in one row.
    places = page.locator(".studio-head button:visible").evaluate_all("(all) => all.map((item) => item.offsetTop)")
    assert len(places) > 3
    assert len(set(places)) == 1
    a_swipe_scrolls_and_buttons_zoom(context, page)
    page.goto(f"{address}live")
    page.get_by_role("button", name="Calibrate").wait_for()
    assert page.evaluate(TARGETS) == []
    context.close()
