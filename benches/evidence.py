"""Evidence of a nine-axis log for seventy parameters, beside the same least squares in numpy, on one core.

numpy gets the ideal readings for free, builds the design matrix of the same effects on all nine channels and solves it,
once with `numpy.linalg.lstsq`, once by normal equations, and once by normal equations of each channel's own columns.
Ours works out the ideal readings too, and keeps the sums of every block of time and of every bin of every covariate,
from which come held-out errors, ranks and standard errors.

Then the peak memory of evidence streamed from a Parquet file, as the file grows tenfold.

Prints ratios, which carry over to other machines, with seconds and samples per second for orientation.
Run: ``python benches/evidence.py [ROWS]``.
"""
# ruff: noqa: E402

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[name] = "1"

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from imufit import Log, LogStream, _imufit
from imufit.fitting.passes import BLOCKS, CHANNELS, Passes, chunk_arrays
from imufit.fitting.surveyed_log import SurveyedLog
from imufit.lab import simulate
from imufit.progress import silent

AXES = range(3)
NAMED = (
    *(f"{s}.{name}" for s in ("acc", "gyr") for name in ("bias", "scale", "misalignment", "bias_temperature")),
    "acc.column:motor_current",
    "gyr.column:motor_current",
    "mag.current",
    "acc.lever_arm",
    "gyr.g_sensitivity",
    "mag.hard_iron",
    "mag.soft_iron",
    "mag.field_reference",
    "ref.alignment",
    "ref.delay",
)
"""Effects whose columns numpy is given as well."""
Ideal = dict[str, np.ndarray]
Column = dict[int, np.ndarray]


def asked(candidates: dict[str, _imufit.Effect]) -> list[tuple[_imufit.Effect, list[float]]]:
    """Candidates that numpy has too, with the values that their columns are taken for: none of anything."""
    return [(candidates[name], [0.0] * len(candidates[name].parameters)) for name in NAMED]


def log_of(rows: int) -> Log:
    """Nine axes, temperature and one covariate at 100 Hz."""
    return simulate.simulate("handheld", {"gyr.bias": None}, 1, rows / 100.0, covariates=("motor_current",)).to_log()


def ideal_of(sim: simulate.Simulation) -> Ideal:
    """Ideal readings and what the effects need of the motion, exact, for numpy."""
    motion = sim.trajectory.at(sim.t)
    down = np.array([0.0, 0.0, 9.80665])
    f = motion.specific_force(down)
    m = motion.flux_density(np.array(sim.metadata["mag_reference"]))
    h = 1e-4
    later, before = sim.trajectory.at(sim.t + h), sim.trajectory.at(sim.t - h)
    f_rate = (later.specific_force(down) - before.specific_force(down)) / (2 * h)
    return {
        "f": f, "m": m, "omega": motion.omega, "alpha": motion.alpha, "f_rate": f_rate,
        "m_rate": -np.cross(motion.omega, m), "rotation": motion.rotation,
    }  # fmt: skip


def columns_of(sim: simulate.Simulation, x: Ideal) -> list[Column]:
    """Columns of the whole catalogue and of the log's own column: by channel, (n,) each, where they are not zero."""
    n, columns = sim.t.size, []
    slot = {"acc": 0, "gyr": 3, "mag": 6}
    put = columns.append

    warm = sim.temp - sim.temp.mean()
    current = sim.covariates["motor_current"] - sim.covariates["motor_current"].mean()
    one = np.ones(n)
    readings = {"acc": x["f"], "gyr": x["omega"], "mag": x["m"]}
    rates = {"acc": x["f_rate"], "gyr": x["alpha"], "mag": x["m_rate"]}
    for s in ("acc", "gyr"):
        for a in AXES:
            put({slot[s] + a: one})
            put({slot[s] + a: readings[s][:, a]})
            put({slot[s] + a: warm})
            for b in AXES:
                if a != b:
                    put({slot[s] + a: readings[s][:, b]})
    for a in AXES:
        unit = np.eye(3)[a]
        arm = np.cross(x["omega"], np.cross(x["omega"], unit)) + np.cross(x["alpha"], unit)
        put(dict(enumerate(arm.T)))
        put({6 + a: one})
        put({6 + b: x["rotation"][:, a, b] for b in AXES})
        turned = {s: np.cross(readings[s], unit) for s in slot}
        put({slot[s] + b: turned[s][:, b] for s in slot for b in AXES})
        for b in AXES:
            put({3 + a: x["f"][:, b]})
            put({6 + a: x["m"][:, b]})
        for first in slot.values():
            put({first + a: current})
    put({slot[s] + b: rates[s][:, b] for s in slot for b in AXES})
    return columns


