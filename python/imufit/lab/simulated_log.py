"""A simulation as a log, and as a file with its sealed truth beside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from imufit.lab.simulate import seal
from imufit.log import Log

if TYPE_CHECKING:
    from imufit.lab.simulate import Simulation


def log_of(simulation: Simulation) -> Log:
    """Return the log of a simulation, without the truth.

    Parameters
    ----------
    simulation : Simulation
        The simulated readings.
    """
    return Log.from_arrays(
        simulation.t,
        acc=simulation.acc,
        gyr=simulation.gyr,
        mag=simulation.mag,
        temp=simulation.temp,
        reference=simulation.ref_q,
        ref_p=simulation.ref_p,
        ref_angle=simulation.ref_angle,
        pose=None if simulation.pose is None else simulation.pose.tolist(),
        covariates=simulation.covariates,
        **simulation.metadata,
    )


def save_simulation(simulation: Simulation, path: Path) -> Path:
    """Write the log and its sealed truth beside it; return the path of the truth.

    Parameters
    ----------
    simulation : Simulation
        The simulated readings and their truth.
    path : Path
        The log; its ending chooses the format.
    """
    log_of(simulation).write(path)
    return seal(simulation.truth, path)
