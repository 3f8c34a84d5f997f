"""Synthetic logs in which each effect is done physically, so that what an analysis finds can be judged.

A motion with exact derivatives (`SCENARIOS`) carries sensors with random errors (`Noise`); effects (`INJECTIONS`) are
done to them as nature would: a late sensor is read earlier on the motion, a displaced one is carried elsewhere on the
body. Nothing here uses the model that is fitted to such logs.
"""

from imufit.simulate.courses import Course, Line, Mixture, Wandering
from imufit.simulate.entry import Injection
from imufit.simulate.faults import FAULTS, Fault, with_fault
from imufit.simulate.grade import Grade, ParameterGrade, grade
from imufit.simulate.hidden import OBSERVABLE, hidden
from imufit.simulate.injections import INJECTIONS, injection
from imufit.simulate.noise import Noise, SensorNoise
from imufit.simulate.outside import OUTSIDE, Outside
from imufit.simulate.scenario import Scenario
from imufit.simulate.scenarios import SCENARIOS
from imufit.simulate.sealed import Truth, seal, sealed_path, unseal
from imufit.simulate.simulation import Simulation, simulate
from imufit.simulate.size import SIZES
from imufit.simulate.truth import Kinematics, Trajectory

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
