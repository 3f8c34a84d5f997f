"""The report is one page that loads nothing from anywhere."""

import gzip
import json
import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from imufit.comparing.traces import STRETCHES
from imufit.figures import quantity
from imufit.report import page, pictures
from imufit.results import Parameter
from imufit.results.judged import Judged
from loop_results import BIAS, G_SENSITIVITY, addition, comparison, diagnosis, ladder, noise, rows

VOID = {"meta", "br", "link", "img", "hr", "input", "col"}
LARGEST = 2_000_000
HOSTILE = (
    '<script>document.title="taken"</script>',
    '"><img src=x onerror=document.title="taken">',
    r"$\href{https://example.com}{x}$",
    "\u202emoor",
    "</script><b>",
    "{{ 7 * 7 }}",
)


class Reader(HTMLParser):
    """Collects tags, ids and references, and checks that tags are nested."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.ids, self.references, self.text, self.attributes = [], [], [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            self.attributes.append(name)
            if name == "id":
                self.ids.append(value)
            if name in ("href", "xlink:href", "src", "srcset", "action", "data"):
                self.references.append(value)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(html):
    """Parse a page; all tags must be closed."""
    reader = Reader()
    reader.feed(html)
    assert reader.open == []
    return reader


def with_fit(result, parameters):
    """Return a ladder with a fit of these parameters."""
    return replace(result, fit=type("Fit", (), {"parameters": parameters}))


MISALIGNED = tuple(Parameter("acc.misalignment", name, 0.01, 1e-4, "1", 0.02) for name in ("xy", "xz", "yx", "yz"))
IRON = tuple(Parameter("mag.hard_iron", name, 4.0, 0.1, "uT", 20.0) for name in "xyz")


@pytest.fixture(scope="module")
def result():
    """A whole ladder with a fit and the parts of its noise floor."""
    whole = ladder()
    return with_fit(replace(whole, diagnosis=replace(whole.diagnosis, noise=noise())), BIAS + G_SENSITIVITY)


@pytest.fixture(scope="module")
def whole(result):
    """Page of the ladder with the rows of its log."""
    return page(ladder=result, rows=rows(), title="log <1>.parquet")


def without_library(html):
    """Page without the packed library, which is not text."""
    return re.sub(r'(id="chart-library">)[^<]*', r"\1", html)


def test_page_refers_to_nothing_outside_itself(whole):
    reader = read(whole)
    assert all(reference.startswith("#") for reference in reader.references)
    assert not {"link", "iframe", "object", "embed", "img", "base"} & set(reader.tags)
    assert not re.search(r"@import|url\((?!#)", without_library(whole))
    assert set(re.findall(r"https?://[^\"'<> ]+", whole)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', whole).group(1)
    assert "default-src 'none'" in policy.replace("&#39;", "'")
    assert not re.search(r"unsafe-eval|script-src[^;]*unsafe-inline", policy)


def test_a_page_without_rows_has_no_script(result):
    html = page(ladder=result)
    assert "script" not in read(html).tags
    assert "script-src" not in html


def test_references_inside_the_page_lead_somewhere_and_ids_are_unique(whole):
    reader = read(whole)
    assert len(reader.ids) == len(set(reader.ids))
    used = {reference[1:] for reference in reader.references} | set(re.findall(r"url\(#([^)]+)\)", whole))
    assert used <= set(reader.ids)


def test_sections_stand_in_the_order_of_the_questions(result):
    html = page(ladder=with_fit(result, BIAS + MISALIGNED + IRON), rows=rows())
    heads = re.findall(r"<h2>(.*?)</h2>", html)
    assert heads == [
        "How the error falls",
        "Where the model fails",
        "Which effect is missing",
        "The sensor in space",
        "Next step",
        "Words used here",
    ]
    assert html.index('class="verdict') < html.index("Judged here") < html.index("<h2>")
    fall = html[html.index('id="fall"') : html.index('id="where"')]
    assert "times the noise floor" in fall
    assert "Parts of the noise floor" in fall
    where = html[html.index('id="where"') : html.index('id="which"')]
    order = ("Over time", "Residual against what may cause it", "By frequency")
    assert [where.index(words) for words in order] == sorted(where.index(words) for words in order)


def test_page_answers_where_which_and_what_next(whole):
    text = " ".join(read(whole).text)
    assert "adequate" in text
    assert "Acceleration bends the sensing structure" in text
    assert "0.0169 deg/s per g" in text
    assert "gyr.misalignment (0.31)" in text


def test_the_worst_channel_is_open_and_the_others_are_folded(whole):
    assert 'aria-label="gyr_x over time: measured, predicted and residual"' in whole.partition("<details")[2]
    folded = " ".join(re.findall(r"<summary>(.*?)</summary>", whole))
    assert "gyr_y over time" in folded
    assert "gyr_x over time" not in folded
    assert "other effects" in folded


def test_the_next_step_has_at_most_three_sentences():
    long = replace(diagnosis("ambiguous"), experiment="Turn it. Shake it. Heat it. Cool it. Rest it.")
    step = re.search(r'id="next">.*?<p>(.*?)</p>', page(diagnosis=long), re.DOTALL).group(1)
    assert step.split() == ["Turn", "it.", "Shake", "it.", "Heat", "it."]


def test_the_sensor_is_drawn_in_space_only_where_its_effects_have_a_shape(result):
    assert "The sensor in space" not in page(ladder=result, rows=rows())
    html = page(ladder=with_fit(result, MISALIGNED + IRON), rows=rows())
    text = " ".join(read(html).text)
    # The row xy and xz is 0.01 long each: the arc tangent of 0.0141 is 0.81 deg.
    assert "off by up to 0.81 deg, drawn 20 times as large" in text
    assert "Iron shifts the field by 6.93 µT" in text
    rests = replace(
        rows(), rests=tuple((side, np.roll([9.8, 0.0, 0.0], k)) for k, side in enumerate(["+x", "+y", "+z"]))
    )
    assert "3 rests" in page(ladder=result, rows=rests)


def test_numbers_of_the_page_are_those_of_the_json(result, whole):
    answer, text = result.to_dict(), " ".join(read(whole).text)
    for step in answer["steps"]:
        assert all(quantity.ratio(step[name]) in text for name in ("before", "expected", "after"))
    assert f"{quantity.ratio(answer['ratio_start'])} → {quantity.ratio(answer['ratio_end'])}" in text
    where = whole[whole.index('id="where"') :]
    for name, channel in result.comparison_start.to_dict()["channels"].items():
        row = re.search(rf">{name}</td>(.*?)</tr>", where, re.DOTALL).group(1)
        assert quantity.ratio(channel["ratio"]) in row
        assert quantity.quantity(channel["rms"], channel["unit"]) in row
    for parameter in BIAS + G_SENSITIVITY:
        assert parameter.shown in text


def data_of(html):
    """Data of the chart, unpacked."""
    return json.loads(gzip.decompress(b64decode(re.search(r'id="chart-data">([^<]*)<', html).group(1))))


def test_the_chart_has_every_sample_of_the_traces(whole):
    channels = data_of(whole)["channels"]
    for trace in rows().traces:
        factor, unit = quantity.shown_unit(trace.unit)
        held = channels[trace.channel]
        assert held["unit"] == unit
        np.testing.assert_array_equal(np.frombuffer(b64decode(held["t"]), "<f8"), trace.t)
        for name in ("measured", "residual", "before"):
            np.testing.assert_allclose(
                np.frombuffer(b64decode(held[name]), "<f4"), factor * getattr(trace, name), rtol=1e-6
            )
        assert set(held["parts"]) == set(trace.parts)
    assert next(iter(channels)) == "gyr_x"


def test_page_escapes_what_comes_from_the_log(whole):
    assert "log &lt;1&gt;.parquet" in whole
    assert "<1>" not in whole


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_text(name, whole):
    start = comparison()
    panels = tuple(replace(panel, covariate=name) for panel in start.panels)
    where = tuple(replace(item, covariate=name) for item in start.where)
    hostile = replace(start, panels=panels, where=where)
    changed = replace(ladder(), comparison_start=hostile)
    html = page(ladder=changed, rows=rows(effects=("gyr.bias", f"acc.column:{name}")), title=name)
    reader = read(html)
    assert set(reader.tags) <= set(read(whole).tags)
    assert not [each for each in reader.attributes if each.startswith("on")]
    assert reader.tags.count("script") == 3
    assert all(reference.startswith("#") for reference in reader.references)
    assert "49" not in reader.text
    assert name in "".join(reader.text)


def test_a_long_log_with_many_effects_stays_below_two_megabytes(result):
    names = ("bias", "scale", "cubic", "quadratic", "bias_drift", "warmup")
    effects = [f"{sensor}.{name}" for sensor in ("acc", "gyr") for name in names]
    parameters = tuple(Parameter(effect, axis, 0.01, 1e-3, "1", 0.02) for effect in effects for axis in "xyz")
    many = rows(samples=6 * STRETCHES, effects=tuple(effects))
    more = tuple(replace(trace, channel=f"mag_{axis}") for axis, trace in zip("xyz", many.traces, strict=False))
    html = page(ladder=with_fit(result, parameters + MISALIGNED + IRON), rows=replace(many, traces=many.traces + more))
    assert len(html.encode()) < LARGEST


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"comparison": comparison()}, "imufit.diagnose"),
        ({"diagnosis": diagnosis()}, "Add gyr.g_sensitivity"),
        ({"diagnosis": diagnosis("ambiguous")}, "Turn the sensor about y at rest"),
        ({"diagnosis": diagnosis("unknown")}, "V-shaped"),
        ({"diagnosis": diagnosis("adequate"), "comparison": comparison()}, "down to its noise"),
        ({"ladder": ladder(False)}, "No effect was added"),
        ({"addition": addition()}, "went from 1.52 to 1.04"),
        ({}, "There is nothing to show"),
    ],
)
def test_page_of_a_part_says_what_to_do_next(parts, words):
    assert words in " ".join(read(page(**parts)).text)


def test_page_without_a_sentence_from_the_engine_still_says_the_verdict():
    assert "no effect of the catalogue explains" in page(diagnosis=diagnosis("unknown"))


def test_figures_have_names_of_their_own_for_files(result):
    drawn = list(pictures(ladder=with_fit(result, BIAS + MISALIGNED + IRON), rows=rows()))
    names = [picture.name for picture in drawn]
    assert len(names) == len(set(names))
    assert all(re.fullmatch(r"\w+", name) for name in names)
    assert {"error_fall", "noise_floor_parts", "trace_gyr_x", "spectrum_gyr", "axes_acc", "field_ellipsoid"} <= set(
        names
    )
    assert "residual_gyr_x_1_acc_y" in names


def test_hostile_names_of_columns_are_harmless_as_names_of_files():
    start = comparison()
    panels = tuple(
        replace(panel, covariate="../../" + name) for panel, name in zip(start.panels, HOSTILE, strict=False)
    )
    names = [picture.name for picture in pictures(replace(start, panels=panels))]
    assert len(names) == len(set(names))
    assert all(re.fullmatch(r"[A-Za-z0-9_]+", name) for name in names)


def test_the_word_on_top_is_adequate_only_where_every_sensor_was_judged():
    whole = diagnosis("adequate")
    left = replace(whole, judged=(Judged("acc", False, "too few rests"),))
    assert '<section class="verdict good">' in page(diagnosis=whole)
    partly = page(diagnosis=left)
    assert '<section class="verdict plain">' in partly
    assert "<b>partly judged</b>" in partly
    assert '<section class="verdict warn">' in page(diagnosis=diagnosis("missing"))