def noise_of(sim: simulate.Simulation) -> np.ndarray:
    """Noise of the nine channels."""
    return np.repeat([sim.metadata["noise"][s] for s in ("acc", "gyr", "mag")], 3)


def residual_of(sim: simulate.Simulation, x: Ideal) -> np.ndarray:
    """Measured less ideal (9, n), in units of the noise."""
    return (
        np.concatenate([(sim.acc - x["f"]).T, (sim.gyr - x["omega"]).T, (sim.mag - x["m"]).T]) / noise_of(sim)[:, None]
    )


def weighted(sim: simulate.Simulation, x: Ideal) -> tuple[np.ndarray, np.ndarray]:
    """Dense design matrix (9 n, p) and residual in units of the noise."""
    columns, noise = columns_of(sim, x), noise_of(sim)
    matrix = np.zeros((9, sim.t.size, len(columns)))
    for j, column in enumerate(columns):
        for channel, values in column.items():
            matrix[channel, :, j] = values / noise[channel]
    return matrix.reshape(-1, len(columns)), residual_of(sim, x).ravel()


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Best of some runs."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best


def ours(log: Log) -> tuple[Callable[[], _imufit.Evidence], float, int]:
    """A call that takes the evidence; how long the survey before it took; how many parameters there are."""
    passes = Passes(log, silent)
    start = time.perf_counter()
    facts, coverage = passes.survey()
    survey = time.perf_counter() - start
    candidates = SurveyedLog.of(passes, facts, coverage).effects

    def take() -> _imufit.Evidence:
        evidence = _imufit.Evidence(facts, [], asked(candidates), BLOCKS, [[] for _ in CHANNELS])
        for chunk in log.chunks(65536, facts.margin):
            evidence.add(chunk_arrays(chunk, passes.covariates))
        return evidence

    return take, survey, sum(len(candidates[name].parameters) for name in NAMED)


def by_channel(sim: simulate.Simulation, x: Ideal) -> np.ndarray:
    """Gram matrix of the same problem from the columns that each channel really has: numpy at its best."""
    columns, noise, residual = columns_of(sim, x), noise_of(sim), residual_of(sim, x)
    p = len(columns)
    gram = np.zeros((p + 1, p + 1))
    for channel in range(9):
        used = [j for j in range(p) if channel in columns[j]]
        block = np.stack([*(columns[j][channel] / noise[channel] for j in used), residual[channel]])
        gram[np.ix_([*used, p], [*used, p])] += block @ block.T
    return gram


def same_problem(
    evidence: _imufit.Evidence, sim: simulate.Simulation, matrix: np.ndarray, residual: np.ndarray
) -> None:
    """Stop if the best fit of all effects leaves another residual with numpy than with ours."""
    solution = np.linalg.lstsq(matrix, residual, rcond=None)[0]
    left = (residual - matrix @ solution).reshape(9, -1).std(axis=1)
    _, variance = _imufit.saturate(evidence)
    worst = np.max(np.abs(left / (np.sqrt(variance) / noise_of(sim)) - 1.0))
    if worst > 1e-3:
        raise SystemExit(f"residuals differ by {worst:.1e}: not the same problem any more")
    print(f"the same residual is left in every channel, to {worst:.0e}")


