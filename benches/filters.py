"""Rows per second of each filter, beside a plain numpy loop of the same filter in the same run.

Prints ratios (ours / the other), which carry over to other machines, with rows per second for orientation. Then paper
B's filters on one axis: eq. (5) as `scipy.signal.lfilter`, angle and bias as filterpy's `KalmanFilter`. Those give one
angle, ours the whole attitude, and `lfilter` has the accelerometer's angle computed for it. Then every filter beside
vqf, qmt, imufusion and ahrs, and beside a plain C loop of Mahony's filter that is compiled on the spot (`mahony.c`):
what the machine can do. Last, rows fed one by one from Python, and logs replayed on several threads.
Run: ``python benches/filters.py [ROWS]``.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from filterpy.kalman import KalmanFilter
from imufit import Log, _imufit, filters
from imufit.replaying import Stream, replay_many
from peers import MISSING, PEERS, CLoop
from scipy.signal import lfilter

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


def correction(q: Quaternion, f: np.ndarray) -> np.ndarray:
    """Rotation vector that brings `f`, as seen from `q`, to the vertical of NED."""
    seen = matrix(q) @ f
    across = np.array([-seen[1], seen[0], 0.0])  # seen x up
    sine = np.sqrt(across @ across)
    return across * (np.arctan2(sine, -seen[2]) / sine if sine > 0 else 0.0)


def accel_loop(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, q: Quaternion) -> np.ndarray:
    """Eqs. (1) and (2) of paper B, in all quadrants, with the yaw of the start: 0."""
    out = np.empty((len(t), 4))
    for k in range(len(t)):
        x, y, z = -acc[k]
        roll, pitch = np.arctan2(y, z) / 2, np.arctan2(-x, np.sqrt(y * y + z * z)) / 2
        about_x = np.array([np.cos(roll), np.sin(roll), 0.0, 0.0])
        out[k] = product(np.array([np.cos(pitch), 0.0, np.sin(pitch), 0.0]), about_x)
    return out


def complementary_loop(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, q: Quaternion) -> np.ndarray:
    """Eq. (5) of paper B on attitudes."""
    out = np.empty((len(t), 4))
    out[0] = q
    for k in range(1, len(t)):
        dt = t[k] - t[k - 1]
        q = product(q, exponential((gyr[k] + gyr[k - 1]) * 0.5 * dt))
        q = product(exponential(correction(q, acc[k]) * (1.0 - 0.97 ** (dt / 0.01))), q)
        q = q / np.sqrt(q @ q)
        out[k] = q
    return out


GYR_NOISE, BIAS_WALK, ACC_NOISE, ANGLE_START, BIAS_START = 1e-3, 1e-5, 5e-3, 0.1, 0.02


def kalman_loop(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, q: Quaternion) -> np.ndarray:
    """Angle and gyro bias on attitudes, one covariance for both horizontal axes."""
    out, bias = np.empty((len(t), 4)), np.zeros(3)
    p = np.diag([ANGLE_START**2, BIAS_START**2])
    out[0] = q
    for k in range(1, len(t)):
        dt = t[k] - t[k - 1]
        q = product(q, exponential(((gyr[k] + gyr[k - 1]) * 0.5 - bias) * dt))
        f = np.array([[1.0, -dt], [0.0, 1.0]])
        p = f @ p @ f.T + np.array([[GYR_NOISE**2 * dt, 0.0], [0.0, BIAS_WALK**2 * dt]])
        gain = p[:, 0] / (p[0, 0] + ACC_NOISE**2 / dt)
        p = p - np.outer(gain, p[0])
        innovation = correction(q, acc[k])
        bias = bias + gain[1] * (matrix(q).T @ innovation)
        q = product(exponential(gain[0] * innovation), q)
        q = q / np.sqrt(q @ q)
        out[k] = q
    return out


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


LOOPS: dict[str, Callable[..., np.ndarray]] = {
    "accel": accel_loop,
    "gyro": gyro_loop,
    "complementary": complementary_loop,
    "kalman": kalman_loop,
    "triad": triad_loop,
    "mahony": mahony_loop,
}


METHODS: tuple[tuple[str, str, dict[str, float]], ...] = (
    *((name, name, {}) for name in _imufit.filter_descriptions()),
    ("hybrid, seeded", "hybrid", {"driven": 0.0}),
    ("kalman, adaptive", "kalman", {"adaptive": 1.0}),
    ("kalman, steady", "kalman", {"steady": 1.0}),
)


def complementary_by_scipy(rate: np.ndarray, tilt: np.ndarray, dt: float) -> np.ndarray:
    a = 0.97
    drive = a * 0.5 * (rate[1:] + rate[:-1]) * dt + (1.0 - a) * tilt[1:]
    return np.concatenate([tilt[:1], lfilter([1.0], [1.0, -a], drive, zi=[a * tilt[0]])[0]])


def kalman_by_filterpy(rate: np.ndarray, tilt: np.ndarray, dt: float) -> np.ndarray:
    made = KalmanFilter(dim_x=2, dim_z=1, dim_u=1)
    made.x, made.P = np.array([[tilt[0]], [0.0]]), np.diag([ANGLE_START**2, BIAS_START**2])
    made.F, made.B, made.H = np.array([[1.0, -dt], [0.0, 1.0]]), np.array([[dt], [0.0]]), np.array([[1.0, 0.0]])
    made.Q, made.R = np.diag([GYR_NOISE**2, BIAS_WALK**2]) * dt, np.array([[ACC_NOISE**2 / dt]])
    out = np.empty(len(tilt))
    out[0] = tilt[0]
    for k in range(1, len(tilt)):
        made.predict(u=np.array([[0.5 * (rate[k] + rate[k - 1])]]))
        made.update(tilt[k])
        out[k] = made.x[0, 0]
    return out


ONE_AXIS: tuple[tuple[str, dict[str, float], str, Callable[..., np.ndarray], bool], ...] = (
    ("complementary", {"a": 0.97, "step": 0.0}, "scipy lfilter", complementary_by_scipy, True),
    ("kalman", {}, "filterpy", kalman_by_filterpy, False),
)


def one_axis(rows: int, few: int) -> None:
    """Paper B's angle: about y, equal steps."""
    rng, dt = np.random.default_rng(1), 0.005
    t = dt * np.arange(rows)
    true = 0.1 * np.sin(0.7 * t)
    rate = 0.07 * np.cos(0.7 * t) + rng.normal(0.01, 0.01, rows)
    tilt = true + rng.normal(0, 0.005, rows)
    acc = G * np.column_stack([-np.sin(tilt), np.zeros(rows), np.cos(tilt)])
    gyr = np.column_stack([np.zeros(rows), rate, np.zeros(rows)])
    print("\none axis")
    print(f"{'filter':<22}{'rows/s':>12}  {'beside':<16}{'rows/s':>10}{'ratio':>9}{'largest difference, rad':>26}")
    for name, settings, other, run, whole in ONE_AXIS:
        made = _imufit.Filter(name, frame="ENU", settings=settings)
        ours = rows / seconds(lambda made=made: (made.reset(), made.run(t, acc, gyr)), 5)
        n = rows if whole else few
        theirs = n / seconds(lambda run=run, n=n: run(rate[:n], tilt[:n], dt), 3)
        made.reset()
        found = _imufit.rotation_vector_from_quaternion(made.run(t[:n], acc[:n], gyr[:n])[0])[:, 1]
        difference = np.abs(found - run(rate[:n], tilt[:n], dt)).max()
        print(f"{name:<22}{ours:>12.3g}  {other:<16}{theirs:>10.3g}{ours / theirs:>9.2g}{difference:>26.1e}")


