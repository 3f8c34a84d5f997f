"""Nasty nulls: logs in which no sensor effect is hidden.

Every kind fixes a motion, a reference instrument, a noise and what else the log holds; the seed draws the
numbers. Readings are the ideal readings of the exact motion at the sensor's true sample times, plus noise of
zero expectation. Only the reference may misbehave, and then only in the way that `Case.effects` and
`Case.may_name` state.

>>> case = draw(17)
>>> case.name
'noise_grows_with_time_17'
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import motion_and_reference as mr
import numpy as np
import numpy.typing as npt
import pandas as pd
from case import VERDICTS, Case
from motion_and_reference import DEGREE, Array, Generator, Motion, Track
from scipy.fft import irfft, next_fast_len, rfftfreq
from scipy.signal import lfilter

MOST_ROWS = 120_000
SLOW_RATE = 25.0
STATED_NOISE = 0.3
ADEQUATE = frozenset({"adequate"})
OR_UNKNOWN = frozenset({"unknown"})
REFERENCE_IDS = frozenset({"ref.alignment", "ref.tilt", "ref.delay", "ref.skew", "ref.lowpass"})
TIMING_IDS = frozenset({"ref.delay", "ref.lowpass"})
SMOOTHING_IDS = frozenset({"ref.lowpass"})
ZERO_IDS = frozenset({"acc.bias", "gyr.bias", "acc.bias_drift", "gyr.bias_drift"})
AXES = "xyz"

Choice = Literal["with", "without", "any"]


# --------------------------------------------------------------------------------
# Kinds
# --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recipe:
    """What a kind fixes; of several choices the seed draws one.

    Attributes
    ----------
    motions, reference, noise
        Names of motions, of a reference instrument and of a noise.
    rates, seconds
        Rates in Hz and durations in s to choose from.
    position, magnetometer
        Whether the log has reference positions and a magnetometer. A log without positions does not translate
        unless `unseen_translation` is set.
    unseen_translation
        The body translates strongly and the log has no positions: specific force cannot be predicted.
    sensors
        The sensors of the log, beside the magnetometer.
    extras
        Names of what else happens to readings or rows.
    covariates
        Extra columns that do not act.
    may_name, verdicts
        Names and verdicts that are right in this kind beyond those that the reference allows.
    """

    motions: tuple[str, ...] = ("hand",)
    reference: str = "perfect"
    noise: str = "white"
    rates: tuple[float, ...] = (100.0,)
    seconds: tuple[float, ...] = (10.0, 15.0, 20.0, 30.0, 60.0)
    position: Choice = "any"
    magnetometer: Choice = "any"
    unseen_translation: bool = False
    sensors: tuple[str, ...] = ("acc", "gyr")
    extras: tuple[str, ...] = ()
    covariates: tuple[str, ...] = ()
    may_name: frozenset[str] = frozenset()
    verdicts: frozenset[str] = frozenset()


ALL_MOTIONS = ("hand", "robot", "table", "drive", "poses")
LIVELY = ("hand", "robot")
NOT_SHORT = (20.0, 30.0, 60.0)
COMMON = (50.0, 100.0, 200.0)

RECIPES: dict[str, Recipe] = {
    # A perfect reference, and noise as sensors have it.
    "white_hand": Recipe(),
    "white_robot": Recipe(("robot",)),
    "white_table": Recipe(("table",)),
    "white_drive": Recipe(("drive",), position="with"),
    "white_poses": Recipe(("poses",), seconds=NOT_SHORT),
    "white_drone": Recipe(("drone",), rates=(200.0, 500.0), position="with", verdicts=OR_UNKNOWN),
    "ar1_hand": Recipe(noise="ar1"),
    "ar1_robot": Recipe(("robot",), noise="ar1", rates=COMMON),
    "ar1_poses": Recipe(("poses",), noise="ar1", seconds=NOT_SHORT),
    "flicker_hand": Recipe(noise="flicker"),
    "flicker_poses": Recipe(("poses",), noise="flicker", seconds=NOT_SHORT),
    "heavy_tails_hand": Recipe(noise="heavy_tails"),
    "heavy_tails_table": Recipe(("table",), noise="heavy_tails", rates=COMMON),
    "bursts_robot": Recipe(("robot",), noise="bursts"),
    "bursts_drive": Recipe(("drive",), noise="bursts", position="with"),
    "noise_follows_rate_hand": Recipe(noise="follows_rate"),
    "noise_follows_rate_table": Recipe(("table",), noise="follows_rate"),
    "noise_grows_with_time": Recipe(ALL_MOTIONS, noise="grows", position="with"),
    "random_walk_small": Recipe(ALL_MOTIONS, noise="small_walk", position="with"),
    "random_walk_cheap": Recipe(
        ("hand", "poses"),
        noise="cheap_walk",
        seconds=NOT_SHORT,
        covariates=("temp", "vbat"),
        may_name=ZERO_IDS,
        verdicts=VERDICTS,
    ),
    "coloured_everything": Recipe(ALL_MOTIONS, noise="coloured", position="with", covariates=("temp",)),
    "quantised_16_bit_hand": Recipe(extras=("quantise_16",)),
    "quantised_16_bit_poses": Recipe(("poses",), seconds=NOT_SHORT, extras=("quantise_16",)),
    "quantised_10_bit_hand": Recipe(extras=("quantise_10",), verdicts=OR_UNKNOWN),
    "quantised_10_bit_robot": Recipe(("robot",), extras=("quantise_10",), verdicts=OR_UNKNOWN),
    "line_hand": Recipe(extras=("line",), verdicts=OR_UNKNOWN),
    "line_robot": Recipe(("robot",), rates=(200.0,), extras=("line",), verdicts=OR_UNKNOWN),
    "mains_in_mag": Recipe(rates=(100.0, 200.0), magnetometer="with", extras=("mains",), verdicts=OR_UNKNOWN),
    "slow_mag": Recipe(rates=(100.0, 200.0), magnetometer="with", extras=("slow_mag",)),
    "rows_lost": Recipe(extras=("rows_lost",)),
    "rows_uneven": Recipe(ALL_MOTIONS, extras=("rows_uneven",), position="with"),
    # Rates from slow to fast; fast sensors have a reference of 200 Hz.
    "rate_10": Recipe(("hand", "robot", "poses"), rates=(10.0,), seconds=NOT_SHORT),
    "rate_25": Recipe(ALL_MOTIONS, rates=(25.0,), seconds=(15.0, 20.0, 30.0, 60.0), position="with"),
    "rate_50": Recipe(ALL_MOTIONS, rates=(50.0,), position="with"),
    "rate_200": Recipe(ALL_MOTIONS, rates=(200.0,), position="with"),
    "rate_500": Recipe(ALL_MOTIONS, "white_small", rates=(500.0,), position="with"),
    "rate_1000_between": Recipe(LIVELY, "between_rows", rates=(1000.0,)),
    "rate_1000_slerped": Recipe(LIVELY, "slerped_200", rates=(1000.0,)),
    "rate_4000_between": Recipe(LIVELY, "between_rows", rates=(4000.0,)),
    "rate_4000_slerped": Recipe(LIVELY, "slerped_200", rates=(4000.0,)),
    "rate_8000_between": Recipe(LIVELY, "between_rows", rates=(8000.0,)),
    "rate_8000_slerped": Recipe(("hand", "table"), "slerped_200", rates=(8000.0,), noise="ar1"),
    "drone_1000": Recipe(("drone",), "slerped_200", rates=(1000.0,), position="with", verdicts=OR_UNKNOWN),
    "drone_stand": Recipe(("drone_stand",), rates=(500.0,), position="without", verdicts=OR_UNKNOWN),
    # Reference instruments.
    "reference_white_small": Recipe(ALL_MOTIONS, "white_small", rates=COMMON, position="with"),
    "reference_white_large": Recipe(ALL_MOTIONS, "white_large", rates=COMMON, position="with"),
    "reference_white_large_heavy_tails": Recipe(LIVELY, "white_large", noise="heavy_tails"),
    "mocap_smoothed_hand": Recipe(("hand",), "smoothed"),
    "mocap_smoothed_robot": Recipe(("robot",), "smoothed", rates=COMMON),
    "mocap_smoothed_poses": Recipe(("poses",), "smoothed", seconds=NOT_SHORT),
    "mocap_smoothed_rotation_vector": Recipe(("hand", "robot"), "smoothed_rotation_vector"),
    "mocap_causal_hand": Recipe(("hand",), "causal", rates=COMMON),
    "mocap_causal_robot": Recipe(("robot",), "causal", position="with"),
    "mocap_slerped_hand": Recipe(("hand",), "slerped_100", rates=(100.0, 150.0, 200.0)),
    "mocap_slerped_robot": Recipe(("robot",), "slerped_100", rates=(100.0, 150.0, 200.0), position="with"),
    "mocap_slerped_noisy": Recipe(LIVELY, "slerped_100_noisy", rates=(100.0, 150.0, 200.0)),
    "robot_poses_slerped": Recipe(("robot",), "slerped_slow", rates=COMMON),
    "hand_poses_slerped": Recipe(("hand",), "slerped_slow", rates=COMMON),
    "robot_poses_held": Recipe(("robot",), "held", rates=COMMON),
    "table_poses_held": Recipe(("table",), "held", rates=COMMON),
    "own_rows_hand": Recipe(("hand",), "own_rows", rates=COMMON),
    "own_rows_robot": Recipe(("robot",), "own_rows", rates=COMMON, position="with"),
    "own_rows_smoothed": Recipe(LIVELY, "own_rows_smoothed", rates=COMMON),
    "own_rows_causal": Recipe(LIVELY, "own_rows_causal", rates=COMMON),
    "own_rows_slow_mag": Recipe(
        LIVELY,
        "own_rows",
        rates=(200.0,),
        magnetometer="with",
        extras=("slow_mag",),
    ),
    "packets_late": Recipe(LIVELY, "packets_late", rates=COMMON),
    "packets_true": Recipe(LIVELY, "packets_true", rates=COMMON),
    "packets_interpolated": Recipe(LIVELY, "packets_interpolated", rates=COMMON),
    "stamps_jitter_own_rows": Recipe(LIVELY, "jitter_own_rows", rates=COMMON),
    "stamps_jitter_interpolated": Recipe(("hand", "table"), "jitter_interpolated", rates=COMMON),
    "other_clock": Recipe(LIVELY, "other_clock", seconds=NOT_SHORT, rates=COMMON),
    "encoder_table": Recipe(("table",), "encoder", rates=COMMON),
    "encoder_robot": Recipe(("robot",), "encoder", rates=COMMON, position="with"),
    "encoder_one_axis": Recipe(("one_axis",), "encoder_angle", rates=COMMON, position="without"),
    "angle_only": Recipe(("one_axis",), "angle_only", position="without"),
    "heading_wanders_drive": Recipe(("drive",), "heading_wanders", seconds=(30.0, 60.0), position="with"),
    "heading_wanders_hand": Recipe(("hand",), "heading_wanders", seconds=NOT_SHORT),
    "gaps": Recipe(ALL_MOTIONS, "gaps", position="with"),
    "gaps_bridged": Recipe(LIVELY, "gaps_bridged"),
    "slips": Recipe(LIVELY, "slips"),
    "slips_smoothed": Recipe(LIVELY, "slips_smoothed"),
    # Translation that the log does not show: nothing can be said of the accelerometer.
    "unseen_hand": Recipe(("fast_hand",), unseen_translation=True),
    "unseen_robot": Recipe(("robot",), unseen_translation=True),
    "unseen_drive": Recipe(("fast_drive",), unseen_translation=True, seconds=NOT_SHORT),
    "unseen_drone": Recipe(("drone",), rates=(200.0,), unseen_translation=True),
    "unseen_hand_white_reference": Recipe(("fast_hand",), "white_large", unseen_translation=True),
    "unseen_hand_own_rows": Recipe(("fast_hand",), "own_rows", rates=COMMON, unseen_translation=True),
    "unseen_hand_coloured": Recipe(("fast_hand",), noise="coloured", unseen_translation=True),
    "unseen_poses_moved": Recipe(("poses",), unseen_translation=True, seconds=NOT_SHORT),
    # Columns that do not act, few sensors, poses.
    "idle_temperature": Recipe(ALL_MOTIONS, covariates=("temp",), position="with", seconds=NOT_SHORT),
    "idle_temperature_poses": Recipe(("poses",), noise="flicker", covariates=("temp",), seconds=NOT_SHORT),
    "idle_current_robot": Recipe(("robot",), covariates=("motor_current", "vbat"), magnetometer="with"),
    "idle_current_drone": Recipe(
        ("drone",),
        rates=(200.0,),
        noise="bursts",
        covariates=("motor_current", "vbat", "temp"),
        position="with",
        magnetometer="with",
        verdicts=OR_UNKNOWN,
    ),
    "many_columns": Recipe(
        LIVELY, covariates=("temp", "vbat", "motor_current", "pressure", "cpu_load", "humidity", "counter")
    ),
    "only_gyr": Recipe(("hand", "table"), sensors=("gyr",), magnetometer="without", rates=COMMON),
    "only_acc": Recipe(("hand", "poses"), sensors=("acc",), magnetometer="without", rates=COMMON),
    "only_mag": Recipe(("hand", "poses"), sensors=(), magnetometer="with", rates=COMMON),
    "six_positions": Recipe(("six_positions",), seconds=(30.0, 60.0), position="without"),
    "six_positions_labels": Recipe(
        ("six_positions",), "labels", seconds=(30.0, 60.0), position="without", magnetometer="without"
    ),
    # Several at once.
    "coloured_smoothed": Recipe(LIVELY, "smoothed", noise="coloured", covariates=("temp",)),
    "coloured_slerped_slow": Recipe(
        ("robot",),
        "slerped_slow",
        noise="coloured",
        covariates=("motor_current",),
    ),
    "coloured_own_rows": Recipe(
        LIVELY,
        "own_rows_noisy",
        noise="coloured",
        rates=COMMON,
        covariates=("temp",),
    ),
    "coloured_white_reference": Recipe(LIVELY, "white_large", noise="coloured", covariates=("temp", "vbat")),
    "heavy_tails_packets": Recipe(LIVELY, "packets_late", noise="heavy_tails", rates=COMMON),
    "flicker_slerped_noisy": Recipe(LIVELY, "slerped_100_noisy", noise="flicker", rates=(150.0, 200.0)),
    "quantised_slips": Recipe(LIVELY, "slips", extras=("quantise_16",)),
    "quantised_line_smoothed": Recipe(
        LIVELY, "smoothed", extras=("line", "quantise_10"), rates=(100.0, 200.0), verdicts=OR_UNKNOWN
    ),
    "bursts_gaps_rows_lost": Recipe(LIVELY, "gaps", noise="bursts", extras=("rows_lost",)),
    "follows_rate_causal": Recipe(LIVELY, "causal", noise="follows_rate", position="with"),
}
KINDS: tuple[str, ...] = tuple(RECIPES)


# --------------------------------------------------------------------------------
# Motions
# --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pace:
    """How a body may move in a log: fast enough to matter, and slow enough for the rows to follow."""

    rng: Generator
    seconds: float
    rate: float
    translating: bool

    @property
    def fastest(self) -> float:
        """Draw the highest frequency of a hand, at least ten rows per period."""
        return float(min(self.rng.uniform(1.2, 3.0), self.rate / 10))

    @property
    def shortest(self) -> float:
        """Return the shortest duration of a move."""
        return max(0.8, 12 / self.rate)

    def between(self, low: float, high: float) -> float:
        """Draw an amount of translation, none if the body does not translate."""
        return float(self.rng.uniform(low, high)) if self.translating else 0.0


MOTIONS: dict[str, Callable[[Pace], Motion]] = {
    "hand": lambda p: mr.hand_held(p.rng, p.seconds, p.fastest, p.between(0.3, 2.0)),
    "fast_hand": lambda p: mr.hand_held(p.rng, p.seconds, p.fastest, p.between(2.0, 5.0)),
    "robot": lambda p: mr.robot_arm(p.rng, p.seconds, p.shortest, p.translating),
    "table": lambda p: mr.turntable(p.rng, p.seconds, p.shortest, p.between(0.05, 0.3)),
    "drive": lambda p: mr.drive(p.rng, p.seconds, p.between(0.4, 1.0)),
    "fast_drive": lambda p: mr.drive(p.rng, p.seconds, p.between(1.5, 2.5)),
    "poses": lambda p: mr.rest_poses(p.rng, p.seconds, p.shortest, p.translating),
    "drone": lambda p: mr.drone(p.rng, p.seconds, p.between(0.5, 1.5), p.rng.uniform(0.5, 3.0)),
    "drone_stand": lambda p: mr.drone(p.rng, p.seconds, 0.0, p.rng.uniform(0.5, 3.0)),
}


# --------------------------------------------------------------------------------
# References
# --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Setting:
    """What a reference instrument sees: the motion, the rows of the log and where its draws come from."""

    motion: Motion
    rows: Array
    rate: float
    seconds: float
    rng: Generator


@dataclass(frozen=True)
class Reference:
    """What a reference instrument gives to the log, and what may rightly be said of it.

    `own_rows` puts the track into rows of its own. `angle` is the commanded angle of a one-axis rig.
    """

    track: Track
    own_rows: bool = False
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    may_name: frozenset[str] = frozenset()
    verdicts: frozenset[str] = ADEQUATE
    angle: Array | None = None
    attitude_shown: bool = True


def _mocap_noise(track: Track, rng: Generator) -> Track:
    """Add the noise of a good optical system."""
    return mr.add_noise(track, rng, rng.uniform(0.01, 0.05) * DEGREE, rng.uniform(1e-4, 3e-4))


def _strong_noise(track: Track, rng: Generator) -> Track:
    """Add the noise of a poor optical system."""
    return mr.add_noise(track, rng, rng.uniform(0.08, 0.2) * DEGREE, rng.uniform(4e-4, 1e-3))


def _perfect(s: Setting) -> Reference:
    return Reference(mr.observe(s.motion, s.rows))


def _white_small(s: Setting) -> Reference:
    return Reference(_mocap_noise(mr.observe(s.motion, s.rows), s.rng))


def _white_large(s: Setting) -> Reference:
    return Reference(_strong_noise(mr.observe(s.motion, s.rows), s.rng))


@dataclass(frozen=True)
class _Filtered:
    track: Track
    effects: dict[str, dict[str, float]]


def _filtered(
    s: Setting,
    causal: bool = False,
    way: Literal["quaternion", "rotation_vector"] = "quaternion",
    slips: bool = False,
    rates: tuple[float, float] = (100.0, 250.0),
) -> _Filtered:
    """Return the track of an optical system that filters what it gives, and the filter's effects.

    A filter run both ways multiplies a sinusoid by 1 / (1 + (f / cutoff)^(2 order)). A causal filter of order
    one is late by 1/w, and of order two by sqrt(2)/w, with w the angular cutoff frequency.
    """
    rate = s.rng.uniform(*rates)
    cutoff = s.rng.uniform(4.0, 12.0)
    order = int(s.rng.integers(1, 3 if causal else 5))
    track = _mocap_noise(mr.observe(s.motion, mr.clock(s.rng, rate, s.seconds)), s.rng)
    if slips:
        track = mr.slip(track, s.rng, mr.spans(s.rng, s.seconds, int(s.rng.integers(1, 5)), 0.1, 0.5))
    smooth = {"cutoff_hz": cutoff, "order": float(order)}
    w = 2 * np.pi * cutoff
    effects = {"ref.lowpass": smooth}
    if causal:
        effects["ref.delay"] = {"tau": (1.0 if order == 1 else np.sqrt(2.0)) / w}
        smooth["c"] = 0.5 / w**2 if order == 1 else 0.0
    elif order == 1:
        smooth["c"] = 1.0 / w**2
    return _Filtered(mr.lowpass(track, rate, cutoff, order, causal, way), effects)


def _timing(track: Track, effects: dict[str, dict[str, float]], own_rows: bool = False) -> Reference:
    """Return a reference that is late, smoothed or interpolated."""
    return Reference(track, own_rows, effects, TIMING_IDS, VERDICTS)


def _smoothed(s: Setting) -> Reference:
    filtered = _filtered(s)
    return _timing(mr.interpolate(filtered.track, s.rows), filtered.effects)


def _smoothed_rotation_vector(s: Setting) -> Reference:
    filtered = _filtered(s, way="rotation_vector")
    return _timing(mr.interpolate(filtered.track, s.rows), filtered.effects)


def _causal(s: Setting) -> Reference:
    filtered = _filtered(s, causal=True)
    return _timing(mr.interpolate(filtered.track, s.rows), filtered.effects)


def _slerped(s: Setting, rate: float, noise: Callable[[Track, Generator], Track] | None) -> Reference:
    """Interpolate poses of this rate and of another clock onto the rows, which loses h^2/12 of x''."""
    track = mr.observe(s.motion, mr.clock(s.rng, rate, s.seconds))
    if noise is not None:
        track = noise(track, s.rng)
    effects = {"ref.lowpass": {"c": 1 / (12 * rate**2), "interval": 1 / rate}}
    return _timing(mr.interpolate(track, s.rows), effects)


def _slerped_100(s: Setting) -> Reference:
    return _slerped(s, 100.0, None)


def _slerped_100_noisy(s: Setting) -> Reference:
    return _slerped(s, 100.0, _strong_noise)


def _slerped_200(s: Setting) -> Reference:
    return _slerped(s, 200.0, _mocap_noise if s.rng.random() < 0.5 else None)


def _slerped_slow(s: Setting) -> Reference:
    return _slerped(s, s.rng.uniform(10.0, 20.0), None)


def _held(s: Setting) -> Reference:
    """Repeat each pose until the next: late by half an interval h, and short of h^2/24 of x''."""
    rate = s.rng.uniform(10.0, 20.0)
    track = mr.observe(s.motion, mr.clock(s.rng, rate, s.seconds))
    effects = {
        "ref.delay": {"tau": 0.5 / rate},
        "ref.lowpass": {"c": 1 / (24 * rate**2), "interval": 1 / rate},
    }
    return _timing(mr.hold(track, s.rows), effects)


def _between_rows(s: Setting) -> Reference:
    """Give a pose of 200 Hz on the rows nearest to its samples, at those rows' times, and nothing between."""
    step = round(s.rate / 200.0)
    chosen = np.arange(s.rows.size) % step == int(s.rng.integers(step))
    track = mr.observe(s.motion, s.rows)
    if s.rng.random() < 0.5:
        track = _mocap_noise(track, s.rng)
    attitude, position = track.attitude.copy(), track.position.copy()
    attitude[~chosen] = np.nan
    position[~chosen] = np.nan
    return Reference(Track(s.rows, attitude, position), may_name=SMOOTHING_IDS, verdicts=VERDICTS)


