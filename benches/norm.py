"""How far the norm of a filter's quaternion strays from one in 1e8 steps.

Run: ``python benches/norm.py [STEPS]``.
"""

import sys
import time

import numpy as np
from imufit import _imufit

PIECE = 1_000_000
CASES: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("gyro", "gyro", {}),
    ("mahony", "mahony", {}),
    ("hybrid, driven", "hybrid", {"driven": 1.0}),
    ("hybrid, seeded", "hybrid", {"driven": 0.0}),
    ("complementary", "complementary", {}),
    ("kalman", "kalman", {}),
    ("mekf", "mekf", {}),
)


def main(steps: int) -> None:
    rng = np.random.default_rng(0)
    t = 0.005 * np.arange(1, PIECE + 1)
    gyr = 3.0 * np.sin(np.outer(t, [1.0, 1.3, 0.7])) + rng.normal(0.0, 0.1, (PIECE, 3))
    acc, mag = rng.normal(0.0, 10.0, (PIECE, 3)), rng.normal(0.0, 40.0, (PIECE, 3))
    print(f"{'filter':<18}{'steps':>12}{'largest | |q| - 1 |':>22}{'s':>8}")
    for label, name, settings in CASES:
        made, worst, start = _imufit.Filter(name, settings=settings), 0.0, time.perf_counter()
        for piece in range(max(1, steps // PIECE)):
            q, _ = made.run(t + piece * t[-1], acc, gyr, mag)
            worst = max(worst, float(np.abs(np.sqrt(np.einsum("ij,ij->i", q, q)) - 1.0).max()))
        print(f"{label:<18}{piece * PIECE + PIECE:>12}{worst:>22.1e}{time.perf_counter() - start:>8.1f}")


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 100_000_000)
