"""Published gains by name."""

from __future__ import annotations

from typing import Final

PAPER_C_GAINS: Final[dict[str, dict[str, float]]] = {
    "figure_3": {"k_1": 1.0, "k_2": 1.0, "k_i": 0.2, "k_p": 20.0},
    "figure_4": {"k_1": 5.0, "k_2": 0.1, "k_i": 0.2, "k_p": 10.0},
}
"""``[k1 k2 kI kP]`` of paper C, figures 3 and 4, for `mahony` and `hybrid`: ``{"hybrid": PAPER_C_GAINS["figure_3"]}``.

The paper's text prints the first as ``[1 - 0.2 20]``; k_2 = 1 is that of the figure.
"""