def _inside(track: Track, s: Setting) -> Track:
    """Return the rows of a track that lie within the log."""
    return track.kept((track.stamp > s.rows[0]) & (track.stamp < s.rows[-1]))


def _own(s: Setting, noise: Callable[[Track, Generator], Track] | None) -> Reference:
    track = mr.observe(s.motion, mr.clock(s.rng, s.rng.uniform(60.0, 240.0), s.seconds))
    if noise is not None:
        track = noise(track, s.rng)
    return Reference(_inside(track, s), True, may_name=SMOOTHING_IDS, verdicts=VERDICTS)


def _own_rows(s: Setting) -> Reference:
    return _own(s, _mocap_noise if s.rng.random() < 0.5 else None)


def _own_rows_noisy(s: Setting) -> Reference:
    return _own(s, _strong_noise)


def _own_rows_smoothed(s: Setting) -> Reference:
    filtered = _filtered(s, rates=(60.0, 240.0))
    return _timing(_inside(filtered.track, s), filtered.effects, own_rows=True)


def _own_rows_causal(s: Setting) -> Reference:
    filtered = _filtered(s, causal=True, rates=(60.0, 240.0))
    return _timing(_inside(filtered.track, s), filtered.effects, own_rows=True)


def _packets(s: Setting) -> tuple[Track, dict[str, dict[str, float]]]:
    """Stamp samples when their packet arrives."""
    times = mr.clock(s.rng, s.rng.uniform(60.0, 240.0), s.seconds)
    stamps = mr.packet_stamps(s.rng, times)
    return mr.observe(s.motion, times, stamps), {"ref.delay": {"tau": float(np.mean(stamps - times))}}


