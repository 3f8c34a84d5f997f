"""The named sets of blind logs, and what is demanded of the answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from imufit.lab.grade.columns import columns
from imufit.lab.grade.drawing import ImpossibleError
from imufit.lab.grade.nothing import nothing
from imufit.lab.grade.one import one
from imufit.lab.grade.outside import outside
from imufit.lab.grade.pairs import confounded, separated
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.grade.two import two
from imufit.results.part import Part


@dataclass(frozen=True, repr=False)
class BlindSet(Part):
    """A kind of blind logs.

    Attributes
    ----------
    title : str
        What is hidden, in words.
    make : callable
        From the set's name and a seed to the log.
    logs : int
        How many logs acceptance needs.
    demands : mapping
        For marks (attributes of `Marks`) the share demanded: at least it, or, for faults, at most.
    """

    title: str
    make: Callable[[str, int], Puzzle]
    logs: int
    demands: Mapping[str, float] = field(default_factory=dict)


ATTEMPTS, STRIDE = 32, 1_000_003
"""Where a seed makes no log that can be asked about, that many seeds further on may."""

LARGE, SMALL = (0.3, 3.0), (0.1, 0.1)

SETS: Mapping[str, BlindSet] = {
    "one": BlindSet(
        "one hidden effect, 0.3 to 3 of the noise", partial(one, sizes=LARGE), 150, {"named": 0.99, "wrong": 0.005}
    ),
    "small": BlindSet(
        "one hidden effect, 0.1 of the noise", partial(one, sizes=SMALL), 60, {"named": 0.95, "wrong": 0.01}
    ),
    "one-realistic": BlindSet(
        "one, coloured noise, bias random walks, noisy reference",
        partial(one, sizes=LARGE, realistic=True),
        100,
        {"named": 0.95, "wrong": 0.01},
    ),
    "small-realistic": BlindSet(
        "small, coloured noise, bias random walks, noisy reference",
        partial(one, sizes=SMALL, realistic=True),
        100,
        {"named": 0.80, "wrong": 0.01},
    ),
    "nothing": BlindSet("nothing hidden", nothing, 200, {"alarm": 0.01}),
    "two": BlindSet("two hidden effects", two, 60, {"named": 0.97}),
    "outside": BlindSet("outside the catalogue", outside, 40, {"named": 0.97, "wrong": 0.03, "covariate": 0.90}),
    "confounded": BlindSet(
        "pair that this log does not separate", confounded, 40, {"named": 0.99, "single": 0.02, "needless": 0.25}
    ),
    "separated": BlindSet("the same pairs in a log that separates them", separated, 40, {"named": 0.97}),
    "columns": BlindSet("column among irrelevant ones", columns, 30, {"named": 0.99}),
}
"""Every set by its name, in the order in which they are gone through."""


def draw(blind_set: str, seed: int) -> Puzzle:
    """Return one blind log; the same set and seed give the same log.

    Parameters
    ----------
    blind_set : str
        Of `SETS`.
    seed : int
        Of the log.

    Raises
    ------
    ValueError
        The set is unknown.
    """
    if blind_set not in SETS:
        raise ValueError(f"unknown set {blind_set!r}: use one of {', '.join(SETS)}")
    for attempt in range(ATTEMPTS):
        try:
            return SETS[blind_set].make(blind_set, seed + attempt * STRIDE)
        except ImpossibleError as error:
            reason = error
    raise ValueError(f"no log of the set {blind_set} was found: {reason}")
