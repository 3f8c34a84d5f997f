"""A sensor's log and somebody else's reference, on two clocks, become one log."""

from imufit.joining.found_attitude import join_as_found
from imufit.joining.join import join
from imufit.joining.joined import Joined
from imufit.joining.reference import declared_attitude, with_attitude

__all__ = ["Joined", "declared_attitude", "join", "join_as_found", "with_attitude"]
