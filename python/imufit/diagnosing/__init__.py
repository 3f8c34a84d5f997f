"""The loop: which effect is missing, and what adding it brings."""

from imufit.diagnosing.add import add
from imufit.diagnosing.diagnose import diagnose
from imufit.diagnosing.ladder import ladder

__all__ = ["add", "diagnose", "ladder"]
