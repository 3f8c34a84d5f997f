"""Allan deviation of sensors at rest: noise density, bias instability and random walk read off, with their errors."""

from imufit.allan_deviation.deviation import allan
from imufit.allan_deviation.filter_noise import filter_noise
from imufit.allan_deviation.result import Allan, Channel
from imufit.allan_deviation.terms import TERMS, Term

__all__ = ["TERMS", "Allan", "Channel", "Term", "allan", "filter_noise"]