def _packets_late(s: Setting) -> Reference:
    track, effects = _packets(s)
    return _timing(_inside(track, s), effects, own_rows=True)


def _packets_interpolated(s: Setting) -> Reference:
    track, effects = _packets(s)
    return _timing(mr.interpolate(track, s.rows), effects)


def _packets_true(s: Setting) -> Reference:
    """Sample in bunches with true stamps: only the spacing is odd, and each pose has its own noise."""
    stamps = mr.packet_stamps(s.rng, mr.clock(s.rng, s.rng.uniform(100.0, 240.0), s.seconds))
    track = _mocap_noise(mr.observe(s.motion, stamps), s.rng)
    return Reference(_inside(track, s), True, may_name=SMOOTHING_IDS, verdicts=VERDICTS)


def _jittered(s: Setting) -> Track:
    times = mr.clock(s.rng, s.rng.uniform(60.0, 200.0), s.seconds)
    return mr.observe(s.motion, times, mr.jittered_stamps(s.rng, times, s.rng.uniform(5e-4, 3e-3)))


def _jitter_own_rows(s: Setting) -> Reference:
    return _timing(_inside(_jittered(s), s), {}, own_rows=True)


def _jitter_interpolated(s: Setting) -> Reference:
    return _timing(mr.interpolate(_jittered(s), s.rows), {})