def beside_others(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, start: np.ndarray) -> None:
    """Time of one core; all take their turns, the best of each counts."""
    rows, dt, gains = len(t), float(t[1] - t[0]), np.array([1.0, 1.0, 0.005, 0.5])
    loop, made = CLoop(), {label: _imufit.Filter(name, initial=start.tolist(), settings=settings)
                           for label, name, settings in METHODS}  # fmt: skip
    runs: dict[str, tuple[Callable[[], object], int]] = {
        f"C, {form}": (lambda form=form: loop.run(form, t, gyr, acc, mag, gains, start), rows) for form in loop.FORMS
    }
    for label, one in made.items():
        runs[f"imufit {label}"] = (lambda one=one: (one.reset(), one.run(t, acc, gyr, mag)), rows)
    for label, peer in PEERS.items():
        n = min(rows, peer.rows)
        runs[label] = (lambda run=peer.run, n=n: run(dt, gyr[:n], acc[:n], mag[:n]), n)
    best = dict.fromkeys(runs, np.inf)
    for _ in range(5):
        for label, (run, n) in runs.items():
            before = time.process_time()
            run()
            best[label] = min(best[label], (time.process_time() - before) / n)
    for line in MISSING:
        print(line, file=sys.stderr)
    limit = best["C, first_order"]
    print(f"\nnine axes, {rows} rows, one core\n{'filter':<28}{'million rows/s':>16}{'of the C loop':>16}")
    for label, each in sorted(best.items(), key=lambda item: item[1]):
        print(f"{label:<28}{1e-6 / each:>16.4g}{limit / each:>16.3f}")
    exact, ours = loop.run("exact", t, gyr, acc, mag, gains, start), made["mahony"]
    ours.reset()
    apart = _imufit.attitude_errors(ours.run(t, acc, gyr, mag)[0], exact)[:, 0].max()
    print(f"imufit mahony and C, exact: largest difference {apart:.1e} rad")


