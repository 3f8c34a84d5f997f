"""Types of the compiled module. One section for each file of the binding; tests compare it with the module."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Literal, TypedDict, final

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Numbers = Sequence[float] | _Array
_Chunk = dict[str, Any]

__all__ = [
    "NORM_SEEN",
    "Candidate",
    "Disagreement",
    "Effect",
    "Evidence",
    "Facts",
    "Filter",
    "Finding",
    "Kind",
    "LineDecoder",
    "PastProducts",
    "PoseJudge",
    "Problem",
    "Profile",
    "Pyramid",
    "Status",
    "Survey",
    "Verdict",
    "WireDecoder",
    "WireEncoder",
    "__version__",
    "allan_deviation",
    "allan_freedom",
    "attitude_errors",
    "attitude_rmse",
    "best_trial",
    "block_scatter",
    "built_in_effects",
    "chained_turns",
    "convert_frame",
    "correct_readings",
    "euler_from_quaternion",
    "evaluate",
    "facts_at_rest",
    "filter_descriptions",
    "filter_trials",
    "find_effect",
    "find_rests",
    "frame_vectors",
    "furthest_trial",
    "kalman_steady_state",
    "magnitude_calibration",
    "matrix_from_quaternion_rows",
    "mpu6050_decode",
    "mpu6050_facts",
    "probes",
    "python_effect",
    "quaternion_from_euler",
    "quaternion_from_matrix_rows",
    "quaternion_from_rotation_vector",
    "quaternion_product",
    "replay_rules",
    "residual_against",
    "rest_channels",
    "rests_tell",
    "rotate",
    "rotate_back",
    "rotation_vector_from_quaternion",
    "saturate",
    "smooth",
    "sphere",
    "table_attitudes",
    "thinned",
    "tilt_angles",
    "turn_calibration",
    "unnamed_effects",
    "vector_calibration",
]

__version__: str
NORM_SEEN: float

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
def chained_turns(vector: _Array) -> _Array: ...
def rotate(q: _Array, x: _Array) -> _Array: ...
def rotate_back(q: _Array, x: _Array) -> _Array: ...
def convert_frame(q: _Array, source: str, target: str) -> _Array: ...
def frame_vectors(frame: str) -> _FrameVectors: ...
def attitude_errors(estimate: _Array, reference: _Array) -> _Array: ...
def attitude_rmse(estimate: _Array, reference: _Array, mask: NDArray[np.bool_] | None = None) -> _Rmse | None: ...

# --- allan: pieces of evenly spaced samples, NaN where one is lost

def allan_deviation(pieces: list[_Array], factors: Sequence[int]) -> tuple[_Array, list[int]]: ...
def allan_freedom(kind: str, samples: int, factor: int) -> float: ...
def block_scatter(pieces: list[_Array], rows: int) -> float: ...

# --- device: bytes (uint8) to acc (n, 3) m/s^2, gyr (n, 3) rad/s, temp (n,) degC, and what is clipped

class _Mpu6050(TypedDict):
    address: int
    address_ad0_high: int
    registers: dict[str, int]
    acc: list[tuple[float, float]]
    gyr: list[tuple[float, float]]
    low_pass: list[tuple[float, float, float, float, float]]

def mpu6050_decode(
    data: NDArray[np.uint8], afs_sel: int = 0, fs_sel: int = 0, temperature: bool = True
) -> tuple[_Array, _Array, _Array | None, NDArray[np.bool_], NDArray[np.bool_]]: ...
def mpu6050_facts() -> _Mpu6050: ...

# --- the wire protocol: docs/wire.md

class _WireAnnouncement(TypedDict):
    name: str
    tick: float
    columns: list[str]
    ranges: list[float]
    rates: list[float]

class _WireBatch(_WireAnnouncement):
    start: int
    stamps: NDArray[np.uint32]
    sequence: NDArray[np.uint16]
    lost: NDArray[np.uint32]
    feed: NDArray[np.uint64]
    values: _Array

class _LineBatch(TypedDict):
    columns: list[str]
    values: _Array
    lost: NDArray[np.uint32]

@final
class WireDecoder:
    def __new__(cls) -> WireDecoder: ...
    def feed(self, data: bytes) -> None: ...
    def interrupted(self) -> None: ...
    def finish(self) -> None: ...
    def take(self) -> list[_WireBatch]: ...
    def take_texts(self) -> list[str]: ...
    def announcement(self) -> _WireAnnouncement | None: ...
    def counts(self) -> dict[str, int]: ...

@final
class LineDecoder:
    def __new__(cls) -> LineDecoder: ...
    def feed(self, data: bytes) -> None: ...
    def interrupted(self) -> None: ...
    def finish(self) -> None: ...
    def take(self) -> list[_LineBatch]: ...
    def take_texts(self) -> list[str]: ...
    def counts(self) -> dict[str, int]: ...

@final
class WireEncoder:
    def __new__(
        cls,
        name: str,
        tick: int,
        streams: Sequence[tuple[float, str, bytes | list[int], list[tuple[str, float, float, float]]]],
        start: int,
    ) -> WireEncoder: ...
    def columns(self) -> list[str]: ...
    def announce(self) -> bytes: ...
    def text(self, text: str) -> bytes: ...
    def samples(self, stamps: NDArray[np.uint32], values: _Array) -> tuple[bytes, NDArray[np.uint64]]: ...

# --- filters

class _Setting(TypedDict):
    default: float
    unit: str
    meaning: str

class _Description(TypedDict):
    summary: str
    needs: list[str]
    settings: dict[str, _Setting]

@final
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
    def step(
        self, t: float, acc: _Numbers | None = None, gyr: _Numbers | None = None, mag: _Numbers | None = None
    ) -> _Array: ...
    @property
    def skipped(self) -> dict[str, int]: ...
    def reset(self) -> None: ...

def filter_trials(
    name: str,
    settings: Sequence[Mapping[str, float]],
    t: _Array,
    acc: _Array | None = None,
    gyr: _Array | None = None,
    mag: _Array | None = None,
    *,
    part: NDArray[np.uint8],
    parts: int,
    reference: _Array | None = None,
    horizon: float = 0.0,
    frame: str = "NED",
    gravity: float = 9.80665,
    mag_reference: Sequence[float] | None = None,
    rules: Mapping[str, float] | None = None,
    initial: Sequence[float] | None = None,
    start_time: float | None = None,
) -> _Array: ...
def smooth(
    t: _Array,
    acc: _Array | None = None,
    gyr: _Array | None = None,
    mag: _Array | None = None,
    *,
    frame: str = "NED",
    gravity: float = 9.80665,
    mag_reference: Sequence[float] | None = None,
    settings: Mapping[str, float] | None = None,
    rules: Mapping[str, float] | None = None,
    initial: Sequence[float] | None = None,
    start_time: float | None = None,
) -> tuple[_Array, dict[str, int]]: ...
def filter_descriptions() -> dict[str, _Description]: ...
def replay_rules() -> dict[str, _Setting]: ...
def tilt_angles(acc: _Array) -> _Array: ...
def kalman_steady_state(dt: float, settings: Mapping[str, float] | None = None) -> tuple[float, float, float]: ...

# --- model

@final
class Effect:
    @property
    def id(self) -> str: ...
    @property
    def sensors(self) -> list[str]: ...
    @property
    def column(self) -> str | None: ...
    @property
    def centred_columns(self) -> list[str]: ...
    @property
    def memory(self) -> float: ...
    @property
    def limits(self) -> list[tuple[float, float]]: ...
    @property
    def scope(self) -> Literal["sensor", "log"]: ...
    @property
    def of_shaking(self) -> bool: ...
    @property
    def reach(self) -> Literal["row", "reference", "neighbours", "history"]: ...
    @property
    def affine(self) -> Literal["offset", "scale", "matrix"] | None: ...
    @property
    def reference_part(
        self,
    ) -> Literal["mount", "level", "time", "bandwidth", "field", "drive", "heading", "noise"] | None: ...
    def fitted_along(self, facts: Facts) -> bool: ...
    @property
    def parameters(self) -> list[tuple[str, str, float | None]]: ...
    @property
    def least_levels(self) -> int: ...
    @property
    def strongly_curved(self) -> bool: ...
    @property
    def tried_at_full_size(self) -> bool: ...
    @property
    def jumps(self) -> bool: ...
    @property
    def only_searched(self) -> list[str]: ...
    @property
    def searched(self) -> list[str]: ...
    def search(self, facts: Facts, found: Sequence[float] | None = None, round: int = 0) -> list[list[float]]: ...
    @property
    def nonlinear(self) -> bool: ...
    @property
    def stage(self) -> str: ...
    @property
    def words(self) -> dict[str, str]: ...
    def cause(self, parameter: int, axis: int) -> str | None: ...
    def not_testable(self, facts: Facts) -> str | None: ...
    def check(self, chunk: _Chunk, facts: Facts, at: Sequence[float]) -> None: ...

@final
class Facts:
    @property
    def n(self) -> int: ...
    @property
    def margin(self) -> int: ...
    @property
    def t_start(self) -> float: ...
    @property
    def t_end(self) -> float: ...
    @property
    def dt(self) -> float: ...
    @property
    def field(self) -> list[float]: ...
    @property
    def steps(self) -> list[list[float]]: ...
    @property
    def field_estimated(self) -> bool: ...
    @property
    def temperature_mean(self) -> float: ...
    @property
    def has_temperature(self) -> bool: ...
    @property
    def sensors(self) -> list[str]: ...
    @property
    def covariate_means(self) -> dict[str, float]: ...
    @property
    def reference_packet(self) -> int: ...
    @property
    def attitude_smoothing(self) -> tuple[int, int]: ...
    @property
    def position_smoothing(self) -> tuple[int, int] | None: ...
    @property
    def reference_noise(self) -> tuple[float, float]: ...
    @property
    def ideal_noise(self) -> list[float]: ...
    @property
    def sensor_dt(self) -> list[float]: ...
    def with_ranges(self, acc: float | None = None, gyr: float | None = None) -> Facts: ...
    def with_bins_of(self, others: Sequence[Facts]) -> Facts: ...
    def with_means(
        self, temperature_mean: float | None = None, covariate_means: Mapping[str, float] | None = None
    ) -> Facts: ...

def built_in_effects() -> list[Effect]: ...
def unnamed_effects() -> list[Effect]: ...
def probes(facts: Facts) -> list[Effect]: ...
def find_effect(id: str) -> Effect | None: ...
def python_effect(
    id: str,
    sensor: str,
    parameters: Sequence[tuple[str, str, float | None, str]],
    words: dict[str, str],
    stage: str,
    needs: Sequence[str],
    traits: Mapping[str, str],
    memory: float,
    limits: Sequence[tuple[float, float]],
    function: Callable[..., object],
) -> Effect: ...

# --- correction: readings (n, 3) or None, and samples lost, for each of acc, gyr, mag

def correct_readings(
    chunk: _Chunk,
    effects: Sequence[tuple[Effect, Sequence[float]]],
    frame: str,
    covariates: Sequence[str],
    covariate_means: Sequence[float | None],
    temperature_mean: float | None = None,
) -> tuple[list[_Array | None], list[int]]: ...

# --- fit: nine channels, acc gyr mag by x y z

@final
class Survey:
    def __new__(
        cls,
        n: int,
        frame: str,
        gravity: float,
        mag_reference: Sequence[float] | None,
        covariates: Sequence[str],
        rig: tuple[int, Sequence[float]] | None = None,
    ) -> Survey: ...
    def add(self, chunk: _Chunk) -> None: ...
    def widths(self) -> tuple[list[float], list[float]]: ...
    def finish(self) -> Facts: ...

@final
class Profile:
    def __new__(
        cls,
        facts: Facts,
        effects: Sequence[tuple[Effect, Sequence[float]]],
        candidate: Effect,
        trials: Sequence[Sequence[float]],
    ) -> Profile: ...
    def add(self, chunk: _Chunk) -> None: ...
    def add_rests(self, rests: dict[str, Any]) -> None: ...

def furthest_trial(searches: Sequence[Profile]) -> float: ...
def best_trial(profiles: Sequence[Profile]) -> tuple[int, list[float], list[float], float, float, float] | None: ...

@final
class Evidence:
    def __new__(
        cls,
        facts: Facts,
        effects: Sequence[tuple[Effect, Sequence[float]]],
        candidates: Sequence[tuple[Effect, Sequence[float]]],
        blocks: int,
        filters: Sequence[Sequence[float]],
    ) -> Evidence: ...
    def add(self, chunk: _Chunk) -> None: ...
    def add_rests(self, rests: dict[str, Any]) -> None: ...
    def rest_scatter(self, rests: dict[str, Any]) -> list[float]: ...
    def merge(self, other: Evidence) -> None: ...
    def with_filters(self, filters: Sequence[Sequence[float]]) -> Evidence: ...
    def reference_variance(self, attitude: float, position: float) -> list[float]: ...
    @property
    def blocks(self) -> int: ...
    def count(self, channel: int) -> int: ...
    def active(self, channel: int) -> list[int]: ...
    def gram(self, channel: int, block: int | None = None) -> _Array | None: ...

@final
class PastProducts:
    def __new__(cls) -> PastProducts: ...
    def add(self, chunk: _Chunk, evidence: Evidence, step: _Numbers) -> None: ...
    def filters(self) -> list[list[float]]: ...

def evaluate(evidence: Evidence, chunk: _Chunk, step: _Numbers) -> list[_Array | None]: ...
def residual_against(value: _Array, residual: _Array, floor: float) -> tuple[_Array, _Array, _Array, float] | None: ...
def rests_tell(effect: Effect, facts: Facts, rests: dict[str, Any]) -> bool: ...
def facts_at_rest(
    rows: tuple[int, float, float, float],
    frame: str,
    gravity: float,
    field: float | None,
    sensors: Sequence[bool],
    covariates: Sequence[str],
    covariate_means: Sequence[float],
    temperature_mean: float | None,
    samples: Sequence[_Numbers],
) -> Facts: ...
def rest_channels() -> list[str]: ...

# --- inference: slots are effects in the order of the evidence

class _Estimate(TypedDict):
    parameters: list[int]
    step: _Array
    covariance: _Array
    fitted: list[bool]
    at_bound: list[bool]
    full_step: _Array
    held_out: float
    folds: _Array
    training: float
    samples: float
    misfit: float

@final
class Kind:
    ADEQUATE: ClassVar[Kind]
    MISSING: ClassVar[Kind]
    AMBIGUOUS: ClassVar[Kind]
    UNKNOWN: ClassVar[Kind]
    @property
    def word(self) -> Literal["adequate", "missing", "ambiguous", "unknown"]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __int__(self, /) -> int: ...

@final
class Status:
    SIGNIFICANT: ClassVar[Status]
    NOT_SIGNIFICANT: ClassVar[Status]
    NOT_TESTABLE: ClassVar[Status]
    TOO_LARGE: ClassVar[Status]
    OTHER_SIGN: ClassVar[Status]
    @property
    def words(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __int__(self, /) -> int: ...

@final
class Candidate:
    @property
    def slot(self) -> int: ...
    @property
    def status(self) -> Status: ...
    @property
    def ln_bayes(self) -> float: ...
    @property
    def probability(self) -> float: ...
    @property
    def parameters(self) -> list[tuple[float, float]]: ...
    @property
    def detectable(self) -> list[float]: ...
    @property
    def gain(self) -> float: ...
    @property
    def gain_error(self) -> float: ...
    @property
    def held_out_before(self) -> float: ...
    @property
    def held_out_after(self) -> float: ...

@final
class Finding:
    @property
    def channel(self) -> str: ...
    @property
    def covariate(self) -> str: ...
    @property
    def log(self) -> int | None: ...
    @property
    def ln_bayes(self) -> float: ...
    @property
    def drop(self) -> float: ...
    @property
    def channels(self) -> list[int]: ...
    @property
    def shape(self) -> str: ...
    @property
    def probe(self) -> int | None: ...

@final
class Disagreement:
    @property
    def slot(self) -> int: ...
    @property
    def log(self) -> int: ...
    @property
    def own(self) -> list[tuple[float, float]]: ...
    @property
    def others(self) -> list[tuple[float, float]]: ...
    @property
    def ln_bayes(self) -> float: ...
    @property
    def wild(self) -> bool: ...

@final
class Verdict:
    @property
    def kind(self) -> Kind: ...
    @property
    def best(self) -> int | None: ...
    @property
    def rivals(self) -> list[int]: ...
    @property
    def candidates(self) -> list[Candidate]: ...
    @property
    def correlations(self) -> list[tuple[int, int, float]]: ...
    @property
    def findings(self) -> list[Finding]: ...
    @property
    def disagreements(self) -> list[Disagreement]: ...
    @property
    def spoilt(self) -> bool: ...

class _ChannelResidual(TypedDict):
    channel: str
    index: int
    n: int
    rms: float
    mean: float
    block_rms: _Array
    stretch: tuple[int, int]

class _Panel(TypedDict):
    channel: str
    covariate: str
    unit: str
    edges: _Array
    mean: _Array
    band: _Array
    share: float

class _Residual(TypedDict):
    channels: list[_ChannelResidual]
    panels: list[_Panel]

@final
class Problem:
    NEAR: float
    ODDS: float
    def __new__(
        cls,
        logs: Sequence[
            tuple[Evidence, Evidence, Sequence[float], Sequence[Sequence[float]], Sequence[float], Sequence[int]]
        ],
        own: Sequence[bool],
        limits: Sequence[tuple[int, int, tuple[float, float] | None]] = ...,
    ) -> Problem: ...
    @property
    def blocks(self) -> int: ...
    def places(self, log: int) -> list[int]: ...
    def estimate(self, slots: Sequence[int]) -> _Estimate: ...
    def step_beside(self, model: Sequence[int], slot: int) -> tuple[list[int], _Array]: ...
    def diagnose(
        self,
        model: Sequence[int],
        candidates: Sequence[int],
        probes: Sequence[int] = ...,
        fitted: Sequence[Sequence[tuple[int, float]]] = ...,
        refuted: Sequence[int] = ...,
        column_noise: Sequence[tuple[int, float]] = ...,
        seen: Sequence[tuple[int | None, int, float, str]] = ...,
        again: Verdict | None = ...,
    ) -> Verdict: ...
    def ln_evidence(self, along: Sequence[int], members: Sequence[int], possible: Sequence[int]) -> float: ...
    def zero_noise(self, slots: Sequence[int]) -> list[tuple[int, int, float, float, float]]: ...
    def revisions(
        self, model: Sequence[int], members: Sequence[int], candidates: Sequence[int]
    ) -> list[tuple[int, int | None]]: ...
    @staticmethod
    def threshold(candidates: int) -> float: ...
    def needless(self, model: Sequence[int], members: Sequence[int]) -> int | None: ...
    def mean_squares(self, step: _Numbers, log: int = 0) -> dict[str, float]: ...
    def residual(self, step: _Numbers, log: int = 0) -> _Residual: ...

def saturate(evidence: Evidence) -> tuple[_Array, list[float], list[list[float]]]: ...

# --- calibration: sides are numbered +x -x +y -y +z -z; m/s^2, rad/s, rad

class _Pose(TypedDict):
    rows: tuple[int, int]
    time: tuple[float, float]
    knocks: list[tuple[int, int]]
    n: int
    mean: list[float]
    deviation: list[float]
    variance: list[float]
    rate: list[float] | None
    rate_variance: list[float] | None
    side: int
    label: int | None
    flaw: tuple[str, float] | None

class _Rests(TypedDict):
    poses: list[_Pose]
    acc_noise: float | None
    gyr_noise: float | None
    step: list[float | None]

class _Judgement(TypedDict):
    state: str
    side: int | None
    progress: float
    unrest: float
    open: bool
    closed: _Pose | None

class _Solution(TypedDict):
    matrix: list[list[float]]
    bias: list[float]
    scale: list[float]
    misalignment: list[list[float]]
    bias_error: list[float]
    scale_error: list[float]
    misalignment_error: list[list[float]]
    model_gain: list[list[float]]
    model_bias: list[float]
    model_gain_error: list[list[float]]
    model_bias_error: list[float]
    model_scale_temperature: list[float]
    model_bias_temperature: list[float]
    model_scale_temperature_error: list[float]
    model_bias_temperature_error: list[float]
    extra: list[float]
    extra_error: list[float]
    condition: float
    freedom: float
    excess: float
    residuals: _Array
    held_out: _Array
    held_out_length: _Array
    correlation: _Array

class _TurnSolution(_Solution):
    before: _Array
    as_read: _Array
    way: _Array

_Vector = Sequence[float]
_Span = tuple[int, int, _Vector, _Vector, _Vector, _Vector, float]

@final
class PoseJudge:
    def __new__(cls, settings: Mapping[str, float] | None = None) -> PoseJudge: ...
    def step(self, t: float, acc: _Numbers, gyr: _Numbers | None = None) -> _Judgement: ...
    def finish(self) -> _Pose | None: ...

def find_rests(
    t: _Array,
    acc: _Array,
    gyr: _Array | None = None,
    labels: _Array | None = None,
    settings: Mapping[str, float] | None = None,
) -> _Rests: ...
def vector_calibration(
    readings: _Array,
    variances: _Array,
    targets: _Array,
    gravity: float,
    tilt: _Array | None = None,
    temperature: _Array | None = None,
    scale_temperature: bool = False,
    leave_out: bool = True,
) -> _Solution: ...
def magnitude_calibration(
    readings: _Array,
    groups: _Array,
    length: float,
    variances: _Array | None = None,
    up: _Array | None = None,
    temperature: _Array | None = None,
    scale_temperature: bool = False,
    misalignment: bool = True,
    leave_out: bool = True,
) -> _Solution: ...
def turn_calibration(t: _Array, gyr: _Array, spans: Sequence[_Span], bias: _Numbers) -> _TurnSolution: ...
def table_attitudes(
    t: _Array,
    gyr: _Array,
    spans: Sequence[_Span | None],
    sides: _Array,
    matrix: Sequence[Sequence[float]],
) -> _Array | None: ...
def sphere(readings: _Array) -> tuple[list[float], float] | None: ...

# --- pyramid: columns thinned to pixels; times ascending s, NaN where a sample is missing, gaps as longest steps in s

_Points = tuple[_Array, _Array, _Array]
"""Times, smallest and largest values of the points, at most twice as many as pixels; NaN interrupts the line."""

@final
class Pyramid:
    def __new__(cls, gaps: Sequence[float], block: int = 128) -> Pyramid: ...
    def feed(self, t: _Array, values: list[_Array]) -> None: ...
    def lines(self, columns: Sequence[int], begin: float, end: float, pixels: int) -> list[_Points]: ...
    def rows_between(self, begin: float, end: float) -> tuple[int, int]: ...
    @property
    def rows(self) -> int: ...
    @property
    def span(self) -> tuple[float, float] | None: ...
    @property
    def bytes(self) -> int: ...

def thinned(t: _Array, values: _Array, gap: float, begin: float, end: float, pixels: int) -> _Points: ...