def _other_clock(s: Setting) -> Reference:
    """Stamp with a clock that is late and runs at another rate, and interpolate onto the rows."""
    k = float(s.rng.choice([-1, 1]) * s.rng.uniform(5e-5, 4e-4))
    tau = s.rng.uniform(0.002, 0.02)
    times = mr.clock(s.rng, s.rng.uniform(100.0, 250.0), s.seconds)
    track = mr.observe(s.motion, times, times + tau + k * times)
    effects = {"ref.skew": {"k": k}, "ref.delay": {"tau": tau}}
    return Reference(mr.interpolate(track, s.rows), False, effects, TIMING_IDS | {"ref.skew"}, VERDICTS)


def _encoder(s: Setting) -> Reference:
    step = np.exp(s.rng.uniform(np.log(0.02), np.log(0.3))) * DEGREE
    return Reference(mr.observe(s.motion, s.rows, angle_step=step), verdicts=ADEQUATE | OR_UNKNOWN)


def _encoder_angle(s: Setting) -> Reference:
    step = np.exp(s.rng.uniform(np.log(0.02), np.log(0.3))) * DEGREE
    angle = np.round(s.motion.joints[0].angle.at(s.rows) / step) * step
    track = mr.observe(s.motion, s.rows, angle_step=step)
    return Reference(track, verdicts=ADEQUATE | OR_UNKNOWN, angle=angle)


