"""Filters over logs: attitude for every row and its error against a reference."""

from imufit.replay.replay import DEFAULT_FILTERS, FILTERS, SETTINGS, Replay, estimate_mag_reference, replay

__all__ = ["DEFAULT_FILTERS", "FILTERS", "SETTINGS", "Replay", "estimate_mag_reference", "replay"]
