"""Other packages' attitude filters, and plain C loops of Mahony's, over the same nine axes: for `filters.py`.

Each takes equal steps of `dt` s, angular rate in rad/s, specific force in m/s^2 and magnetic field in uT, (n, 3), and
gives (n, 4) quaternions in its own convention: only the time counts here.
"""

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import ahrs
import imufusion
import numpy as np
import vqf

try:
    import qmt
    from qmt.cpp.madgwick import MahonyAHRS
except ImportError:
    # Its wheels are made for NumPy 1: `pip install --no-binary qmt qmt` makes one for the NumPy that is there.
    qmt = MahonyAHRS = None

Array = np.ndarray
SOURCE = Path(__file__).with_name("mahony.c")


def vqf_online(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return vqf.VQF(dt).updateBatch(gyr, acc, mag)["quat9D"]


def vqf_offline(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return vqf.offlineVQF(gyr, acc, mag, dt)["quat9D"]


def qmt_mahony(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return qmt.oriEstMahony(gyr, acc, mag, params={"Ts": dt})


def qmt_loop(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    """qmt's Mahony without the turn into its reference frame."""
    return MahonyAHRS(0.5, 0.0, 1.0 / dt).updateBatch(gyr, acc, mag)[0]


def imufusion_ahrs(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    made, out = imufusion.Ahrs(), np.empty((len(gyr), 4))
    made.set_sample_period(dt)
    degrees, gravities = np.degrees(gyr), acc / 9.80665
    for k in range(len(gyr)):
        made.update(degrees[k], gravities[k], mag[k])
        out[k] = made.get_quaternion()
    return out


def ahrs_mahony(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return ahrs.filters.Mahony(gyr=gyr, acc=acc, mag=mag, frequency=1.0 / dt).Q


PEERS: dict[str, tuple[Callable[..., Array], int]] = {
    "vqf, online": (vqf_online, 1_000_000),
    "vqf, offline": (vqf_offline, 200_000),
    **({} if qmt is None else {"qmt, Mahony": (qmt_mahony, 1_000_000), "qmt, its loop": (qmt_loop, 1_000_000)}),
    "imufusion": (imufusion_ahrs, 100_000),
    "ahrs, Mahony": (ahrs_mahony, 5_000),
}
"""Filter, and rows that it does in reasonable time."""


class CLoop:
    """`mahony.c`, compiled here and now for this machine."""

    FORMS = ("first_order", "exact")

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "mahony.so"
            command = ("gcc", "-O3", "-march=native", "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-lm")
            subprocess.run(command, check=True)
            self._library = ctypes.CDLL(str(library))

    def run(self, form: str, t: Array, gyr: Array, acc: Array, mag: Array, gains: Array, start: Array) -> Array:
        out = np.empty((len(t), 4))
        columns = (t, gyr, acc, mag, gains, start, out)
        getattr(self._library, form)(
            ctypes.c_size_t(len(t)), *(column.ctypes.data_as(ctypes.c_void_p) for column in columns)
        )
        return out