def objects(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, mag: np.ndarray, start: np.ndarray) -> None:
    """`imufit.filters` beside the compiled filters that they call; both take their turns, the best of each counts."""
    print(f"\n{'object':<22}{'rows/s':>12}{'compiled rows/s':>17}{'ratio':>8}")
    for name, kind in filters.ALL.items():
        made, core = kind(initial=start), _imufit.Filter(name, initial=start.tolist())
        runs = (
            lambda made=made: (made.reset(), made.run(gyr, acc, mag, t)),
            lambda core=core: (core.reset(), core.run(t, acc, gyr, mag)),
        )
        best = [np.inf, np.inf]
        for _ in range(9):
            for k, run in enumerate(runs):
                before = time.process_time()
                run()
                best[k] = min(best[k], time.process_time() - before)
        ours, compiled = (len(t) / each for each in best)
        print(f"{kind.__name__:<22}{ours:>12.3g}{compiled:>17.3g}{ours / compiled:>8.3f}")


def live_and_many(t: np.ndarray, acc: np.ndarray, gyr: np.ndarray) -> None:
    names = ("accel", "gyro", "complementary", "kalman")
    few = 20_000

    def fed() -> None:
        live = Stream(names)
        for row in zip(t[:few].tolist(), acc[:few], gyr[:few], strict=True):
            live.step(*row)

    print(f"\nrow by row from Python, {len(names)} filters at once: {few / seconds(fed, 3):.3g} rows/s")
    logs = [Log.from_arrays(t[:200_000], acc=acc[:200_000], gyr=gyr[:200_000]) for _ in range(8)]
    one, two = (seconds(lambda n=n: replay_many(logs, names, threads=n), 3) for n in (1, 2))
    print(f"8 logs of {logs[0].n} rows, {len(names)} filters: two threads {one / two:.2f} times as fast as one")


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
    print(f"{'filter':<22}{'rows/s':>12}{'numpy rows/s':>14}{'ratio':>8}{'largest difference, rad':>26}")
    for label, name, settings in METHODS:
        made = _imufit.Filter(name, initial=start.tolist(), settings=settings)
        ours = rows / seconds(lambda made=made: (made.reset(), made.run(t, acc, gyr, mag)), 5)
        loop = LOOPS.get(label)
        if loop is None:
            print(f"{label:<22}{ours:>12.3g}{'-':>14}{'-':>8}{'-':>26}")
            continue
        part = [column[:few] for column in (t, acc, gyr, mag)]
        theirs = few / seconds(lambda loop=loop, part=part: loop(*part, start), 2)
        made.reset()
        found, expected = made.run(*part)[0], loop(*part, start)
        if expected.ndim == 3:
            expected = _imufit.quaternion_from_matrix_rows(np.ascontiguousarray(expected.reshape(-1, 9)))
        difference = _imufit.attitude_errors(found, np.ascontiguousarray(expected))[:, 0].max()
        print(f"{label:<22}{ours:>12.3g}{theirs:>14.3g}{ours / theirs:>8.0f}{difference:>26.1e}")
    one_axis(rows, few)
    beside_others(t, acc, gyr, mag, start)
    objects(t, acc, gyr, mag, start)
    live_and_many(t, acc, gyr)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
