"""Tabs of the studio: each one says so where there are more."""

import pytest
from imufit.studio.tabs import notice_of


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (0, ""),
        (1, ""),
        (2, "This studio is open in two tabs. Both show the same session."),
        (3, "This studio is open in 3 tabs. All of them show the same session."),
    ],
)
def test_more_than_one_tab_is_said(count, said):
    assert notice_of(count) == said
