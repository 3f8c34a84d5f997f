"""Calibration from gravity and the constant field: poses at rest, turns between them, free rotation.

Paper A of the documentation: six positions on a levelling table, least squares, ``corrected = C K reading + b``.
"""

from imufit.calibrate.calibrate import calibrate
from imufit.calibrate.calibration import Calibration, SensorCalibration
from imufit.calibrate.guide import Advice, PoseGuide
from imufit.calibrate.live import calibrate_live
from imufit.calibrate.wizard import Stage, Wizard
from imufit.rests.poses import Pose, find_poses

__all__ = [
    "Advice",
    "Calibration",
    "Pose",
    "PoseGuide",
    "SensorCalibration",
    "Stage",
    "Wizard",
    "calibrate",
    "calibrate_live",
    "find_poses",
]
