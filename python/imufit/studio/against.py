"""The list of what a channel's residual can stand against: covariates and causes in one order, the largest share first.

A covariate's share is that of its bins. A cause without a name acts through several columns: its share is that of
their best fit. Both are parts of the same excess over the noise floor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from imufit.comparing.compare import MIN_SHARE
from imufit.figures import quantity
from imufit.results import Comparison
from imufit.studio.names import covariate_name, with_symbol

SMALL: Final = f"< {100.0 * MIN_SHARE:.0f} %"
"""Words for a share that chance gives as well."""
IN_WORDS: Final = 2.0
"""Share of a cause over that of the best covariate from which on the figure opens on the cause: a covariate's figure
needs fewer words, but where it shows half as much it misleads."""
UNKNOWN: Final = "being weighed"
"""Words for the share of a cause until the evidence has given it."""


def against(
    found: Comparison, channel: str, causes: Sequence[str], shares: Mapping[str, float] | None
) -> dict[str, str]:
    """Return covariates and causes by name, in the order of the list, with the words of the list.

    Parameters
    ----------
    found : Comparison
        The residuals.
    channel : str
        For instance ``acc_x``.
    causes : sequence of str
        Causes without a name that a finding on the channel can name.
    shares : mapping of str to float or None
        Part of the channel's excess that each cause explains; None until this is known.

    Returns
    -------
    dict
        Words by name. A channel at its noise floor has no excess: its names stand without shares.
    """
    known: dict[str, float | None] = {item.covariate: item.share for item in found.panels if item.channel == channel}
    if not known:
        return {}
    for cause in causes:
        known.setdefault(cause, None if shares is None else shares.get(cause, 0.0))
    names = {name: with_symbol(covariate_name(name), name) for name in known}
    if channel not in found.failing:
        return names
    largest_first = sorted(known.items(), key=lambda item: -(item[1] or 0.0))
    return {name: f"{names[name]} ({_share(share)})" for name, share in largest_first}


def opens_on(found: Comparison, channel: str, shares: Mapping[str, float] | None) -> str | None:
    """Return the covariate or the cause that the figure of a channel shows first; None where none is worth showing.

    Parameters
    ----------
    found, channel, shares
        As for `against`.
    """
    known = (item for item in found.panels if item.channel == channel and item.share >= MIN_SHARE)
    top = max(known, key=lambda item: item.share, default=None)
    cause, share = max((shares or {}).items(), key=lambda item: item[1], default=("", 0.0))
    if share >= MIN_SHARE and share > IN_WORDS * (0.0 if top is None else top.share):
        return cause
    return None if top is None else top.covariate


def _share(share: float | None) -> str:
    if share is None:
        return UNKNOWN
    return SMALL if share < MIN_SHARE else quantity.share(share)
