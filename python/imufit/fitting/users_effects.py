"""A user's effect is tried on a few rows before anything is fitted: a broken one would spoil every answer."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from imufit import _imufit
from imufit.fitting.passes import CHUNK_ROWS, Passes, chunk_arrays
from imufit.model.effect import registered

TRIED_ROWS = 512


def check_users_effects(passes: Passes, facts: _imufit.Facts, ids: Iterable[str]) -> None:
    """Check those of the effects `ids` that a user wrote, on the first rows of the log that have a reference.

    Raises
    ------
    InputError
        Columns of an effect are not finite, disagree with its reading or depend on where the rows are cut.
    Exception
        Whatever the user's function raises, unchanged.
    """
    own = registered()
    effects = [own[effect_id] for effect_id in ids if effect_id in own]
    if not effects:
        return
    for chunk in passes.log.chunks(CHUNK_ROWS, facts.margin):
        arrays = chunk_arrays(chunk, passes.covariates)
        core = slice(arrays["begin"], arrays["end"])
        known = (
            np.flatnonzero(np.isfinite(arrays["ref_q"][core, 0])) if arrays["ref_q"] is not None else np.empty(0, int)
        )
        if known.size:
            begin = arrays["begin"] + int(known[0])
            rows = {"begin": begin, "end": min(begin + TRIED_ROWS, arrays["end"])}
            for effect in effects:
                effect.check({**arrays, **rows}, facts, [0.0] * len(effect.parameters))
            return
