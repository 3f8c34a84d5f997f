"""Paper A: its published parameters come back from simulated six-position logs, with honest errors."""

import importlib.util
import itertools
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "paper_a_calibration.py"


@pytest.fixture(scope="module")
def paper():
    spec = importlib.util.spec_from_file_location("paper_a_calibration", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("level", [0, 1])
def test_errors_of_the_twelve_parameters_are_within_two_standard_errors_as_often_as_they_should(paper, level):
    noise = list(paper.NOISE.values())[level]
    choices = list(itertools.product((1, -1), repeat=6))
    scaled = [paper.errors(choices[k % 64], paper.run(choices[k % 64], noise, k)[2]) for k in range(200)]
    inside = np.mean(np.abs(scaled) < 2.0)
    assert 0.90 < inside < 0.99


def test_published_means_are_met_by_the_published_parameters_as_far_as_the_paper_allows(paper):
    readings, labels, _ = paper.run((1, 1, -1, 1, 1, -1), 0.009, 1)
    for side, (_, mean, *_) in paper.TABLE_3.items():
        own = abs(np.mean(readings[labels == side, "xyz".index(side[1])]))
        assert own == pytest.approx(mean, abs=0.015)


def test_calibrated_means_are_one_g_on_every_side(paper):
    readings, labels, found = paper.run((1, 1, -1, 1, 1, -1), 0.009, 1)
    after = found.correct(readings * paper.G) / paper.G
    for side in paper.SIDES:
        own = np.mean(after[labels == side], axis=0)
        np.testing.assert_allclose(own, paper.UP[side], atol=0.002)
