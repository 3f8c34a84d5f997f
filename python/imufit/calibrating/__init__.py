"""Calibration from gravity and the constant field: poses at rest, turns between them, free rotation.

Paper A of the documentation: six positions on a levelling table, least squares, ``corrected = C K reading + b``.
"""

from imufit.calibrating.calibrate import calibrate
from imufit.calibrating.calibration import Calibration, SensorCalibration
from imufit.calibrating.guide import Advice, PoseGuide
from imufit.calibrating.wizard import Stage, Wizard
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
    "find_poses",
]
