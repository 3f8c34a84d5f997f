"""Passes over a log, chunk by chunk: survey, evidence, noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.errors import InputError
from imufit.faults import row_faults
from imufit.fitting.column_noise import ColumnNoise
from imufit.fitting.commanded import CommandedAttitude
from imufit.fitting.computed_columns import computed_columns
from imufit.fitting.range_end import RangeEnd
from imufit.fitting.readings_seen import ReadingsSeen
from imufit.log import Chunk, LogSource
from imufit.log.attitude_columns import attitude_offered
from imufit.log.columns import SENSOR_NAMES
from imufit.log.foreign import naming
from imufit.model.effect import registered
from imufit.printable import NAME, printable
from imufit.progress import Progress

CHUNK_ROWS = 16384
"""Rows of a chunk: a comparison takes some 8 kB of memory for each of them."""
SURVEY_MARGIN = 4096
PAST = 3.0
"""Rows of the past that a chunk carries, in median rows of the longest memory: the past begins up to two memories
before a row, and the rest is for rows that come more often than usual."""

MASKS = ("ref_exact", "movement")
"""Columns that state the use of a row; they are not covariates."""

CHANNELS = tuple(f"{sensor}_{axis}" for sensor in SENSOR_NAMES for axis in "xyz")
UNITS = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}

BLOCKS = 48
MIN_ROWS = 200
MIN_COVERAGE = 0.98


def covariate_names(log: LogSource) -> list[str]:
    """Columns of a log that can act on its sensors."""
    first = next(iter(log.chunks(1024, 0)), None)
    return [] if first is None else [name for name in first.log.covariates if name not in MASKS]


def chunk_arrays(chunk: Chunk, covariates: Sequence[str]) -> dict[str, Any]:
    """Return a chunk as the compiled core takes it."""
    log = chunk.log
    return {
        "t": log.t,
        "acc": log.acc,
        "gyr": log.gyr,
        "mag": log.mag,
        "temp": log.temp,
        "ref_q": log.ref_q,
        "ref_p": log.ref_p,
        "ref_exact": log.covariates.get("ref_exact"),
        "covariates": [log.covariates[name] for name in covariates],
        "offset": chunk.start - chunk.begin,
        "begin": chunk.begin,
        "end": chunk.end,
    }


class Passes:
    """Passes over one log with the same covariates.

    Parameters
    ----------
    log : LogSource
        The log.
    progress : callable
        Called with the rows done.

    Attributes
    ----------
    channels : tuple of str
        Names of the nine channels of the evidence; empty for one that is not used.
    units : mapping of str to str
        Their SI units.
    """

    channels: tuple[str, ...] = CHANNELS
    units: Mapping[str, str] = MappingProxyType({name: UNITS[name[:3]] for name in CHANNELS})

    def __init__(self, log: LogSource, progress: Progress) -> None:
        self.log = log
        names = covariate_names(log)
        computed = computed_columns(log) if names else ()
        self.covariates = [name for name in names if name not in computed]
        self.empty: list[str] = []
        """Notes on columns that are not used."""
        if computed:
            self.empty.append(f"Not used, since they are computed from the readings: {', '.join(computed)}.")
        self.column_noise: dict[str, float] = {}
        """Share of noise in each covariate's variance (``temp`` too), once the log has been surveyed."""
        self._progress = progress
        self.row_faults, self._left_out = row_faults(log)
        self.commanded = self._commanded()
        """Attitude that the commanded angle of a rig gives, where the log's own is the same but noisier."""

    def margin(self, facts: _imufit.Facts) -> int:
        """Rows that a chunk carries on each side of its core, so that every effect sees its past."""
        memory = max((effect.memory for effect in registered().values()), default=0.0)
        past = PAST * memory / facts.dt if facts.dt > 0.0 else 0.0
        return facts.margin + (self.log.n if not past < self.log.n else math.ceil(past))

    def chunks(self, margin: int, label: str) -> Iterator[dict[str, Any]]:
        """Chunks of the log for the compiled core, with reports of progress."""
        for chunk in self.log.chunks(CHUNK_ROWS, margin):
            arrays = self.arrays_of(chunk)
            self._leave_out(arrays)
            yield arrays
            self._progress(chunk.start + chunk.end - chunk.begin, self.log.n, label)

    def arrays_of(self, chunk: Chunk) -> dict[str, Any]:
        """Return a chunk as the compiled core takes it, with every sample.

        Parameters
        ----------
        chunk : Chunk
            Of this log, or of the one that this log is an excerpt of.
        """
        arrays = chunk_arrays(chunk, self.covariates)
        angle = chunk.log.ref_angle
        if self.commanded is not None and angle is not None:
            arrays["ref_q"] = self.commanded.attitude(angle)
        return arrays

    def _leave_out(self, arrays: dict[str, Any]) -> None:
        """Blank the samples that are certain to be wrong; the log itself stays as it is."""
        offset, rows = arrays["offset"], len(arrays["t"])
        copied: set[str] = set()
        for sensor, first, stop in self._left_out:
            low, high = max(first - offset, 0), min(stop - offset, rows)
            for name in ("ref_q", "ref_p") if sensor == "ref" else (sensor,):
                if low < high and arrays[name] is not None:
                    if name not in copied:
                        arrays[name] = arrays[name].copy()
                        copied.add(name)
                    arrays[name][low:high] = np.nan

    def survey(self) -> tuple[_imufit.Facts, dict[str, float]]:
        """First pass: facts of the log, and which share of the rows each covariate (``temp`` too) is known in.

        Raises
        ------
        InputError
            The log has no reference, no sensor or too few rows.
        """
        log, metadata = self.log, self.log.metadata
        if log.n < MIN_ROWS:
            raise InputError(
                f"{log.n} rows are too few for a fit", file=log.path, remedy=f"Record at least {MIN_ROWS}."
            )
        survey = _imufit.Survey(
            log.n,
            metadata.frame,
            metadata.gravity,
            None if metadata.mag_reference is None else tuple(metadata.mag_reference),
            self.covariates,
            self._rig(),
        )
        reference = 0
        names = ["temp", *self.covariates]
        known = np.zeros(len(names))
        noise = [ColumnNoise() for _ in names]
        readings = ReadingsSeen()
        for arrays in self.chunks(SURVEY_MARGIN, "surveying"):
            core = slice(arrays["begin"], arrays["end"])
            if arrays["ref_q"] is not None:
                reference += int(np.isfinite(arrays["ref_q"][core, 0]).sum())
            for k, column in enumerate([arrays["temp"], *arrays["covariates"]]):
                if column is not None:
                    known[k] += _held_count(column[core])
                    noise[k].add(column[core])
            readings.add(arrays, core)
            survey.add(arrays)
        if reference == 0:
            raise InputError(
                "the log has no reference attitude (ref_qw ref_qx ref_qy ref_qz)",
                file=log.path,
                remedy="Add the reference, or ref_angle with the metadata rig_axis." + attitude_offered(log),
            )
        self.column_noise = {name: each.share for name, each in zip(names, noise, strict=True)}
        if empty := [name for name, rows in zip(self.covariates, known[1:], strict=True) if rows == 0]:
            # Rows without a value of every column count for nothing: without these columns they do.
            self.empty += [f"Column {name} has no value in any row." for name in empty]
            self.covariates = [name for name in self.covariates if name not in empty]
            return self.survey()
        if still := readings.still(MIN_ROWS):
            if set(still) == set(readings.read()):
                raise self._motionless(still)
            # Such readings have no noise to weigh them by, and show only that they are less than a step.
            self.empty += [
                f"Every reading of the {SENSOR_NAMES[sensor]} is the same: it is left out." for sensor in still
            ]
            self._left_out += [(sensor, 0, log.n) for sensor in still]
            return self.survey()
        facts = survey.finish()
        if not facts.sensors:
            raise InputError(
                "no sensor of the log has a sample",
                file=log.path,
                remedy=naming(log.path, [printable(name, NAME) for name in self.covariates])
                if self.covariates
                else "Record a sensor beside the reference.",
            )
        if self._leave_out_flat(readings, facts):
            return self.survey()
        for sensor, dead in readings.dead():
            self.empty.append(f"{' and '.join(dead)} has no value in any row: {sensor} is left out.")
        return facts, dict(zip(names, known / log.n, strict=True))

    def _leave_out_flat(self, readings: ReadingsSeen, facts: _imufit.Facts) -> bool:
        """Leave sensors out of which one axis never moves, and say whether there are any."""
        # Of a sensor with coarse steps an axis may well stay on one of them; its noise is a part of the step.
        flat = {
            sensor: axes
            for sensor, axes in readings.flat(MIN_ROWS).items()
            if sensor in facts.sensors and not any(facts.steps[list(SENSOR_NAMES).index(sensor)])
        }
        if set(flat) == set(facts.sensors):
            # Where that holds for all of them the log is a computed one: nothing is dead.
            return False
        for sensor, axes in flat.items():
            self.empty.append(f"Every reading of {' and '.join(axes)} is the same: {sensor} is left out.")
            self._left_out.append((sensor, 0, self.log.n))
        return bool(flat)

    def _motionless(self, names: Sequence[str]) -> InputError:
        """Make the error for a log whose readings have no noise at all."""
        return InputError(
            f"no effect can be judged, because no reading of {' or '.join(names)} ever changes: without noise a "
            "deviation cannot be weighed",
            file=self.log.path,
            remedy="Record the readings with all their digits, while the sensor turns.",
        )

    def ranges(self) -> tuple[dict[str, float], dict[str, float]]:
        """Where readings of accelerometer and gyroscope may be cut off, and their largest readings, m/s^2 and rad/s."""
        ends = {sensor: RangeEnd() for sensor in ("acc", "gyr")}
        for chunk in self.log.chunks(CHUNK_ROWS, 0):
            for sensor, end in ends.items():
                column = getattr(chunk.log, sensor)
                if column is not None:
                    end.add(column)
        found: dict[str, float] = {}
        for sensor, end in ends.items():
            value = self.log.metadata.ranges.get(sensor) or end.end()
            if value is not None and value > 0.0:
                found[sensor] = float(value)
        return found, {sensor: end.largest for sensor, end in ends.items() if end.largest > 0.0}

    def _commanded(self) -> CommandedAttitude | None:
        axis = self.log.metadata.rig_axis
        if axis is None:
            return None
        return CommandedAttitude.of((chunk.log for chunk in self.log.chunks(CHUNK_ROWS, 0)), "xyz".index(axis))

    def _rig(self) -> tuple[int, list[float]] | None:
        """Axis of a one-axis rig and its attitude at the angle zero; None for a log of anything else."""
        axis = self.log.metadata.rig_axis
        if axis is None:
            return None
        number = "xyz".index(axis)
        if self.commanded is not None:
            return number, self.commanded.zero.as_quat(scalar_first=True).tolist()
        for chunk in self.log.chunks(CHUNK_ROWS, 0):
            q, angle = chunk.log.ref_q, chunk.log.ref_angle
            if q is None or angle is None:
                break
            rows = np.flatnonzero(np.isfinite(q[:, 0]) & np.isfinite(angle))
            if rows.size:
                turned_back = Rotation.from_rotvec(-angle[rows[0]] * np.eye(3)[number])
                zero = Rotation.from_quat(q[rows[0], [1, 2, 3, 0]]) * turned_back
                return number, zero.as_quat()[[3, 0, 1, 2]].tolist()
        return number, [1.0, 0.0, 0.0, 0.0]

    @property
    def blocks(self) -> int:
        """Blocks of time that the evidence is kept in."""
        return BLOCKS

    def spans(self, facts: _imufit.Facts) -> NDArray[np.float64]:
        """Return the times at which each block begins and ends, (blocks, 2), s."""
        edges = np.linspace(facts.t_start, facts.t_end, self.blocks + 1)
        return np.column_stack([edges[:-1], edges[1:]])

    def lacking(self, effect: _imufit.Effect) -> str | None:
        """Return why an effect's sensor cannot be judged, though the log has it; None otherwise."""
        return None

    def told(self, effect: _imufit.Effect, facts: _imufit.Facts) -> str | None:
        """Return why the log's evidence cannot show an effect; None if it can."""
        return None

    def evidence(self, evidence: _imufit.Evidence, facts: _imufit.Facts, label: str) -> _imufit.Evidence:
        """Fill empty evidence with the whole log."""
        for arrays in self.chunks(self.margin(facts), label):
            evidence.add(arrays)
        return evidence

    def fill(self, profiles: Sequence[_imufit.Profile], facts: _imufit.Facts) -> None:
        """Fill empty searches with the whole log."""
        for arrays in self.chunks(self.margin(facts), "searching periods and widths") if profiles else ():
            for profile in profiles:
                profile.add(arrays)

    def past_products(
        self, evidence: _imufit.Evidence, facts: _imufit.Facts, step: NDArray[np.float64]
    ) -> _imufit.PastProducts:
        """Products of the residual left by a step of all parameters with its own past."""
        out = _imufit.PastProducts()
        for arrays in self.chunks(self.margin(facts), "measuring the noise"):
            out.add(arrays, evidence, step)
        return out


def _held_count(column: NDArray[np.float64], hold: int = 256) -> int:
    """Rows in which a column is known or known at most `hold` rows before."""
    rows = np.flatnonzero(np.isfinite(column))
    if rows.size == 0:
        return 0
    reach = np.diff(np.append(rows, len(column)))
    return int(np.minimum(reach, hold + 1).sum())
