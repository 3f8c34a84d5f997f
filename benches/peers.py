"""Other packages' attitude filters over nine axes, and plain C loops of Mahony's: for `filters.py` and `broad.py`.

Each takes equal steps of `dt` s, angular rate in rad/s, specific force in m/s^2 and magnetic field in uT, (n, 3), and
gives (n, 4) quaternions, scalar first, body to the frame that `PEERS` names, with the field's direction as north. A
package that is missing leaves its filters out of `PEERS` and a line in `MISSING`.
"""

import contextlib
import ctypes
import importlib
import io
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

Array = np.ndarray
SOURCE = Path(__file__).with_name("mahony.c")
MISSING: list[str] = []


def _installed(name: str, otherwise: str) -> ModuleType | None:
    try:
        # Modules made for NumPy 1 have a stack printed before they fail.
        with contextlib.redirect_stderr(io.StringIO()):
            return importlib.import_module(name)
    except ImportError:
        MISSING.append(otherwise)
        return None


ahrs = _installed("ahrs", "ahrs is not installed: pip install ahrs")
imufusion = _installed("imufusion", "imufusion is not installed: pip install imufusion")
vqf = _installed("vqf", "vqf is not installed: pip install vqf")
qmt = _installed("qmt", "qmt is not installed: pip install qmt")
qmt_compiled = None
if qmt is not None:
    qmt_compiled = _installed(
        "qmt.cpp.madgwick",
        f"qmt's Mahony was compiled for another NumPy than {np.__version__}: pip install --force-reinstall --no-deps "
        "--no-binary qmt qmt",
    )


def vqf_online(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return vqf.VQF(dt).updateBatch(gyr, acc, mag)["quat9D"]


def vqf_offline(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return vqf.offlineVQF(gyr, acc, mag, dt)["quat9D"]


def qmt_vqf(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return qmt.oriEstVQF(gyr, acc, mag, params={"Ts": dt})


def qmt_mahony(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return qmt.oriEstMahony(gyr, acc, mag, params={"Ts": dt})


def qmt_loop(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    """qmt's Mahony without the turn into its reference frame."""
    return qmt_compiled.MahonyAHRS(0.5, 0.0, 1.0 / dt).updateBatch(gyr, acc, mag)[0]


def imufusion_ahrs(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    """With the rejections that its authors recommend: 10 deg, and 5 s until they end."""
    made, out = imufusion.Ahrs(), np.empty((len(gyr), 4))
    made.set_settings(
        imufusion.AhrsSettings(
            sample_rate=1.0 / dt,
            convention=imufusion.CONVENTION_NWU,
            gain=0.5,
            gyroscope_range=2000.0,
            acceleration_rejection=10.0,
            magnetic_rejection=10.0,
            rejection_timeout=5.0,
        )
    )
    made.set_sample_period(dt)
    degrees, gravities = np.degrees(gyr), acc / 9.80665
    for k in range(len(gyr)):
        made.update(degrees[k], gravities[k], mag[k])
        out[k] = made.get_quaternion()
    return out


def ahrs_mahony(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return ahrs.filters.Mahony(gyr=gyr, acc=acc, mag=mag, frequency=1.0 / dt).Q


def ahrs_madgwick(dt: float, gyr: Array, acc: Array, mag: Array) -> Array:
    return ahrs.filters.Madgwick(gyr=gyr, acc=acc, mag=mag, frequency=1.0 / dt).Q


class Peer(NamedTuple):
    run: Callable[[float, Array, Array, Array], Array]
    rows: int
    """Rows that it does in reasonable time."""
    frame: str | None
    """Of its attitudes; None: its own."""


PEERS: dict[str, Peer] = {}
if vqf is not None:
    PEERS["vqf, online"] = Peer(vqf_online, 1_000_000, "ENU")
    PEERS["vqf, offline"] = Peer(vqf_offline, 200_000, "ENU")
if qmt is not None:
    PEERS["qmt, VQF"] = Peer(qmt_vqf, 200_000, "ENU")
if qmt_compiled is not None:
    PEERS["qmt, Mahony"] = Peer(qmt_mahony, 1_000_000, "ENU")
    PEERS["qmt, its loop"] = Peer(qmt_loop, 1_000_000, None)
if imufusion is not None:
    PEERS["imufusion"] = Peer(imufusion_ahrs, 100_000, "NWU")
if ahrs is not None:
    PEERS["ahrs, Mahony"] = Peer(ahrs_mahony, 5_000, "ENU")
    PEERS["ahrs, Madgwick"] = Peer(ahrs_madgwick, 5_000, "NWU")


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
