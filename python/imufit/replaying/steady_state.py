"""Where the Kalman filter of angle and gyro bias settles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from imufit import _imufit


@dataclass(frozen=True)
class SteadyState:
    """Gains of the settled Kalman filter, and how long it takes to settle.

    Parameters
    ----------
    angle : float
        Part of the innovation by which the angle is corrected at each reading.
    bias : float
        Correction of the gyro bias per innovation, 1/s; not positive.
    time_constant : float
        Time in which the slowest part of an error falls to 1/e, s: the closed loop's dominant pole. Infinite for a
        filter that corrects nothing; that of the angle alone where `bias_walk` is 0 and the bias is not followed.
    """

    angle: float
    bias: float
    time_constant: float


def kalman_steady_state(dt: float, settings: Mapping[str, float] | None = None) -> SteadyState:
    """Solve the Riccati equation of the Kalman filter for readings at equal intervals.

    The state is angle and gyro bias, the measurement the accelerometer's angle (paper B, the filter it cites; the paper
    prints no matrices): ``F = [[1, -dt], [0, 1]]``, ``H = [1, 0]``, ``Q = diag(gyr_noise^2, bias_walk^2) dt``,
    ``R = acc_noise^2 / dt``. The solution is in closed form.

    Parameters
    ----------
    dt : float
        Interval of the readings, s.
    settings : mapping, optional
        ``{"gyr_noise": 1e-3, ...}`` as in ``SETTINGS["kalman"]``; what is left out has its default.

    Returns
    -------
    SteadyState
        Gains and time constant.

    Raises
    ------
    ValueError
        An unknown setting, or an interval that is not positive.
    """
    return SteadyState(*_imufit.kalman_steady_state(dt, dict(settings or {})))
