"""The loop: where the model fails, which effect is missing, what adding it brings."""

from imufit.diagnose.add import add
from imufit.diagnose.compare import compare
from imufit.diagnose.diagnose import diagnose
from imufit.diagnose.ladder import ladder

__all__ = ["add", "compare", "diagnose", "ladder"]
