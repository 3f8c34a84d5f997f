"""Two models side by side: the sentence compares what is shown."""

from types import SimpleNamespace

import pytest
from imufit.studio.view_two import evidence, lower


@pytest.mark.parametrize(
    ("kept", "present", "said"),
    [
        (1.0012, 1.0011, "Both stand equally low."),
        (1.0, 1.5, "The kept model stands lower."),
        (1.5, 1.0, "The present model stands lower."),
    ],
)
def test_models_with_the_same_digits_stand_equally_low(kept, present, said):
    assert lower(*(SimpleNamespace(numbers=SimpleNamespace(ratio=ratio)) for ratio in (kept, present))) == said


def test_evidence_is_given_as_odds_with_the_odds_that_a_preference_needs():
    assert evidence(3.0) == (
        "The log prefers neither model: the odds are 20 to 1 for the present one (ln Bayes factor 3.0), "
        "and a preference needs 150 to 1."
    )
    assert evidence(-8.0) == (
        "The log prefers the kept model: the odds are 3 000 to 1 for the kept one (ln Bayes factor 8.0)."
    )
    assert "more than 1 000 000 to 1" in evidence(2000.0)
    assert "(ln Bayes factor 1.4×10¹⁸)" in evidence(1.430960927139741184e18)
    assert "the odds are 1.6 to 1" in evidence(0.5)