def _angle_only(s: Setting) -> Reference:
    angle = s.motion.joints[0].angle.at(s.rows)
    return Reference(mr.observe(s.motion, s.rows), angle=angle, attitude_shown=False)


def _heading_wanders(s: Setting) -> Reference:
    """Let the heading of a fused reference wander by whole periods, with zero mean error and drift."""
    cycles = np.array([1.0, 2.0, 3.0])
    spread = s.rng.uniform(0.2, 1.5) * DEGREE * s.rng.uniform(0.2, 1.0, 3)
    error = mr.Sines(spread, cycles / s.seconds, s.rng.uniform(0, 2 * np.pi, 3))
    track = mr.drift_heading(mr.observe(s.motion, s.rows), error)
    return Reference(track, may_name=REFERENCE_IDS, verdicts=VERDICTS)


def _gaps(s: Setting, bridged: bool) -> Reference:
    chosen = mr.spans(s.rng, s.seconds, int(s.rng.integers(2, 6)), 0.2, 2.0)
    if not bridged:
        track = mr.observe(s.motion, s.rows)
        lost = mr.within(s.rows, chosen)
        track.attitude[lost] = np.nan
        track.position[lost] = np.nan
        return Reference(track)
    track = mr.drop_out(mr.observe(s.motion, mr.clock(s.rng, 200.0, s.seconds)), chosen)
    return Reference(mr.interpolate(track, s.rows), may_name=REFERENCE_IDS, verdicts=VERDICTS)


def _slips(s: Setting) -> Reference:
    chosen = mr.spans(s.rng, s.seconds, int(s.rng.integers(1, 5)), 0.1, 0.5)
    track = mr.slip(_mocap_noise(mr.observe(s.motion, s.rows), s.rng), s.rng, chosen)
    return Reference(track, may_name=REFERENCE_IDS, verdicts=VERDICTS)


def _slips_smoothed(s: Setting) -> Reference:
    filtered = _filtered(s, slips=True)
    track = mr.interpolate(filtered.track, s.rows)
    return Reference(track, effects=filtered.effects, may_name=REFERENCE_IDS, verdicts=VERDICTS)


def _labels(s: Setting) -> Reference:
    return Reference(mr.observe(s.motion, s.rows), attitude_shown=False)


REFERENCES: dict[str, Callable[[Setting], Reference]] = {
    "perfect": _perfect,
    "white_small": _white_small,
    "white_large": _white_large,
    "smoothed": _smoothed,
    "smoothed_rotation_vector": _smoothed_rotation_vector,
    "causal": _causal,
    "slerped_100": _slerped_100,
    "slerped_100_noisy": _slerped_100_noisy,
    "slerped_200": _slerped_200,
    "slerped_slow": _slerped_slow,
    "held": _held,
    "between_rows": _between_rows,
    "own_rows": _own_rows,
    "own_rows_noisy": _own_rows_noisy,
    "own_rows_smoothed": _own_rows_smoothed,
    "own_rows_causal": _own_rows_causal,
    "packets_late": _packets_late,
    "packets_true": _packets_true,
    "packets_interpolated": _packets_interpolated,
    "jitter_own_rows": _jitter_own_rows,
    "jitter_interpolated": _jitter_interpolated,
    "other_clock": _other_clock,
    "encoder": _encoder,
    "encoder_angle": _encoder_angle,
    "angle_only": _angle_only,
    "heading_wanders": _heading_wanders,
    "gaps": lambda s: _gaps(s, bridged=False),
    "gaps_bridged": lambda s: _gaps(s, bridged=True),
    "slips": _slips,
    "slips_smoothed": _slips_smoothed,
    "labels": _labels,
}


# --------------------------------------------------------------------------------
# Noise
# --------------------------------------------------------------------------------


