"""Faults of the data, which are not effects of a sensor: wrong units and frames, turned axes, rows that cannot be.

Faults of rows (`imufit.faults.rows`) concern some samples, which are left out of the evidence where they are certain
to be wrong. Others (`imufit.faults.frames`, `imufit.faults.late`) concern the whole log: nothing can be said of
effects until they are corrected.
"""

from imufit.faults.clipped import ClippedRows
from imufit.faults.frames import frame_faults
from imufit.faults.knock import knock_faults
from imufit.faults.reference import reference_faults
from imufit.faults.rows import LeftOut, row_faults

__all__ = ["ClippedRows", "LeftOut", "frame_faults", "knock_faults", "reference_faults", "row_faults"]