def speed(rows: int) -> None:
    sim = simulate.simulate("handheld", {"gyr.bias": None}, 1, rows / 100.0, covariates=("motor_current",))
    log, x = sim.to_log(), ideal_of(sim)
    take, survey, parameters = ours(log)
    mine = seconds(take)
    build = seconds(lambda: weighted(sim, x), 1)
    matrix, residual = weighted(sim, x)
    if matrix.shape[1] != parameters:
        raise SystemExit(f"numpy has {matrix.shape[1]} columns and ours {parameters}: not the same problem any more")
    normal = seconds(lambda: np.linalg.lstsq(matrix.T @ matrix, matrix.T @ residual, rcond=None), 2)
    dense = seconds(lambda: np.linalg.lstsq(matrix, residual, rcond=None), 1)
    sparse = seconds(lambda: by_channel(sim, x), 1)
    same_problem(take(), sim, matrix, residual)
    samples = 9 * rows
    print(f"{rows} rows, nine channels, {parameters} parameters, one core")
    print(f"{'':34}{'s':>9}{'samples/s':>13}{'numpy/ours':>12}")
    for name, time_taken in (
        ("evidence (ours)", mine),
        ("evidence with the survey (ours)", mine + survey),
        ("numpy: build + lstsq", build + dense),
        ("numpy: build + normal equations", build + normal),
        ("numpy: channel by channel", sparse),
        ("numpy: build alone", build),
    ):
        print(f"{name:34}{time_taken:9.3f}{samples / time_taken:13.3g}{time_taken / mine:12.1f}")
    print(f"numpy's design matrix: {matrix.nbytes / 2**20:.0f} MiB")


def peak(path: Path) -> float:
    """Peak memory (MiB) of a process that takes the evidence of a file chunk by chunk."""
    run = subprocess.run([sys.executable, __file__, "--stream", str(path)], capture_output=True, text=True, check=True)
    return float(run.stdout)


def stream(path: Path) -> None:
    log = LogStream(path)
    passes = Passes(log, silent)
    facts, coverage = passes.survey()
    candidates = SurveyedLog.of(passes, facts, coverage).effects
    evidence = _imufit.Evidence(facts, [], asked(candidates), BLOCKS, [[] for _ in CHANNELS])
    passes.evidence(evidence, facts, "")
    status = Path("/proc/self/status").read_text(encoding="ascii")
    print(int(status.split("VmHWM:")[1].split()[0]) / 1024)


def memory(rows: int) -> None:
    print("peak memory of streamed evidence")
    with tempfile.TemporaryDirectory() as folder:
        peaks = []
        for n in (rows, 10 * rows):
            path = Path(folder) / f"{n}.parquet"
            write_long(path, n, rows)
            peaks.append(peak(path))
            print(f"{n:9d} rows, {path.stat().st_size / 2**20:6.1f} MiB on disk: {peaks[-1]:7.0f} MiB")
    print(f"ten times the log: {peaks[1] / peaks[0]:.2f} times the memory")


def write_long(path: Path, rows: int, piece: int) -> None:
    """Write a log of `rows` rows that repeats the same `piece` rows."""
    part = log_of(piece)
    part.write(path)
    if rows == piece:
        return
    table = pq.read_table(path)
    t = table.column("t").to_numpy()
    length = t[-1] - t[0] + 0.01
    with pq.ParquetWriter(path, table.schema) as writer:
        for k in range(rows // piece):
            writer.write_table(table.set_column(table.column_names.index("t"), "t", pa.array(t + k * length)))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--stream"]:
        stream(Path(sys.argv[2]))
    elif Path("/proc/self/status").exists():
        size = int(sys.argv[1]) if len(sys.argv) > 1 else 60_000
        speed(size)
        memory(2 * size)
    else:
        speed(int(sys.argv[1]) if len(sys.argv) > 1 else 60_000)