def white_sizes(rng: Generator, rate: float) -> dict[str, float]:
    """Draw the white noise per sample of cheap sensors, which grows as the square root of the rate."""
    scale = np.sqrt(rate / 100.0)
    return {
        "acc": scale * rng.uniform(0.02, 0.08),
        "gyr": scale * rng.uniform(0.05, 0.2) * DEGREE,
        "mag": scale * rng.uniform(0.3, 1.0),
    }


def ar1(rng: Generator, n: int, rate: float, constant: float) -> Array:
    """Return three channels of stationary noise of unit size with this time constant."""
    keep = np.exp(-1 / (rate * constant))
    drive = np.sqrt(1 - keep**2) * rng.standard_normal((n, 3))
    drive[0] /= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))


def flicker(rng: Generator, n: int, rate: float, instability: float) -> Array:
    """Return three channels of 1/f noise with this bias instability and no mean.

    The one-sided power density is instability^2 / (pi f).
    """
    size = next_fast_len(4 * n, real=True)
    frequency = rfftfreq(size, 1 / rate)
    density = np.zeros(frequency.size)
    density[1:] = instability**2 / (np.pi * frequency[1:])
    spectrum = rng.standard_normal((frequency.size, 3)) + 1j * rng.standard_normal((frequency.size, 3))
    spectrum *= np.sqrt(density * rate * size / 4)[:, None]
    noise = irfft(spectrum, size, axis=0)[:n]
    return np.asarray(noise - noise.mean(axis=0))


def _burst_factor(rng: Generator, t: Array, most: float) -> Array:
    """Return a factor that is one and swells up to `most` in a few bursts."""
    factor = np.ones(t.size)
    for begin, end in mr.spans(rng, float(t[-1]), int(rng.integers(3, 9)), 0.3, 1.5):
        inside = (t >= begin) & (t < end)
        swell = np.sin(np.pi * (t[inside] - begin) / (end - begin)) ** 2
        factor[inside] += rng.uniform(0.4, 1.0) * most * swell
    return factor


# Bias instabilities and random walks of cheap sensors: acc in m/s^2, gyr in rad/s, mag in uT.
_INSTABILITY = {"acc": (3e-4, 2e-3), "gyr": (5 / 3600 * DEGREE, 30 / 3600 * DEGREE), "mag": (0.02, 0.1)}
_WALK = {"acc": (2e-4, 1e-3), "gyr": (0.001 * DEGREE, 0.005 * DEGREE), "mag": (0.0, 0.0)}


@dataclass(frozen=True)
class NoiseSetting:
    """What the noise of one sensor depends on.

    Attributes
    ----------
    sensor
        ``acc``, ``gyr`` or ``mag``.
    size
        Standard deviation per sample of the white part.
    t, rate
        Times and nominal rate of the rows.
    speed
        Magnitude of the angular rate at each time, in rad/s.
    rng
        Where the draws come from.
    """

    sensor: str
    size: float
    t: Array
    rate: float
    speed: Array
    rng: Generator

    @property
    def n(self) -> int:
        """Return the number of rows."""
        return int(self.t.size)

    def white(self) -> Array:
        """Draw the white part."""
        return np.asarray(self.size * self.rng.standard_normal((self.n, 3)))

    def slow(self, share: float, longest: float) -> Array:
        """Draw noise with a time constant above 0.02 s, as large as this share of white at 100 Hz."""
        constant = float(np.exp(self.rng.uniform(np.log(0.02), np.log(longest))))
        size = share * self.size * np.sqrt(100.0 / self.rate)
        return np.asarray(size * ar1(self.rng, self.n, self.rate, constant))

    def walk(self, strength: float) -> Array:
        """Draw a random walk that starts at zero, in units per root second."""
        steps = self.rng.standard_normal((self.n, 3))
        return np.asarray(strength / np.sqrt(self.rate) * np.cumsum(steps, axis=0))


def _ar1_noise(s: NoiseSetting) -> Array:
    return s.white() + s.slow(s.rng.uniform(0.4, 1.0), 0.6)


def _flicker_noise(s: NoiseSetting) -> Array:
    return s.white() + flicker(s.rng, s.n, s.rate, s.rng.uniform(*_INSTABILITY[s.sensor]))


def _heavy_tails(s: NoiseSetting) -> Array:
    return np.asarray(s.size / np.sqrt(3.0) * s.rng.standard_t(3, (s.n, 3)))


def _bursts(s: NoiseSetting) -> Array:
    return s.white() * _burst_factor(s.rng, s.t, 15.0 if s.sensor == "acc" else 4.0)[:, None]


def _follows_rate(s: NoiseSetting) -> Array:
    """Return noise whose variance grows with the square of the angular rate."""
    usual = max(float(np.sqrt(np.mean(s.speed**2))), 1e-9)
    relative = s.rng.uniform(1.0, 3.0) * s.speed / usual
    return np.asarray(s.white() * np.sqrt(1 + relative**2)[:, None])


def _grows(s: NoiseSetting) -> Array:
    return s.white() * np.linspace(1.0, s.rng.uniform(2.0, 4.0), s.n)[:, None]


def _small_walk(s: NoiseSetting) -> Array:
    """Return a walk whose mean is below the standard error that the white noise gives the mean."""
    uncertainty = s.size / np.sqrt(s.n)
    return s.white() + s.walk(s.rng.uniform(0.2, 0.8) * uncertainty / np.sqrt(s.n / s.rate / 3))


def _cheap_walk(s: NoiseSetting) -> Array:
    return s.white() + s.walk(s.rng.uniform(*_WALK[s.sensor]))


def _coloured(s: NoiseSetting) -> Array:
    """Return heavy tails in bursts that follow the rate, beside correlated and flicker noise."""
    heavy = s.size / np.sqrt(2.0) * s.rng.standard_t(4, (s.n, 3))
    factor = _burst_factor(s.rng, s.t, 6.0 if s.sensor == "acc" else 2.0)
    factor = factor * (1 + 0.5 * s.speed / max(float(s.speed.max()), 1e-9))
    slow = s.slow(0.5, 0.3)
    return np.asarray(heavy * factor[:, None] + slow + flicker(s.rng, s.n, s.rate, _INSTABILITY[s.sensor][0]))


