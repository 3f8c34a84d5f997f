"""Two models side by side: the sentence compares what is shown."""

from types import SimpleNamespace

import pytest
from imufit.studio.view_two import lower


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
