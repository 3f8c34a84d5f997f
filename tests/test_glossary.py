"""Every word of screens and reports is explained: words are taken from results and from the catalogue in code."""

import re
import runpy
from itertools import pairwise
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit import _imufit
from imufit.glossary import explained, places_in, terms, used_in
from imufit.lab.simulate.scenarios import SCENARIOS
from imufit.report import page
from imufit.results.diagnosis import VERDICTS

ROOT = Path(__file__).resolve().parent.parent
JOINTS = re.compile(r"\*|, |: | of another sensor")
"""What stands between the words of a cause without a name, as in `temp*omega_norm` and `its gain follows it, bent`."""


def unexplained(words):
    return sorted({word for word in words if word and explained(word) is None})


def parts(words):
    return {part for word in words for part in ([word] if explained(word) else JOINTS.split(word))}


@pytest.fixture(scope="module")
def log():
    """Half a minute with every sensor, a position and columns of its own."""
    hidden = {"gyr.scale": {"x": 0.01, "y": -0.02, "z": 0.01}}
    made = imufit.simulate("handheld", hidden, seed=1, duration=30.0, covariates=["motor_current"])
    return made.to_log()


@pytest.fixture(scope="module")
def fit(log):
    return imufit.SensorModel().fit(log)


@pytest.fixture(scope="module")
def ladder(log):
    return imufit.ladder(log)


def test_the_page_is_what_the_definitions_say():
    made = runpy.run_path(str(ROOT / "docs" / "make_glossary.py"))["page"]()
    assert (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8") == made, "refresh with `make docs`"


def test_a_word_has_one_explanation_of_one_to_three_sentences():
    words = [term.word.lower() for term in terms()]
    assert len(words) == len(set(words))
    for term in terms():
        sentences = re.findall(r"[.!?](?= [A-Z`]|$)", term.means)
        assert 1 <= len(sentences) <= 3, term.word
        assert term.origin.endswith("."), term.word


def test_a_text_marks_the_first_place_of_a_term_and_the_longer_of_two():
    text = "acc_x stands at 2.1 times its noise floor, gyr_x at its floor; the noise floor is white."
    places = places_in(text)
    assert "times its noise floor" in [text[begin:end] for begin, end, _ in places]
    assert all(end <= begin for (_, end, _), (begin, _, _) in pairwise(places))
    assert len({term.word for _, _, term in places}) == len(places)


def test_covariates_are_explained(log, fit):
    comparison = fit.compare()
    assert {"t", "temp", "omega_norm", "motor_current"} <= {panel.covariate for panel in comparison.panels} | {"temp"}
    own = set(log.covariates) - {"motor_current"}
    assert unexplained({panel.covariate for panel in comparison.panels} - own) == []


def test_causes_without_a_name_are_explained(fit):
    probes = fit.analysis.logs[0].surveyed.probes.values()
    assert len(probes) > 40
    assert unexplained(parts(probe.words["name"] for probe in probes)) == []
    assert unexplained(parts(probe.words["signature"] for probe in probes)) == []


def test_shapes_and_courses_are_explained():
    source = ROOT / "rust" / "inference" / "src"
    named = (source / "bins.rs").read_text(encoding="utf-8").split("fn shape_name")[1].split("\n}")[0]
    shapes = set(re.findall('"([^"]+)"', named))
    assert len(shapes) >= 5
    assert unexplained(shapes) == []
    words = (source / "courses.rs").read_text(encoding="utf-8").split("pub fn words")[1].split("\n    }\n")[0]
    courses = re.findall('"([^"]+)"', words)
    assert len(courses) >= 5
    assert [text for text in courses if not used_in([re.sub(r"\{[^}]*\}", "1", text)])] == []


def test_effects_sensors_and_parameters_are_explained():
    effects = _imufit.built_in_effects()
    assert unexplained(effect.id for effect in effects) == []
    assert unexplained(name for effect in effects for name, _, _ in effect.parameters) == []


def test_verdicts_and_states_of_candidates_are_explained():
    assert unexplained(VERDICTS) == []
    states = [
        value for name in dir(_imufit.Status) if isinstance(value := getattr(_imufit.Status, name), _imufit.Status)
    ]
    assert len(states) >= 5
    assert unexplained(state.words for state in states) == []


def test_components_of_the_noise_are_explained(fit):
    noise = fit.diagnose().noise
    assert len(noise) > 10
    assert unexplained(part.component for part in noise) == []


def test_faults_of_the_data_are_explained():
    table = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8").split("| fault |")[1].split("\n\n")[0]
    kinds = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "python" / "imufit").rglob("*.py"))
    kinds += re.findall(r'DataFault\(\s*"(\w+)"', code)
    assert len(set(kinds)) > 20
    assert unexplained(kinds) == []


def test_reasons_for_rows_that_a_filter_skips_are_explained():
    code = (ROOT / "rust" / "filters" / "src" / "skipped.rs").read_text(encoding="utf-8")
    reasons = re.findall(r'\("(\w+)", self\.', code)
    assert len(reasons) == 15
    assert unexplained(reasons) == []


def heads(result):
    names = {name for table in (*result.tables(), *result.answer_tables()) for name in table.names}
    return {re.sub(r" \(.*\)$|, (?:s|times)$", "", name) for name in names}


def test_heads_of_tables_are_explained(log, fit, ladder):
    diagnosis = ladder.first
    assert len(heads(diagnosis)) > 10
    for result in (fit.compare(), diagnosis, ladder, imufit.info(log)):
        assert unexplained(heads(result)) == []
    assert fit.compare().attitude is not None
    assert unexplained(fit.compare().attitude.table().names) == []


def test_heads_of_tables_on_filters_and_calibrations_are_explained(log):
    poses = imufit.simulate("poses", {"acc.bias": {"x": 0.1, "y": 0.0, "z": 0.0}}, seed=1, duration=60.0).to_log()
    rig = imufit.simulate("tilt", {}, seed=2, duration=30.0).to_log()
    noise = np.random.default_rng(1).normal(scale=1e-3, size=(20_000, 3))
    still = imufit.Log(0.01 * np.arange(20_000), gyr=noise)
    assert "tilt" in SCENARIOS
    for result in (
        imufit.calibrate(poses),
        imufit.replay(log, ["mahony"]),
        imufit.replay(rig, ["kalman"]),
        imufit.tune(log, "mahony", gains=["k_p"]),
        imufit.allan(still),
    ):
        methods = {"mahony", "kalman"}
        assert unexplained(heads(result) - methods) == []


def test_a_report_explains_the_words_that_it_uses_and_only_these(ladder):
    html = page(ladder=ladder, title="a log")
    body, _, words = html.partition("<h2>Words used here</h2>")
    told = set(re.findall(r"<dt><strong>(.*?)</strong>", words))
    assert {"noise floor", "residual", "held-out error", "covariate", "omega_norm", "gyr.*"} <= told
    assert "hard iron" not in told
    assert "<details" in words
    for panel in ladder.comparison_start.panels:
        term = explained(panel.covariate)
        assert term is None or f"{panel.covariate}: explains" not in body or term.word in told


def test_a_letter_that_is_a_unit_is_no_word():
    assert used_in(["0.05 m in 3 t"]) == ()
    assert [term.word for term in used_in(["m", "t: explains"])] == ["t", "m"]
    assert [term.word for term in used_in(["ref.skew was added"])] == ["ref.*"]
    assert explained("no such word") is None
    assert [term.word for term in used_in(["The mount held.", "held"])] == ["held"]
