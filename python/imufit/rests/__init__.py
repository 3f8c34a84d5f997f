"""Rests of a log: poses, turns between them, and whether gravity is as long there as it should be."""

from imufit.rests.poses import SIDES, UP, Pose, distinct, find_poses, side_numbers
from imufit.rests.turns import Turns, find_turns
from imufit.rests.unit import check_unit

__all__ = ["SIDES", "UP", "Pose", "Turns", "check_unit", "distinct", "find_poses", "find_turns", "side_numbers"]
