"""Where a model fails: the residual by channel, covariate, segment and frequency, and a filter's attitude."""

from imufit.comparing.attitude import attitude_comparison
from imufit.comparing.causes import cause_names, cause_panels, cause_shares
from imufit.comparing.compare import compare, compare_model, comparison, panels
from imufit.comparing.judged import judged
from imufit.comparing.log_rows import compare_with_rows, rows_of_fit
from imufit.comparing.noise_budget import noise_budget
from imufit.comparing.notes import notes
from imufit.comparing.two_models import compare_two
from imufit.comparing.unexplained import unexplained

__all__ = [
    "attitude_comparison",
    "cause_names",
    "cause_panels",
    "cause_shares",
    "compare",
    "compare_model",
    "compare_two",
    "compare_with_rows",
    "comparison",
    "judged",
    "noise_budget",
    "notes",
    "panels",
    "rows_of_fit",
    "unexplained",
]
