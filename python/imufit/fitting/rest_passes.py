"""Passes over a log without a reference attitude, whose rests stand in for one."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.passes import CHUNK_ROWS, MIN_ROWS, UNITS, Passes
from imufit.fitting.rests import FEWEST_RESTS, RestReadings, read_rests
from imufit.log import LogSource, whole
from imufit.log.attitude_columns import attitude_offered
from imufit.progress import Progress

NEEDS_REFERENCE = "it needs a reference attitude"
"""Reason why rests cannot show an effect."""
REST_UNITS = MappingProxyType(
    {"acc_norm": "m/s^2", "turn": "σ", "acc_pose": "rad", "mag_norm": UNITS["mag"]}
    | {f"gyr_{axis}": UNITS["gyr"] for axis in "xyz"}
)
"""SI units of the channels at rest; the residual of a turn is counted in its standard error, σ."""
IN_REFERENCE = ("reference", "time")
"""Stages of effects that only a reference shows."""


def without_reference(log: LogSource) -> bool:
    """Return whether a log has not one row with a reference attitude.

    Parameters
    ----------
    log : LogSource
        Read chunk by chunk up to the first such row.
    """
    for chunk in log.chunks(CHUNK_ROWS, 0):
        if chunk.log.ref_q is not None and np.isfinite(chunk.log.ref_q[:, 0]).any():
            return False
    return True


class RestPasses(Passes):
    """Passes over one log of which only its rests, the turns between them and the length of the field are known.

    Parameters
    ----------
    log : LogSource
        The log.
    progress : callable
        Called with the rows done.
    """

    channels = tuple(_imufit.rest_channels())
    units = REST_UNITS
    rests: RestReadings

    def survey(self) -> tuple[_imufit.Facts, dict[str, float]]:
        """Find the rests; return the facts of the log, and which share of the rows each covariate is known in.

        Raises
        ------
        InputError
            The log has too few rows, or neither rests nor a magnetic field to judge by.
        """
        log = whole(self.log)
        if log.n < MIN_ROWS:
            raise InputError(
                f"{log.n} rows are too few for a fit", file=log.path, remedy=f"Record at least {MIN_ROWS}."
            )
        self.rests = rests = read_rests(log, self.covariates)
        if not rests.sensors:
            raise InputError(
                "the log has no reference attitude (ref_qw ref_qx ref_qy ref_qz), and too few rests to replace it",
                file=log.path,
                remedy=(
                    "Add the reference, or ref_angle with the metadata rig_axis; or record the sensor lying still in "
                    f"at least {FEWEST_RESTS} attitudes, two seconds each, with turns between, or on all six sides, "
                    "labelled in the column pose."
                )
                + attitude_offered(log),
            )
        columns = {"temp": log.temp, **{name: log.covariates[name] for name in self.covariates}}
        known = {name: 0.0 if c is None else float(np.isfinite(c).any()) for name, c in columns.items()}
        temperature_mean, *covariate_means = rests.means
        facts = _imufit.facts_at_rest(
            (log.n, float(log.t[0]), float(log.t[-1]), float(np.median(np.diff(log.t)))),
            log.metadata.frame,
            float(log.metadata.gravity),
            rests.field,
            [sensor in rests.sensors for sensor in ("acc", "gyr", "mag")],
            self.covariates,
            covariate_means,
            temperature_mean if np.isfinite(temperature_mean) else None,
            rests.samples,
        )
        self._progress(log.n, log.n, "finding the rests")
        return facts, known

    @property
    def blocks(self) -> int:
        """Groups of rests that the evidence is kept in."""
        return self.rests.blocks

    def spans(self, facts: _imufit.Facts) -> NDArray[np.float64]:
        """Return the times at which each block begins and ends, (blocks, 2), s."""
        return self.rests.spans

    def lacking(self, effect: _imufit.Effect) -> str | None:
        """Return why an effect's sensor cannot be judged, though the log has it; None otherwise."""
        if any(sensor in self.rests.sensors for sensor in effect.sensors):
            return None
        sensors = " or ".join(effect.sensors)
        return f"the log has no reference attitude, and too little at rest to judge {sensors}"

    def told(self, effect: _imufit.Effect, facts: _imufit.Facts) -> str | None:
        """Return why rests cannot show an effect; None if they can."""
        if effect.stage in IN_REFERENCE or not _imufit.rests_tell(effect, facts, self.rests.arrays):
            return NEEDS_REFERENCE
        if effect.least_levels > self.rests.levels:
            return (
                f"the rests hold each axis at {self.rests.levels} different parts of gravity at most, and "
                f"{effect.least_levels} are needed"
            )
        return None

    def evidence(self, evidence: _imufit.Evidence, facts: _imufit.Facts, label: str) -> _imufit.Evidence:
        """Fill empty evidence from the rests."""
        evidence.add_rests(self.rests.arrays)
        self._progress(self.log.n, self.log.n, label)
        return evidence

    def fill(self, profiles: Sequence[_imufit.Profile], facts: _imufit.Facts) -> None:
        """Fill empty searches from the rests."""
        for profile in profiles:
            profile.add_rests(self.rests.arrays)

    def noise(self, raw: _imufit.Evidence, left: list[float]) -> list[float]:
        """Variance of a row of each channel.

        From stretches of one rest that follow each other, or, if more, what no effect explains; without either what
        the readings of a rest scatter.

        Parameters
        ----------
        raw : Evidence
            The evidence.
        left : list of float
            Variance that no effect of the catalogue explains.
        """
        scatter = raw.rest_scatter(self.rests.arrays)
        out = []
        for channel, expected in enumerate(self.rests.expected):
            known = [v for v in (scatter[channel], left[channel]) if np.isfinite(v)]
            if channel in (_TURN, _POSE):
                known.append(expected)
            counted = raw.count(channel) > 0
            out.append(float(max(known)) if known and counted else float(expected) if counted else np.nan)
        return out


_TURN, _POSE = (_imufit.rest_channels().index(name) for name in ("turn", "acc_pose"))


def passes_of(log: LogSource, progress: Progress) -> Passes:
    """Return passes over a log, with or without a reference attitude.

    Parameters
    ----------
    log : LogSource
        The log.
    progress : callable
        Called with the rows done.
    """
    return (RestPasses if without_reference(log) else Passes)(log, progress)
