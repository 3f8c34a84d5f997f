"""A sensor's log and somebody else's reference, on two clocks, become one log."""

from imufit.joining.join import join
from imufit.joining.joined import Joined
from imufit.joining.reference import with_attitude

__all__ = ["Joined", "join", "with_attitude"]
