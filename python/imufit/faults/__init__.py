"""Faults of the data that are no effects of a sensor: wrong units and frames, turned axes, rows that cannot be.

Local faults (`imufit.faults.rows`) concern some rows, whose samples are left out of the evidence where they are certain
to be wrong. Global ones (`imufit.faults.frames`) concern the whole log: nothing can be said of effects until they are
put right.
"""

from imufit.faults.frames import frame_faults

__all__ = ["frame_faults"]
