"""The report is one page that loads nothing from anywhere."""

import re
from html.parser import HTMLParser

import pytest
from imufit.report import page
from loop_results import BIAS, G_SENSITIVITY, addition, comparison, diagnosis, ladder

VOID = {"meta", "br", "link", "img", "hr", "input", "col"}


class Reader(HTMLParser):
    """Collects tags, ids and references, and checks that tags are nested."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.ids, self.references, self.text = [], [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
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


@pytest.fixture(scope="module")
def whole():
    """Page of a whole ladder with a fit."""
    result = ladder()
    object.__setattr__(result, "fit", type("Fit", (), {"parameters": BIAS + G_SENSITIVITY}))
    return page(ladder=result, title="log <1>.parquet")


def test_page_refers_to_nothing_outside_itself(whole):
    reader = read(whole)
    assert all(reference.startswith("#") for reference in reader.references)
    assert not {"script", "link", "iframe", "object", "embed"} & set(reader.tags)
    assert not re.search(r"@import|url\((?!#)", whole)
    assert not re.search(r"""(src|href|action)\s*=\s*["']?\s*(https?:)?//""", whole)
    assert set(re.findall(r"https?://[^\"'<> ]+", whole)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }


def test_references_inside_the_page_lead_somewhere_and_ids_are_unique(whole):
    reader = read(whole)
    assert len(reader.ids) == len(set(reader.ids))
    used = {reference[1:] for reference in reader.references} | set(re.findall(r"url\(#([^)]+)\)", whole))
    assert used <= set(reader.ids)


def test_page_answers_where_which_and_what_next(whole):
    text = " ".join(read(whole).text)
    for words in (
        "ADEQUATE".lower(),
        "Where the model fails",
        "Which effect is missing",
        "How the error falls",
        "Next step",
    ):
        assert words in text
    assert "Acceleration bends the sensing structure" in text
    assert "0.0169 deg/s per g" in text
    assert "gyr.misalignment (0.31)" in text
    assert whole.index("verdict") < whole.index("Where the model fails")
    assert read(whole).tags.count("details") == 6 + 1 + 1


def test_page_escapes_what_comes_from_the_log(whole):
    assert "log &lt;1&gt;.parquet" in whole
    assert "<1>" not in whole


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
    html = page(**parts)
    assert words in " ".join(read(html).text) + " ".join(re.findall('aria-label="[^"]*"', html)) or "No effect" in words


def test_page_without_a_sentence_from_the_engine_still_says_the_verdict():
    assert "no effect of the catalogue explains" in page(diagnosis=diagnosis("unknown"))
