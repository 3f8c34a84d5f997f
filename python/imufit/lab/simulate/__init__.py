"""Synthetic logs in which each effect is done physically, so that what an analysis finds can be judged.

A motion with exact derivatives (`SCENARIOS`) carries sensors with random errors (`Noise`); effects (`INJECTIONS`) are
done to them as nature would: a late sensor is read earlier on the motion, a displaced one is carried elsewhere on the
body. Nothing here uses the model that is fitted to such logs.
"""

from imufit.lab.simulate.courses import Course, Line, Mixture, Wandering
from imufit.lab.simulate.entry import Injection
from imufit.lab.simulate.faults import FAULTS, Fault, with_fault
from imufit.lab.simulate.grade import Grade, ParameterGrade, grade
from imufit.lab.simulate.hidden import OBSERVABLE, hidden
from imufit.lab.simulate.injections import INJECTIONS, injection
from imufit.lab.simulate.noise import Noise, SensorNoise
from imufit.lab.simulate.outside import OUTSIDE, Outside
from imufit.lab.simulate.scenario import Scenario
from imufit.lab.simulate.scenarios import SCENARIOS
from imufit.lab.simulate.sealed import Truth, seal, sealed_path, unseal
from imufit.lab.simulate.simulation import Simulation, simulate
from imufit.lab.simulate.size import SIZES
from imufit.lab.simulate.truth import Kinematics, Trajectory

__all__ = [
    "FAULTS",
    "INJECTIONS",
    "OBSERVABLE",
    "OUTSIDE",
    "SCENARIOS",
    "SIZES",
    "Course",
    "Fault",
    "Grade",
    "Injection",
    "Kinematics",
    "Line",
    "Mixture",
    "Noise",
    "Outside",
    "ParameterGrade",
    "Scenario",
    "SensorNoise",
    "Simulation",
    "Trajectory",
    "Truth",
    "Wandering",
    "grade",
    "hidden",
    "injection",
    "seal",
    "sealed_path",
    "simulate",
    "unseal",
    "with_fault",
]
