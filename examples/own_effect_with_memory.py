"""Effects that look back, with a parameter that they are not linear in: thermal lag and thermal hysteresis.

Run the file as it is, or hand it to the command line with a log of your own:

    python examples/own_effect_with_memory.py
    imufit diagnose LOG --effects-from examples/own_effect_with_memory.py
"""

from dataclasses import replace

import imufit
import numpy as np
from scipy.signal import lfilter

K = "rad/s/K"
COEFFICIENTS = {"x": 1e-3, "y": 1e-3, "z": 1e-3}


@imufit.effect(
    "gyr.die",
    parameters={"x": K, "y": K, "z": K, "tau": "s"},
    typical=COEFFICIENTS,
    search={"tau": (0.5, 40.0)},
    memory="2 min",
    needs=["temp"],
    explanation="the zero follows the die, which is warmer or colder than the thermometer beside it for a while",
)
def die(w: imufit.Window, x: float, y: float, z: float, tau: float) -> np.ndarray:
    """Return what the die's temperature adds: (n, 3), rad/s. The die is a first-order low-pass of the thermometer."""
    kept = np.exp(-w.dt / tau)
    inside, _ = lfilter([1.0 - kept], [1.0, -kept], w.temperature, zi=[kept * w.temperature[0]])
    return np.outer(inside, [x, y, z])


@imufit.effect(
    "gyr.sticking",
    parameters={"x": K, "y": K, "z": K, "width": "K"},
    typical=COEFFICIENTS,
    search={"width": (0.1, 10.0)},
    memory="log",
    needs=["temp"],
    explanation="the package sticks to the board and slips only once the stress of warming is large enough",
)
def sticking(w: imufit.Window, x: float, y: float, z: float, width: float) -> np.ndarray:
    """Return what the zero adds that follows the temperature with play: (n, 3), rad/s."""
    follows, at = [], w.temperature[0]
    for now in w.temperature.tolist():
        at = min(max(at, now - 0.5 * width), now + 0.5 * width)
        follows.append(at)
    return np.outer(follows, [x, y, z])


def recorded(seed: int) -> tuple[imufit.Log, np.ndarray]:
    """Record a hand-held sensor that a heater warms at random; and the temperature of its case, (n,), degC."""
    log = imufit.simulate("handheld", {}, seed=seed, duration=150.0).to_log()
    rng = np.random.default_rng(seed)
    heater = np.repeat(rng.uniform(-0.6, 0.6, log.n // 700 + 1), 700)
    case = np.full(log.n, 30.0)
    for i in range(1, log.n):
        case[i] = case[i - 1] + (heater[i] - (case[i - 1] - 30.0) / 20.0) * (log.t[i] - log.t[i - 1])
    return replace(log, temp=case + 0.002 * rng.standard_normal(log.n)), case


def lagging(log: imufit.Log, case: np.ndarray) -> imufit.Log:
    """Heat flows from the case into the die: 0.08 J/K through 75 K/W, hence 6 s."""
    inside = case.copy()
    for i in range(1, log.n):
        heat = (case[i - 1] - inside[i - 1]) / 75.0
        inside[i] = inside[i - 1] + heat / 0.08 * (log.t[i] - log.t[i - 1])
    return replace(log, gyr=log.gyr + np.outer(inside - 30.0, [8e-4, -5e-4, 3e-4]))


def slipping(log: imufit.Log, case: np.ndarray) -> imufit.Log:
    """Drag the package by a spring of 3 N/K against a friction of 3 N: it stays behind by up to 1 K to either side."""
    package = case.copy()
    for i in range(1, log.n):
        pull = 3.0 * (case[i] - package[i - 1])
        slip = np.sign(pull) * max(abs(pull) - 3.0, 0.0) / 3.0
        package[i] = package[i - 1] + slip
    return replace(log, gyr=log.gyr + np.outer(package - 30.0, [8e-4, -5e-4, 3e-4]))


if __name__ == "__main__":
    for happens, function in ((lagging, die), (slipping, sticking)):
        log = happens(*recorded(seed=11))
        fit = imufit.fit(log, ["gyr.bias"])
        answer = fit.diagnose()
        print(answer.verdict, answer.best)
        added = fit.add(function)
        print(f"held-out error {added.before:.2f} -> {added.after:.2f}")
        print(*added.parameters, sep="\n")
