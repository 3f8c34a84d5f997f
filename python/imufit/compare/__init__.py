"""Where a model fails: the residual by channel, covariate, segment and frequency, and a filter's attitude."""

from imufit.compare.attitude import attitude_comparison
from imufit.compare.compare import compare, compare_model, comparison
from imufit.compare.judged import judged
from imufit.compare.noise_budget import noise_budget
from imufit.compare.notes import notes
from imufit.compare.two_models import compare_two
from imufit.compare.unexplained import unexplained

__all__ = [
    "attitude_comparison",
    "compare",
    "compare_model",
    "compare_two",
    "comparison",
    "judged",
    "noise_budget",
    "notes",
    "unexplained",
]
