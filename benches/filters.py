"""Rows per second of each filter, beside a plain numpy loop of the same filter in the same run.

Prints ratios (ours / numpy loop), which carry over to other machines, with rows per second for orientation.
Run: ``python benches/filters.py [ROWS]``.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from imufit import _imufit

G = 9.80665
Quaternion = np.ndarray


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    w, x, y, z = p
    a, b, c, d = q
    return np.array(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )


def exponential(r: np.ndarray) -> Quaternion:
    angle = np.sqrt(r @ r)
    return np.concatenate([[np.cos(angle / 2)], r * (np.sin(angle / 2) / angle if angle > 0 else 0.5)])


def matrix(q: Quaternion) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def gyro_loop(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, q: Quaternion) -> np.ndarray:
    out = np.empty((len(t), 4))
    out[0] = q
    for k in range(1, len(t)):
        q = product(q, exponential((gyr[k] + gyr[k - 1]) * 0.5 * (t[k] - t[k - 1])))
        out[k] = q / np.sqrt(q @ q)
    return out


def triad_loop(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, q: Quaternion) -> np.ndarray:
    """Matrices of the triads; up is -z, north is x, as in NED."""
    out = np.empty((len(t), 3, 3))
    reference = np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]], float)  # up, up x north, their cross product
    for k in range(len(t)):
        t1 = acc[k] / np.sqrt(acc[k] @ acc[k])
        across = cross(t1, mag[k])
        t2 = across / np.sqrt(across @ across)
        out[k] = reference.T @ np.array([t1, t2, cross(t1, t2)])
    return out


def mahony_loop(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, q: Quaternion) -> np.ndarray:
    out, bias = np.empty((len(t), 4)), np.zeros(3)
    out[0] = q
    up, north, k_p, k_i = np.array([0, 0, -1.0]), np.array([1.0, 0, 0]), 0.5, 0.005
    for k in range(1, len(t)):
        dt = t[k] - t[k - 1]
        q = product(q, exponential(((gyr[k] + gyr[k - 1]) * 0.5 - bias) * dt))
        r = matrix(q)
        m = r @ mag[k]
        m[2] = 0.0
        w_mes = cross(acc[k] / np.sqrt(acc[k] @ acc[k]), r.T @ up) * 0.5
        w_mes += r.T @ cross(m / np.sqrt(m @ m), north) * 0.5
        bias = bias - 0.5 * k_i * dt * w_mes
        q = product(q, exponential(k_p * dt * w_mes))
        q = q / np.sqrt(q @ q)
        out[k] = q
    return out


LOOPS: dict[str, Callable[..., np.ndarray]] = {"gyro": gyro_loop, "triad": triad_loop, "mahony": mahony_loop}


def seconds(run: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def main(rows: int) -> None:
    rng = np.random.default_rng(0)
    t = 0.005 * np.arange(rows)
    gyr = 0.5 * np.sin(np.outer(t, [1.0, 1.3, 0.7])) + rng.normal(0, 0.01, (rows, 3))
    start = np.array([1.0, 0, 0, 0])
    q, _ = _imufit.Filter("gyro", initial=start.tolist()).run(t, gyr=gyr)
    acc = _imufit.rotate_back(q, np.tile([0, 0, -G], (rows, 1))) + rng.normal(0, 0.05, (rows, 3))
    mag = _imufit.rotate_back(q, np.tile([20.0, 0, 44.0], (rows, 1))) + rng.normal(0, 0.3, (rows, 3))
    few = min(rows, 20_000)
    print(f"{rows} rows; numpy loop over {few}")
    print(f"{'filter':<14}{'rows/s':>12}{'numpy rows/s':>14}{'ratio':>8}{'largest difference, rad':>26}")
    for name in _imufit.filter_descriptions():
        made = _imufit.Filter(name, initial=start.tolist())
        ours = rows / seconds(lambda made=made: (made.reset(), made.run(t, acc, gyr, mag)), 5)
        loop = LOOPS.get(name)
        if loop is None:
            print(f"{name:<14}{ours:>12.3g}{'-':>14}{'-':>8}{'-':>26}")
            continue
        part = [column[:few] for column in (t, acc, gyr, mag)]
        theirs = few / seconds(lambda loop=loop, part=part: loop(*part, start), 2)
        made.reset()
        found, expected = made.run(*part)[0], loop(*part, start)
        if expected.ndim == 3:
            expected = _imufit.quaternion_from_matrix_rows(np.ascontiguousarray(expected.reshape(-1, 9)))
        difference = _imufit.attitude_errors(found, np.ascontiguousarray(expected))[:, 0].max()
        print(f"{name:<14}{ours:>12.3g}{theirs:>14.3g}{ours / theirs:>8.0f}{difference:>26.1e}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
