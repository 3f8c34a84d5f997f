"""The blind protocol: how often the answer is right on logs of which it does not know what was done to them.

`SETS` holds kinds of logs; `grade` draws logs of them, lets the ladder answer, and marks the answers. Each log depends
on its set and its seed alone: `draw(set, seed)` makes it again, `trial(set, seed)` answers and marks it again.
"""

from imufit.grade.blind_grade import BlindGrade
from imufit.grade.mark import Marks
from imufit.grade.power import PowerCurve, PowerPoint, power_curve
from imufit.grade.protocol import grade, plan
from imufit.grade.puzzle import Puzzle
from imufit.grade.sets import SETS, BlindSet, draw
from imufit.grade.trial import Trial, trial

__all__ = [
    "SETS",
    "BlindGrade",
    "BlindSet",
    "Marks",
    "PowerCurve",
    "PowerPoint",
    "Puzzle",
    "Trial",
    "draw",
    "grade",
    "plan",
    "power_curve",
    "trial",
]
