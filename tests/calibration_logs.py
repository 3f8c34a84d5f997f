"""Logs of a sensor that is laid on its sides and turned, from the motion itself: arrays for ``Log.from_arrays``.

Shares no code with what it judges. The reference frame is north, west, up; the sensor turns about itself, so that the
specific force is gravity's reaction alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

GRAVITY = 9.80665
SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
UP = {side: np.eye(3)[k // 2] * (1 - 2 * (k % 2)) for k, side in enumerate(SIDES)}
FIELD = np.array([18.0, 0.0, -44.0])
"""uT, north, west, up: it dips by 67.8 deg."""


def exp(v: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors (..., 3) (Rodrigues)."""
    v = np.asarray(v, float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    cross = np.zeros((*v.shape[:-1], 3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    cross -= np.swapaxes(cross, -1, -2).copy()
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * cross @ cross


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Shortest rotation vector that takes the unit vector `a` to `b`."""
    axis = np.cross(a, b)
    if np.linalg.norm(axis) < 1e-9:
        axis = np.cross(a, [0.3, 0.5, 0.7])
    return axis / np.linalg.norm(axis) * np.arccos(np.clip(a @ b, -1.0, 1.0))


def quaternions(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4), scalar first, of rotation matrices: the eigenvector of largest eigenvalue."""
    m = rotations
    k = np.empty((len(m), 4, 4))
    k[:, 0, 0] = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    k[:, 0, 1] = k[:, 1, 0] = m[:, 2, 1] - m[:, 1, 2]
    k[:, 0, 2] = k[:, 2, 0] = m[:, 0, 2] - m[:, 2, 0]
    k[:, 0, 3] = k[:, 3, 0] = m[:, 1, 0] - m[:, 0, 1]
    for i in range(3):
        for j in range(3):
            k[:, 1 + i, 1 + j] = m[:, i, j] + m[:, j, i] - (k[:, 0, 0] if i == j else 0.0)
    return np.linalg.eigh(k)[1][:, :, -1]


@dataclass
class Course:
    """Where the body is and how it turns.

    Attributes
    ----------
    t : (n,) array
        s.
    rotation : (n, 3, 3) array
        Body to reference, as the reference says.
    omega : (n, 3) array
        rad/s, body frame.
    label : (n,) array
        Side that is meant to be up; empty while it turns.
    temperature : (n,) array
        degC.
    rests : list of slice
        Rows of each pose.
    up : (n, 3) array
        True direction of up, body frame.
    """

    t: np.ndarray
    rotation: np.ndarray
    omega: np.ndarray
    label: np.ndarray
    temperature: np.ndarray
    rests: list[slice]
    up: np.ndarray


def course(
    poses: Sequence[str | Sequence[float]],
    *,
    hold: float = 2.0,
    move: float = 1.0,
    rate: float = 100.0,
    headings: Sequence[float] | None = None,
    placement: float = 0.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    temperatures: Sequence[float] | None = None,
    seed: int = 0,
) -> Course:
    """Rest after rest with a smooth turn between.

    Parameters
    ----------
    poses : sequence
        Sides, or directions that point up.
    hold, move : float
        s.
    rate : float
        Hz.
    headings : sequence of float, optional
        Turn of each pose about the table's normal, rad; without it the shortest way is taken.
    placement : float
        Standard deviation, deg, by which each pose is laid amiss about either level axis.
    tilt : (float, float)
        Of the table about its x and y axis, rad.
    temperatures : sequence of float, optional
        Of each pose, degC; it changes while the sensor turns.
    seed : int
        Of the placement.
    """
    rng = np.random.default_rng(seed)
    rotations, omegas, labels, temperature, rests = [], [], [], [], []
    z = np.array([0.0, 0.0, 1.0])
    before, rows, warm = None, 0, 25.0
    for k, pose in enumerate(poses):
        up = UP[pose] if isinstance(pose, str) else np.asarray(pose, float) / np.linalg.norm(pose)
        up = exp(np.cross(up, rng.normal(0.0, np.radians(placement), 3))) @ up
        now = exp(between(up, z))
        if headings is not None:
            now = exp(z * headings[k]) @ now
        elif before is not None:
            now = before @ exp(-between(before.T @ z, up))
        warmer = warm if temperatures is None else temperatures[k]
        if before is not None:
            n = max(int(move * rate), 1)
            share = (np.arange(n) + 0.5) / n
            way = vector(before.T @ now)
            rotations.append(before @ exp(way * (0.5 - 0.5 * np.cos(np.pi * share))[:, None]))
            omegas.append(way * (0.5 * np.pi * np.sin(np.pi * share) / n * rate)[:, None])
            labels += [""] * n
            temperature.append(warm + (warmer - warm) * share)
            rows += n
        n = int(hold * rate)
        rotations.append(np.broadcast_to(now, (n, 3, 3)))
        omegas.append(np.zeros((n, 3)))
        labels += [pose if isinstance(pose, str) else ""] * n
        temperature.append(np.full(n, warmer))
        rests.append(slice(rows, rows + n))
        before, rows, warm = now, rows + n, warmer
    rotation = np.concatenate(rotations)
    # The table's frame is turned by the tilt against the level one: true = exp(tilt) reference.
    up = np.swapaxes(rotation, 1, 2) @ (exp(-np.array([*tilt, 0.0])) @ z)
    return Course(
        np.arange(rows) / rate,
        rotation,
        np.concatenate(omegas),
        np.array(labels, dtype=object),
        np.concatenate(temperature),
        rests,
        up,
    )


def vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector of one rotation matrix."""
    w, *xyz = quaternions(rotation[None])[0]
    half = np.linalg.norm(xyz)
    angle = 2.0 * np.arctan2(half, abs(w))
    return np.sign(w or 1.0) * np.array(xyz) / max(half, 1e-300) * angle


def tumbling(duration: float = 60.0, rate: float = 50.0, seed: int = 0) -> Course:
    """Turned by hand through all attitudes, never at rest."""
    rng = np.random.default_rng(seed)
    n = int(duration * rate)
    t = np.arange(n) / rate
    w, phase = 2 * np.pi * rng.uniform(0.05, 0.3, (3, 3)), rng.uniform(0, 2 * np.pi, (3, 3))

    def rates(time: np.ndarray) -> np.ndarray:
        return 0.8 * np.sin(time[:, None, None] * w + phase).sum(2)

    rotation = np.empty((n, 3, 3))
    now = np.eye(3)
    # Ten steps per sample: the mean rate of so short a step is its middle's.
    fine = exp(rates((np.arange(10 * n) + 0.5) / (10 * rate)) / (10 * rate))
    for k in range(n):
        rotation[k] = now
        for step in fine[10 * k : 10 * k + 10]:
            now = now @ step
    empty = np.full(n, "", dtype=object)
    return Course(t, rotation, rates(t), empty, np.full(n, 25.0), [], rotation[:, 2, :].copy())


def joined(*courses: Course) -> Course:
    """One course after another; the jump between them is as if the sensor had been carried over unseen."""
    start, row, times, rests = 0.0, 0, [], []
    for one in courses:
        times.append(one.t + start)
        rests += [slice(rest.start + row, rest.stop + row) for rest in one.rests]
        start, row = times[-1][-1] + 2.0, row + len(one.t)
    whole = {
        name: np.concatenate([getattr(one, name) for one in courses])
        for name in ("rotation", "omega", "label", "temperature", "up")
    }
    return Course(np.concatenate(times), rests=rests, **whole)


def nothing() -> np.ndarray:
    """Return no offset."""
    return np.zeros(3)


@dataclass
class Sensor:
    """Readings ``gain ideal + bias + noise``, rounded and clipped.

    Attributes
    ----------
    acc_gain, gyr_gain, soft_iron : (3, 3) array
        What multiplies the ideal reading.
    acc_bias, gyr_bias, hard_iron : (3,) array
        m/s^2, rad/s, uT.
    bias_slope, scale_slope : (3,) array
        Of the accelerometer, by temperature above 25 degC, per K.
    acc_noise, gyr_noise, mag_noise : float
        Standard deviation of one reading of one axis.
    acc_step : float
        Step of the digits, m/s^2.
    acc_range : float
        m/s^2.
    """

    acc_gain: np.ndarray = field(default_factory=lambda: np.eye(3))
    acc_bias: np.ndarray = field(default_factory=nothing)
    gyr_gain: np.ndarray = field(default_factory=lambda: np.eye(3))
    gyr_bias: np.ndarray = field(default_factory=nothing)
    soft_iron: np.ndarray = field(default_factory=lambda: np.eye(3))
    hard_iron: np.ndarray = field(default_factory=nothing)
    bias_slope: np.ndarray = field(default_factory=nothing)
    scale_slope: np.ndarray = field(default_factory=nothing)
    acc_noise: float = 0.03
    gyr_noise: float = 0.002
    mag_noise: float = 0.3
    acc_step: float = 0.0
    acc_range: float = np.inf

    def read(self, where: Course, seed: int = 0, *, names: str = "acc gyr pose", shake: object = 0.0) -> dict:
        """Arrays for ``Log.from_arrays``.

        Parameters
        ----------
        where : Course
            The motion.
        seed : int
            Of the noise.
        names : str
            Which columns, of ``acc gyr mag pose temp reference``.
        shake : array_like
            Acceleration, m/s^2, body frame, added to the specific force.
        """
        rng = np.random.default_rng([seed, 1])
        n = len(where.t)
        warm = (where.temperature - 25.0)[:, None]
        force = GRAVITY * where.up + shake
        acc = force @ self.acc_gain.T + self.acc_bias + warm * (self.bias_slope + self.scale_slope * force)
        acc = np.clip(acc + self.acc_noise * rng.standard_normal((n, 3)), -self.acc_range, self.acc_range)
        if self.acc_step:
            acc = np.round(acc / self.acc_step) * self.acc_step
        gyr = where.omega @ self.gyr_gain.T + self.gyr_bias + self.gyr_noise * rng.standard_normal((n, 3))
        ideal = np.einsum("nij,i->nj", where.rotation, FIELD)
        mag = ideal @ self.soft_iron.T + self.hard_iron + self.mag_noise * rng.standard_normal((n, 3))
        every = {
            "acc": acc,
            "gyr": gyr,
            "mag": mag,
            "pose": [str(label) or None for label in where.label],
            "temp": where.temperature,
            "reference": quaternions(where.rotation),
        }
        if "pose" in names.split() and not any(every["pose"]):
            names = names.replace("pose", "")
        return {"t": where.t, **{name: every[name] for name in names.split()}, "frame": "NWU"}


def typical(seed: int = 0, **changed: object) -> Sensor:
    """Draw a low-cost sensor's errors: 2 % of scale, 1 % of misalignment, 0.2 m/s^2, 0.02 rad/s, 20 uT."""
    rng = np.random.default_rng([seed, 2])

    def gain() -> np.ndarray:
        return np.eye(3) + np.diag(rng.normal(0.0, 0.02, 3)) + rng.normal(0.0, 0.01, (3, 3))

    values = {
        "acc_gain": gain(),
        "acc_bias": rng.normal(0.0, 0.2, 3),
        "gyr_gain": gain(),
        "gyr_bias": rng.normal(0.0, 0.02, 3),
        "soft_iron": np.eye(3) + rng.normal(0.0, 0.04, (3, 3)),
        "hard_iron": rng.normal(0.0, 20.0, 3),
    }
    return Sensor(**{**values, **changed})


def spread(n: int, seed: int = 0) -> list[np.ndarray]:
    """Directions in a spiral over the sphere, turned at random."""
    z = 1.0 - 2.0 * (np.arange(n) + 0.5) / n
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)
    spiral = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)
    rng = np.random.default_rng([seed, 3])
    spiral = spiral @ exp(rng.normal(0.0, 1.5, 3)).T
    # In another order than along the spiral, so that the turns between are wide.
    return list(spiral[rng.permutation(n)])
