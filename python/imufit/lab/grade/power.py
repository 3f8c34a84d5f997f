"""How small an effect is still named: the share of blind logs over the size of what is hidden in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from imufit.lab.grade.blind_grade import share
from imufit.lab.grade.drawing import SCENARIOS, ImpossibleError, Setting, drawn, effects, rng_of
from imufit.lab.grade.one import TWINS, settings
from imufit.lab.grade.protocol import side_by_side
from imufit.lab.simulate import simulate
from imufit.lab.simulate.environment import stream
from imufit.loop import SensorModel
from imufit.progress import Progress
from imufit.results.part import Part
from imufit.results.plotted import Plotted

if TYPE_CHECKING:
    from imufit.figures.place import Drawing, Place

POWER_SIZES = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0)
"""Root mean square of the hidden effect over the white noise of its sensor."""

STRIDE = 17
"""From one seed to the next that many effects are passed over, so that a few of them are of all kinds."""


@dataclass(frozen=True, repr=False)
class PowerPoint(Part):
    """The answer of one diagnosis on an effect of one size.

    Attributes
    ----------
    seed, realistic, size : int, bool, float
        What draws the log again.
    effect : str
        The hidden one.
    alone, among : bool
        Whether it is the one name, or one of several.
    wrong : bool
        Whether something else is named, and it is not.
    """

    seed: int
    realistic: bool
    size: float
    effect: str
    alone: bool
    among: bool
    wrong: bool


@dataclass(frozen=True, repr=False)
class PowerCurve(Plotted, Part):
    """Diagnoses of the same effects at growing sizes.

    Attributes
    ----------
    points : tuple of PowerPoint
        Every diagnosis.
    """

    points: tuple[PowerPoint, ...]

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> PowerCurve:
        """Return the curve of a `to_dict`, also after JSON.

        Parameters
        ----------
        data : mapping
            Of `to_dict`.
        """
        return cls(tuple(PowerPoint(**point) for point in data["points"]))

    def shares(self, realistic: bool) -> list[dict[str, Any]]:
        """Return for each size the share named alone, named at all, and named wrongly, with 95 % intervals.

        Parameters
        ----------
        realistic : bool
            Of the logs with coloured noise, bias random walks and a noisy reference, or of those with white noise.
        """
        chosen = [point for point in self.points if point.realistic is realistic]
        rows = []
        for size in sorted({point.size for point in chosen}):
            here = [point for point in chosen if point.size == size]
            rows.append(
                {
                    "size": size,
                    "alone": share(point.alone for point in here),
                    "named": share(point.alone or point.among for point in here),
                    "wrong": share(point.wrong for point in here),
                }
            )
        return rows

    def to_dict(self) -> dict[str, Any]:
        """JSON: the shares for white and for realistic noise, and every diagnosis."""
        return {
            "white": self.shares(False),
            "realistic": self.shares(True),
            "points": [asdict(point) for point in self.points],
        }

    def _drawn(self, ax: Place | None) -> Drawing:
        """Share named over the size, with 95 % intervals."""
        from imufit.figures.power import power  # noqa: PLC0415

        curves = {}
        for name, realistic in (("white noise", False), ("realistic noise", True)):
            if rows := self.shares(realistic):
                curves[name] = {
                    key: np.array([[row[key][part] for part in ("share", "low", "high")] for row in rows])
                    for key in ("named", "alone")
                }
        sizes = np.array(sorted({point.size for point in self.points}))
        return power(sizes, curves, ax)


def power_curve(
    *,
    logs: int = 24,
    seed: int = 0,
    sizes: Sequence[float] = POWER_SIZES,
    processes: int | None = None,
    progress: Progress | None = None,
) -> PowerCurve:
    """Hide the same effects at growing sizes, and count how often the diagnosis names them.

    Parameters
    ----------
    logs : int
        Number of effects, each at every size, under white and under realistic noise.
    seed : int
        Of the first.
    sizes : sequence of float
        Root mean square of the effect over the white noise of its sensor.
    processes : int, optional
        Effects worked on at a time; default: one per processor.
    progress : callable, optional
        Called with (effects done, effects in all, what is being done).
    """
    jobs = [(seed + k, realistic, tuple(sizes)) for k in range(logs) for realistic in (False, True)]
    found = side_by_side(points_of, jobs, processes, progress)
    return PowerCurve(tuple(point for part in found for point in part))


def points_of(seed: int, realistic: bool, sizes: Sequence[float]) -> list[PowerPoint]:
    """Hide one effect, drawn by `seed`, at each size in the same log, and diagnose it.

    Parameters
    ----------
    seed : int
        Of the log.
    realistic : bool
        Whether the noise is coloured, the biases walk and the reference has noise.
    sizes : sequence of float
        Root mean square of the effect over the white noise of its sensor.
    """
    rng, simulation_seed = rng_of("power", seed)
    names = effects()
    options = settings(rng, realistic)
    setting, effect = _apart(Setting("", simulation_seed, options), names[STRIDE * seed % len(names)], rng)
    study = setting.study([effect])
    found = []
    for size in sizes:
        parameters = study.scale.draw(effect, size, stream(simulation_seed, f"power {effect}"))
        simulation = simulate(setting.scenario, {effect: parameters}, simulation_seed, **options)
        diagnosis = SensorModel().fit(simulation.to_log()).diagnose()
        named = diagnosis.verdict in ("missing", "ambiguous")
        among = named and effect in diagnosis.named
        alone = diagnosis.verdict == "missing" and diagnosis.best == effect
        found.append(PowerPoint(seed, realistic, size, effect, alone, among and not alone, named and not among))
    return found


def _apart(setting: Setting, effect: str, rng: np.random.Generator) -> tuple[Setting, str]:
    """Return a motion that shows the effect, of size 1, apart from all others but its twin; else another effect."""
    names = effects()
    start = names.index(effect)
    for k in range(len(names)):
        chosen = names[(start + k) % len(names)]
        for scenario in rng.permutation(SCENARIOS).tolist():
            place = Setting(scenario, setting.seed, setting.options)
            try:
                if not set(drawn(place, chosen, 1.0, rng).rivals) - TWINS.get(chosen, set()):
                    return place, chosen
            except ImpossibleError:
                continue
    raise ImpossibleError("no effect stands apart from all others")
