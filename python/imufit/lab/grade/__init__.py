"""The blind protocol: how often the answer is right on logs of which it does not know what was done to them.

`SETS` holds kinds of logs; `grade` draws logs of them, lets the ladder answer, and marks the answers. Each log depends
on its set and its seed alone: `draw(set, seed)` makes it again, `trial(set, seed)` answers and marks it again.
"""

from imufit.lab.grade.blind_grade import BlindGrade
from imufit.lab.grade.mark import Marks
from imufit.lab.grade.power import PowerCurve, PowerPoint, power_curve
from imufit.lab.grade.protocol import grade, plan
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.grade.sets import SETS, BlindSet, draw
from imufit.lab.grade.trial import Trial, trial

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
