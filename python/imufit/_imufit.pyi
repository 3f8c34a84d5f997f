"""Types of the compiled module. One section for each file of the binding; tests compare it with the module."""

from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

__version__: str

# --- attitude: quaternions (n, 4) scalar first, angles rad; rows that are no attitude give NaN

class _Rmse(TypedDict):
    rows: int
    total: float
    heading: float
    inclination: float
    roll: float
    pitch: float
    yaw: float
    sd: float

class _FrameVectors(TypedDict):
    up: list[float]
    north: list[float]
    field: list[float]

def quaternion_product(a: _Array, b: _Array) -> _Array: ...
def quaternion_from_rotation_vector(vector: _Array) -> _Array: ...
def rotation_vector_from_quaternion(q: _Array) -> _Array: ...
def euler_from_quaternion(q: _Array) -> _Array: ...
def quaternion_from_euler(euler: _Array) -> _Array: ...
def matrix_from_quaternion_rows(q: _Array) -> _Array: ...
def quaternion_from_matrix_rows(matrix: _Array) -> _Array: ...
def rotate(q: _Array, x: _Array) -> _Array: ...
def rotate_back(q: _Array, x: _Array) -> _Array: ...
def convert_frame(q: _Array, source: str, target: str) -> _Array: ...
def frame_vectors(frame: str) -> _FrameVectors: ...
def attitude_errors(estimate: _Array, reference: _Array) -> _Array: ...
def attitude_rmse(estimate: _Array, reference: _Array, mask: NDArray[np.bool_] | None = None) -> _Rmse | None: ...

# --- filters

class _Setting(TypedDict):
    default: float
    unit: str
    meaning: str

class _Description(TypedDict):
    summary: str
    needs: list[str]
    settings: dict[str, _Setting]

class Filter:
    state: _Array
    def __new__(
        cls,
        name: str,
        *,
        frame: str = "NED",
        gravity: float = 9.80665,
        mag_reference: Sequence[float] | None = None,
        settings: Mapping[str, float] | None = None,
        rules: Mapping[str, float] | None = None,
        initial: Sequence[float] | None = None,
        start_time: float | None = None,
    ) -> Filter: ...
    @property
    def name(self) -> str: ...
    def run(
        self, t: _Array, acc: _Array | None = None, gyr: _Array | None = None, mag: _Array | None = None
    ) -> tuple[_Array, dict[str, int]]: ...
    def reset(self) -> None: ...

def filter_descriptions() -> dict[str, _Description]: ...
def replay_rules() -> dict[str, _Setting]: ...
