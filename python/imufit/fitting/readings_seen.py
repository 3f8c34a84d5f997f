"""How many readings of each axis a log has, and between which values they lie."""

from __future__ import annotations

from typing import Any

import numpy as np

from imufit.log.columns import SENSOR_NAMES


class ReadingsSeen:
    """Counts and extent of the readings of every sensor, chunk by chunk."""

    def __init__(self) -> None:
        self._counts = {sensor: np.zeros(3, dtype=int) for sensor in SENSOR_NAMES}
        self._least = {sensor: np.full(3, np.inf) for sensor in SENSOR_NAMES}
        self._most = {sensor: np.full(3, -np.inf) for sensor in SENSOR_NAMES}

    def add(self, arrays: dict[str, Any], core: slice) -> None:
        """Add the rows `core` of a chunk."""
        for sensor in SENSOR_NAMES:
            if arrays[sensor] is None:
                continue
            readings = arrays[sensor][core]
            finite = np.isfinite(readings)
            self._counts[sensor] += finite.sum(axis=0)
            least = np.min(readings, axis=0, where=finite, initial=np.inf)
            most = np.max(readings, axis=0, where=finite, initial=-np.inf)
            np.minimum(self._least[sensor], least, out=self._least[sensor])
            np.maximum(self._most[sensor], most, out=self._most[sensor])

    def dead(self) -> list[tuple[str, list[str]]]:
        """Sensors that have values on some axes only, and the axes without any."""
        found = []
        for sensor, counts in self._counts.items():
            axes = [f"{sensor}_{axis}" for axis, count in zip("xyz", counts, strict=True) if count == 0]
            if 0 < len(axes) < 3:
                found.append((sensor, axes))
        return found

    def still(self, fewest: int) -> list[str]:
        """Sensors with at least `fewest` readings, all of them the same."""
        read = [sensor for sensor, counts in self._counts.items() if counts.min() >= fewest]
        return [sensor for sensor in read if np.array_equal(self._least[sensor], self._most[sensor])]

    def flat(self, fewest: int) -> dict[str, list[str]]:
        """Axes whose readings are all the same, by sensor, where another axis of that sensor has others."""
        flat = {
            sensor: [f"{sensor}_{'xyz'[k]}" for k in np.flatnonzero(self._least[sensor] == self._most[sensor])]
            for sensor, counts in self._counts.items()
            if counts.min() >= fewest
        }
        return {sensor: axes for sensor, axes in flat.items() if 0 < len(axes) < 3}

    def read(self) -> list[str]:
        """Sensors with readings on all axes."""
        return [sensor for sensor, counts in self._counts.items() if counts.all()]