NOISES: dict[str, Callable[[NoiseSetting], Array]] = {
    "white": NoiseSetting.white,
    "ar1": _ar1_noise,
    "flicker": _flicker_noise,
    "heavy_tails": _heavy_tails,
    "bursts": _bursts,
    "follows_rate": _follows_rate,
    "grows": _grows,
    "small_walk": _small_walk,
    "cheap_walk": _cheap_walk,
    "coloured": _coloured,
}


def _line(rng: Generator, t: Array, rate: float, size: float) -> Array:
    """Return a spectral line in all axes, well above the motion, whose frequency breathes a little."""
    frequency = rng.uniform(0.15, 0.42) * rate
    phase = 2 * np.pi * frequency * t + rng.uniform(0, 2.0) * np.sin(2 * np.pi * 0.1 * t)
    return np.asarray(rng.uniform(0.5, 2.0) * size * np.sin(phase[:, None] + rng.uniform(0, 2 * np.pi, 3)))


def _mains(rng: Generator, t: Array, attitude: Array) -> Array:
    """Return the field of the mains in the body frame."""
    strength = rng.uniform(0.5, 2.0) * rng.standard_normal(3)
    wave = np.sin(2 * np.pi * rng.uniform(49.9, 50.1) * t + rng.uniform(0, 2 * np.pi))
    return mr.rotate(mr.conjugate(attitude), wave[:, None] * strength)


# Full scale of each sensor; the step is this over 2^(bits - 1).
_FULL_SCALE = {
    16: {"acc": 16 * mr.GRAVITY, "gyr": 2000 * DEGREE, "mag": 4900.0},
    10: {"acc": 4 * mr.GRAVITY, "gyr": 500 * DEGREE, "mag": 200.0},
}


def _quantise(values: Array, sensor: str, bits: int) -> Array:
    """Round to the sensor's step; a range that the motion exceeds is doubled, so nothing clips."""
    scale = _FULL_SCALE[bits][sensor]
    while np.nanmax(np.abs(values)) > 0.98 * scale:
        scale *= 2
    step = scale / 2 ** (bits - 1)
    return np.asarray(np.round(values / step) * step)


# --------------------------------------------------------------------------------
# Columns that do not act
# --------------------------------------------------------------------------------


def _temperature(t: Array, speed: Array, rng: Generator) -> Array:
    """Return a temperature that warms up, swings or drifts, in steps of 0.01 degC."""
    share = t / t[-1]
    way = rng.integers(3)
    if way == 0:
        change = rng.uniform(5, 15) * (1 - np.exp(-share / rng.uniform(0.3, 2)))
    elif way == 1:
        change = rng.uniform(1, 8) * np.sin(2 * np.pi * share * rng.uniform(0.5, 2) + rng.uniform(0, 6))
    else:
        change = rng.uniform(-6, 6) * share
    return np.asarray(np.round(24 + change + 0.02 * rng.standard_normal(t.size), 2))


def _battery(t: Array, speed: Array, rng: Generator) -> Array:
    """Return a voltage that falls with time and sags while the body turns."""
    sag = 0.15 * speed / max(float(speed.max()), 1e-9)
    return np.asarray(12.4 - rng.uniform(0.1, 0.6) * t / t[-1] - sag + 0.01 * rng.standard_normal(t.size))


def _current(t: Array, speed: Array, rng: Generator) -> Array:
    """Return a current that the motors draw while the body turns."""
    load = speed / max(float(speed.max()), 1e-9)
    return np.asarray(0.5 + rng.uniform(2, 10) * load + 0.05 * rng.standard_normal(t.size))


def _pressure(t: Array, speed: Array, rng: Generator) -> Array:
    return np.asarray(101325 + 20 * np.cumsum(rng.standard_normal(t.size)) / np.sqrt(t.size))


