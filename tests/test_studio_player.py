"""The log's attitudes on the studio's page in Chromium: what the browser draws is turned as the log says."""

import numpy as np
import pytest
from browser import WEBGL, chromium, needs_chromium
from imufit.lab.simulate import simulate
from imufit.studio.attitudes import reference_track, scene_rotation
from studio_browser import SLOW_MS, idle, studio
from studio_watched import problems, strangers

pytestmark = needs_chromium

TURNED = """() => {
    const scene = document.querySelector('.studio-body');
    const found = {};
    getElement(Number(scene.id.slice(1))).scene.traverse(object => {
        if (object.type === 'Group' && object.visible) found[object.name] = object.matrixWorld.elements;
    });
    return found;
}"""
"""Matrix of each body that is shown, column by column, as three.js draws them."""


def test_player_turns_the_bodies_as_the_log_says(tmp_path):
    log = simulate("handheld", {"gyr.bias": {"x": 0.02, "y": -0.01, "z": 0.03}}, 3, 30.0).to_log()
    log.write(tmp_path / "walk.parquet")
    with studio(tmp_path, "walk.parquet") as address, chromium(WEBGL) as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        asked, wrong = strangers(page), problems(page)
        page.goto(address)
        page.get_by_text("Attitude in 3-D").click()
        idle(page)
        page.get_by_text("off", exact=False).first.wait_for(timeout=SLOW_MS)
        clock = page.get_by_text(" s of 30.0 s")
        # The player starts where each body has an attitude: the filter needs some rows before its first one.
        assert 0.0 <= float(clock.inner_text().split(" s of")[0]) < 0.5
        assert page.get_by_text("not known").count() == 0
        assert set(page.evaluate(TURNED)) == {"measured", "predicted", "reference"}
        page.get_by_label("play").click()
        page.wait_for_timeout(3000)
        page.get_by_label("play").click()
        page.wait_for_timeout(500)
        time = float(clock.inner_text().split(" s of")[0])
        assert 1.0 < time < 10.0
        bodies = {name: np.array(matrix).reshape(4, 4).T[:3, :3] for name, matrix in page.evaluate(TURNED).items()}
        assert set(bodies) == {"measured", "predicted", "reference"}
        # The clock shows hundredths: the row is one of two.
        track = reference_track(log)
        rows = [scene_rotation(track.at(time + late), log.metadata.frame) for late in (-0.005, 0.005)]
        truth = min(rows, key=lambda row: np.abs(row - bodies["reference"]).max())
        np.testing.assert_allclose(bodies["reference"], truth, atol=1e-4)
        # the angle between each of the others and the reference, as the legend states it
        for name in ("measured", "predicted"):
            body = bodies[name]
            angle = np.degrees(np.arccos(np.clip((np.trace(body @ truth.T) - 1.0) / 2.0, -1.0, 1.0)))
            legend = page.locator(".studio-player .row", has_text=name).first.inner_text()
            assert angle == pytest.approx(float(legend.split("off ")[1].removesuffix(" deg")), abs=0.06)
        page.get_by_label("show predicted").click()
        page.wait_for_timeout(500)
        assert set(page.evaluate(TURNED)) == {"measured", "reference"}
        assert asked == []
        assert wrong == []
