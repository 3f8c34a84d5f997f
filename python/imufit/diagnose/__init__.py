"""The loop: which effect is missing, and what adding it brings."""

from imufit.diagnose.add import add
from imufit.diagnose.diagnose import diagnose
from imufit.diagnose.ladder import ladder

__all__ = ["add", "diagnose", "ladder"]
