"""A simulation as a file, with its sealed truth beside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from imufit.lab.simulate import seal

if TYPE_CHECKING:
    from imufit.lab.simulate import Simulation


def save_simulation(simulation: Simulation, path: Path) -> Path:
    """Write the log and its sealed truth beside it; return the path of the truth.

    Parameters
    ----------
    simulation : Simulation
        The simulated readings and their truth.
    path : Path
        The log; its ending chooses the format.
    """
    simulation.to_log().write(path)
    return seal(simulation.truth, path)