def _cpu_load(t: Array, speed: Array, rng: Generator) -> Array:
    return np.asarray(np.repeat(rng.uniform(0, 1, t.size // 50 + 1), 50)[: t.size])


def _humidity(t: Array, speed: Array, rng: Generator) -> Array:
    return np.asarray(45 + 3 * np.sin(2 * np.pi * t / t[-1] * rng.uniform(0.5, 3)))


def _counter(t: Array, speed: Array, rng: Generator) -> Array:
    return np.arange(t.size, dtype=np.float64) % 256


COVARIATES: dict[str, Callable[[Array, Array, Generator], Array]] = {
    "temp": _temperature,
    "vbat": _battery,
    "motor_current": _current,
    "pressure": _pressure,
    "cpu_load": _cpu_load,
    "humidity": _humidity,
    "counter": _counter,
}


# --------------------------------------------------------------------------------
# Logs
# --------------------------------------------------------------------------------


def _rows(recipe: Recipe, rng: Generator, rate: float, seconds: float) -> Array:
    """Return the true times of the log's rows, from zero."""
    t = np.arange(round(seconds * rate)) / rate
    if "rows_uneven" in recipe.extras:
        t = t + rng.uniform(-0.35, 0.35, t.size) / rate
        t -= t[0]
    if "rows_lost" in recipe.extras:
        keep = rng.random(t.size) > rng.uniform(0.01, 0.08)
        keep &= ~mr.within(t, mr.spans(rng, seconds, int(rng.integers(1, 4)), 0.05, 0.4))
        t = t[keep]
        t -= t[0]
    return np.asarray(t)


def _triple(prefix: str, values: Array) -> dict[str, Array]:
    """Name three columns."""
    return {f"{prefix}{axis}": values[:, k] for k, axis in enumerate(AXES)}


def _reference_columns(reference: Reference, position: bool) -> dict[str, Array]:
    """Name the columns of a reference."""
    columns: dict[str, Array] = {}
    if reference.angle is not None:
        columns["ref_angle"] = reference.angle
    if reference.attitude_shown:
        columns |= {f"ref_q{name}": reference.track.attitude[:, k] for k, name in enumerate("wxyz")}
        if position:
            columns |= _triple("ref_p", reference.track.position)
    return columns


def _pose_labels(t: Array, force: Array, rests: tuple[tuple[float, float], ...]) -> npt.NDArray[np.object_]:
    """Label each rest by the body axis that points up, and leave the moves empty."""
    labels = np.full(t.size, None, dtype=object)
    for rest in rests:
        inside = mr.within(t, [rest])
        up = force[inside].mean(axis=0)
        k = int(np.argmax(np.abs(up)))
        labels[inside] = f"{'+' if up[k] > 0 else '-'}{AXES[k]}"
    return labels


def _chosen(choice: Choice, rng: Generator) -> bool:
    """Draw a choice that is left open."""
    return rng.random() < 0.5 if choice == "any" else choice == "with"


def _pick(rng: Generator, values: tuple[Any, ...]) -> Any:
    """Draw one of the values."""
    return values[int(rng.integers(len(values)))]


@dataclass(frozen=True)
class _World:
    """Where the log is taken: the axes of the reference frame, gravity and the magnetic field."""

    axes: str
    gravity: float
    magnetic: Array


def _world(rng: Generator) -> _World:
    axes = str(_pick(rng, ("NED", "NED", "ENU", "NWU")))
    gravity = round(rng.uniform(9.78, 9.83), 5) if rng.random() < 0.3 else mr.GRAVITY
    magnetic = mr.field_vector(rng.uniform(15, 30), rng.uniform(-3, 3), rng.uniform(25, 48), axes)
    return _World(axes, gravity, magnetic)


def _world_metadata(world: _World, with_mag: bool, rng: Generator) -> dict[str, Any]:
    """Return the metadata of a log; what a reader assumes anyway or can estimate is stated now and then."""
    metadata: dict[str, Any] = {}
    if world.axes != "NED" or rng.random() < 0.5:
        metadata["frame"] = world.axes
    if world.gravity != mr.GRAVITY:
        metadata["gravity"] = world.gravity
    if with_mag and rng.random() < 0.5:
        metadata["mag_reference"] = [float(part) for part in world.magnetic]
    return metadata


def _measured(recipe: Recipe, ideal: Array, attitude: Array, setting: NoiseSetting) -> Array:
    """Return the readings of one sensor: ideal readings, noise, and what else the kind asks for."""
    rng, sensor = setting.rng, setting.sensor
    values = ideal + NOISES[recipe.noise](setting)
    if "line" in recipe.extras and sensor != "mag":
        values = values + _line(rng, setting.t, setting.rate, setting.size)
    if "mains" in recipe.extras and sensor == "mag":
        values = values + _mains(rng, setting.t, attitude)
    for bits in _FULL_SCALE:
        if f"quantise_{bits}" in recipe.extras:
            values = _quantise(values, sensor, bits)
    if "slow_mag" in recipe.extras and sensor == "mag":
        step = int(_pick(rng, (5, 8, 10)))
        values = np.where((np.arange(setting.n) % step == 0)[:, None], values, np.nan)
    return values


def _table(columns: dict[str, Any], reference: Reference, shown: dict[str, Array]) -> pd.DataFrame:
    """Put readings and reference side by side, or merge them by time if the reference has its own rows."""
    if not reference.own_rows:
        return pd.DataFrame(columns | shown)
    both = [pd.DataFrame(columns), pd.DataFrame({"t": reference.track.stamp} | shown)]
    return pd.concat(both).sort_values("t", ignore_index=True).drop_duplicates("t", ignore_index=True)


def _right(
    recipe: Recipe,
    reference: Reference,
    rate: float,
    motion: str,
) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names and verdicts that are right."""
    may_name = reference.may_name | recipe.may_name
    verdicts = reference.verdicts | recipe.verdicts
    if rate <= SLOW_RATE or motion.startswith("drone"):
        # The rows are too slow to follow all of the motion, so a reference on them has lost some of it.
        may_name |= SMOOTHING_IDS
        verdicts = VERDICTS
    if recipe.unseen_translation:
        verdicts |= OR_UNKNOWN
    if not may_name:
        verdicts -= {"missing", "ambiguous"}
    return may_name, verdicts


def draw(seed: int) -> Case:
    """Return the log of this seed: the kind is `KINDS[seed % len(KINDS)]`, and the seed draws all else."""
    kind = KINDS[seed % len(KINDS)]
    recipe = RECIPES[kind]
    rng = np.random.default_rng(seed)

    rate = float(_pick(rng, recipe.rates))
    seconds = float(_pick(rng, tuple(s for s in recipe.seconds if s * rate <= MOST_ROWS)))
    with_position = not recipe.unseen_translation and _chosen(recipe.position, rng)
    with_mag = _chosen(recipe.magnetometer, rng)
    sensors = (*recipe.sensors, "mag") if with_mag else recipe.sensors
    world = _world(rng)
    metadata = _world_metadata(world, with_mag, rng)

    name = str(_pick(rng, recipe.motions))
    rests: tuple[tuple[float, float], ...] = ()
    if name == "six_positions":
        motion, rests = mr.six_positions(rng, seconds)
    elif name == "one_axis":
        metadata["rig_axis"] = str(_pick(rng, tuple(AXES)))
        motion = mr.one_axis(rng, seconds, np.eye(3)[AXES.index(metadata["rig_axis"])])
    else:
        motion = MOTIONS[name](Pace(rng, seconds, rate, with_position or recipe.unseen_translation))

    t = _rows(recipe, rng, rate, seconds)
    state = motion.state(t)
    ideal = mr.ideal_readings(state, mr.gravity_vector(world.axes, world.gravity), world.magnetic)
    speed = np.linalg.norm(state.rate, axis=1)
    reference = REFERENCES[recipe.reference](Setting(motion, t, rate, seconds, rng))

    sizes = white_sizes(rng, rate)
    columns: dict[str, Any] = {"t": t}
    for sensor in sensors:
        setting = NoiseSetting(sensor, sizes[sensor], t, rate, speed, rng)
        columns |= _triple(f"{sensor}_", _measured(recipe, getattr(ideal, sensor), state.attitude, setting))
    for column in recipe.covariates:
        columns[column] = COVARIATES[column](t, speed, rng)
    if rests:
        columns["pose"] = _pose_labels(t, ideal.acc, rests)
    if recipe.noise == "white" and not recipe.extras and rng.random() < STATED_NOISE:
        metadata["noise"] = {sensor: float(sizes[sensor]) for sensor in sensors}

    frame = _table(columns, reference, _reference_columns(reference, with_position))
    frame["t"] += float(_pick(rng, (0.0, 0.0, 37.125, 1000.5)))
    may_name, verdicts = _right(recipe, reference, rate, name)
    return Case(f"{kind}_{seed}", frame, metadata, reference.effects, may_name, verdicts, seconds)
