"""Filters over logs and live rows: attitude for every row and its error against a reference."""

from imufit.replaying.frames import convert_frame
from imufit.replaying.gains import PAPER_C_GAINS
from imufit.replaying.replay import (
    DEFAULT_FILTERS,
    FILTERS,
    SETTINGS,
    SMOOTHERS,
    Replay,
    estimate_mag_reference,
    replay,
)
from imufit.replaying.replay_many import replay_many
from imufit.replaying.settings_file import read_settings, write_settings
from imufit.replaying.steady_state import SteadyState, kalman_steady_state
from imufit.replaying.stream import Stream
from imufit.replaying.tilt_angles import tilt_angles

__all__ = [
    "DEFAULT_FILTERS",
    "FILTERS",
    "PAPER_C_GAINS",
    "SETTINGS",
    "SMOOTHERS",
    "Replay",
    "SteadyState",
    "Stream",
    "convert_frame",
    "estimate_mag_reference",
    "kalman_steady_state",
    "read_settings",
    "replay",
    "replay_many",
    "tilt_angles",
    "write_settings",
]
