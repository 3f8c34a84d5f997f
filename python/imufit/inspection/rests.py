"""How often, how long and in how many poses a log rests."""

from __future__ import annotations

import numpy as np

from imufit.log import LogSource, judged_rows, whole
from imufit.rests import distinct, find_poses
from imufit.results.log_info import RestInfo

FEWEST = 3
"""Rows that rests are looked for in at least: fewer have no scatter."""


def rests_of(log: LogSource) -> RestInfo:
    """Find the rests of a log, labelled or not.

    Parameters
    ----------
    log : LogSource
        Any log. Of one that is too long to be held, evenly spread stretches are looked at.
    """
    if log.n < FEWEST:
        return RestInfo(reason=f"not looked for in {log.n} row{'' if log.n == 1 else 's'}")
    held = whole(judged_rows(log))
    if held.acc is None or not np.isfinite(held.acc).any():
        return RestInfo(reason="not known without an accelerometer")
    # Readings of zero have no direction, and are not a rest on earth.
    poses = [pose for pose in find_poses(held, labelled_only=False).poses if pose.used and np.any(pose.mean)]
    if not poses:
        return RestInfo()
    lengths = [pose.t_end - pose.t_start for pose in poses]
    return RestInfo(
        count=len(poses),
        longest=max(lengths),
        total=sum(lengths),
        directions=distinct(np.array([pose.direction for pose in poses])),
        spans=tuple((pose.t_start, pose.t_end) for pose in poses),
    )
