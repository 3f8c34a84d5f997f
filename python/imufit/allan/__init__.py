"""Allan deviation of sensors at rest: noise density, bias instability and random walk read off, with their errors."""

from imufit.allan.deviation import allan
from imufit.allan.filter_noise import filter_noise
from imufit.allan.result import Allan, Channel
from imufit.allan.terms import TERMS, Term

__all__ = ["TERMS", "Allan", "Channel", "Term", "allan", "filter_noise"]
