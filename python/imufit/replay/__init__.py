"""Filters over logs and live rows: attitude for every row and its error against a reference."""

from imufit.replay.replay import (
    DEFAULT_FILTERS,
    FILTERS,
    SETTINGS,
    SMOOTHERS,
    Replay,
    estimate_mag_reference,
    replay,
)
from imufit.replay.replay_many import replay_many
from imufit.replay.steady_state import SteadyState, kalman_steady_state
from imufit.replay.stream import Stream
from imufit.replay.tilt_angles import tilt_angles

__all__ = [
    "DEFAULT_FILTERS",
    "FILTERS",
    "SETTINGS",
    "SMOOTHERS",
    "Replay",
    "SteadyState",
    "Stream",
    "estimate_mag_reference",
    "kalman_steady_state",
    "replay",
    "replay_many",
    "tilt_angles",
]
