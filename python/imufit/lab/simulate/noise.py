"""Random errors of the sensors, the reference and the clock, and the times at which samples are really taken."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_banded

from imufit.lab.simulate.environment import stream
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.truth import rotation_about


@dataclass(frozen=True)
class SensorNoise:
    """Random errors of one sensor, the same for its three axes, in the sensor's unit.

    Attributes
    ----------
    white : standard deviation of the white noise of one sample, behind the sensor's own filter if it has one.
    growth_with_rate : by which share of itself the white noise grows for each rad/s of angular rate; 0 = not.
    growth_with_time : by which share of itself the white noise has grown at the end of the log; 0 = not.
    bandwidth : corner (Hz) of the sensor's own first-order low-pass, through which the white noise goes; None = none.
    coloured : standard deviation of first-order autoregressive noise on top of it; 0 = none.
    correlation_time : time (s) in which the correlation of the coloured noise falls to 1/e.
    random_walk : growth of the bias per square root of a second; 0 = none.
    resolution : step between two values that the sensor can output; 0 = none.
    """

    white: float
    coloured: float = 0.0
    correlation_time: float = 0.2
    random_walk: float = 0.0
    resolution: float = 0.0
    bandwidth: float | None = None
    growth_with_rate: float = 0.0
    growth_with_time: float = 0.0

    @classmethod
    def from_density(
        cls, density: float, bandwidth: float, *, random_walk: float = 0.0, resolution: float = 0.0
    ) -> SensorNoise:
        """Return the noise that a sensor of this noise density has behind a first-order low-pass.

        Parameters
        ----------
        density : float
            One-sided noise density, unit of the sensor per sqrt(Hz), as in data sheets.
        bandwidth : float
            Corner of the low-pass, Hz. White noise comes through as through pi/2 times that bandwidth.
        random_walk, resolution : float, optional
            As the attributes.
        """
        white = density * float(np.sqrt(0.5 * np.pi * bandwidth))
        return cls(white, random_walk=random_walk, resolution=resolution, bandwidth=bandwidth)

    def draw(self, rng: np.random.Generator, t: Array, rates: Array | None = None) -> Array:
        """Return noise (n, 3) for samples at times `t` (s), without the rounding.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        t : ndarray
            (n,) times, s.
        rates : ndarray, optional
            (n, 3) true angular rate, rad/s; without it the noise is as at rest.
        """
        noise = self.white * rng.standard_normal((t.size, 3))
        if self.growth_with_rate > 0.0 and rates is not None:
            noise *= 1.0 + self.growth_with_rate * np.linalg.norm(rates, axis=1)[:, None]
        if self.growth_with_time > 0.0:
            noise *= 1.0 + self.growth_with_time * ((t - t[0]) / max(float(t[-1] - t[0]), 1e-9))[:, None]
        gaps = np.diff(t, prepend=t[0])
        if self.bandwidth is not None:
            noise = _correlated(noise, gaps, 1.0 / (2.0 * np.pi * self.bandwidth))
        if self.coloured > 0.0:
            noise += _correlated(self.coloured * rng.standard_normal((t.size, 3)), gaps, self.correlation_time)
        if self.random_walk > 0.0:
            steps = self.random_walk * np.sqrt(gaps)[:, None] * rng.standard_normal((t.size, 3))
            noise += np.cumsum(steps, axis=0)
        return noise

    def rounded(self, reading: Array) -> Array:
        """Return the reading as the sensor's digits show it.

        Parameters
        ----------
        reading : ndarray
            (n, 3) readings, in the sensor's unit.
        """
        return reading if self.resolution == 0.0 else np.round(reading / self.resolution) * self.resolution


def _correlated(white: Array, gaps: Array, time: float) -> Array:
    """Return (n, 3) samples of the variance of `white` whose correlation falls as exp(-gap / time), whatever the gaps.

    This is white noise behind a first-order low-pass with that time constant (s), sampled: exactly, not stepwise.
    """
    keep = np.exp(-gaps[1:] / time)
    drive = white.copy()
    drive[1:] *= np.sqrt(1.0 - keep**2)[:, None]
    bands = np.ones((2, gaps.size))
    bands[1, :-1] = -keep
    return np.asarray(solve_banded((1, 0), bands, drive), dtype=np.float64)


def _mpu6050_acc() -> SensorNoise:
    return SensorNoise(0.02)


def _mpu6050_gyr() -> SensorNoise:
    return SensorNoise(float(np.radians(0.05)))


def _hmc5883l() -> SensorNoise:
    return SensorNoise(0.3)


@dataclass(frozen=True)
class Noise:
    """All random errors of a log.

    The defaults are white noise such as an MPU6050 with its 44 Hz filter and an HMC5883L show at 100 Hz: 0.02 m/s^2,
    0.05 deg/s and 0.3 uT per sample; nothing else.

    Attributes
    ----------
    acc, gyr, mag : the sensors (m/s^2, rad/s, uT).
    temperature, temperature_resolution : of the thermometer, K.
    attitude_deg : white error of the reference attitude about each axis, standard deviation in degrees.
    position : white error of the reference position along each axis, standard deviation in m.
    jitter : standard deviation (s) by which samples are taken, and stamped, off the even grid.
    dropped : fraction of rows that are lost.
    mag_rate : output rate of the magnetometer, Hz; rows between its samples hold NaN. None = that of the log.
    """

    acc: SensorNoise = field(default_factory=_mpu6050_acc)
    gyr: SensorNoise = field(default_factory=_mpu6050_gyr)
    mag: SensorNoise = field(default_factory=_hmc5883l)
    temperature: float = 0.02
    temperature_resolution: float = 0.0
    attitude_deg: float = 0.0
    position: float = 0.0
    jitter: float = 0.0
    dropped: float = 0.0
    mag_rate: float | None = None

    @classmethod
    def realistic(cls) -> Noise:
        """Return the defaults with colour, bias random walk, 16 bit steps, jitter, lost rows, a slow magnetometer."""
        plain = cls()
        return cls(
            acc=replace(plain.acc, coloured=0.006, random_walk=2e-4, resolution=9.80665 / 8192),
            gyr=replace(plain.gyr, coloured=2.5e-4, random_walk=1e-5, resolution=float(np.radians(1 / 65.5))),
            mag=replace(plain.mag, coloured=0.1, correlation_time=0.5, resolution=0.092),
            temperature=0.03,
            temperature_resolution=1 / 340,
            attitude_deg=0.03,
            position=2e-4,
            jitter=3e-4,
            dropped=0.002,
            mag_rate=50.0,
        )

    @classmethod
    def heteroscedastic(cls, with_rate: float = 0.0, with_time: float = 0.0) -> Noise:
        """Return the defaults with white noise that grows.

        Parameters
        ----------
        with_rate : float
            Share of itself by which it grows for each rad/s of angular rate.
        with_time : float
            Share of itself by which it has grown at the end of the log.
        """
        plain = cls()
        grown = {
            name: replace(plain.sensor(name), growth_with_rate=with_rate, growth_with_time=with_time)
            for name in ("acc", "gyr", "mag")
        }
        return cls(acc=grown["acc"], gyr=grown["gyr"], mag=grown["mag"])

    @classmethod
    def mpu6050(cls, acc_bandwidth: float = 21.0, gyr_bandwidth: float = 20.0) -> Noise:
        """Return an MPU6050 at its finest ranges behind its digital low-pass; the defaults are its setting 4.

        Densities are those of the data sheet (gyroscope 0.005 deg/s/sqrt(Hz); accelerometer 400 ug/sqrt(Hz), of which
        paper B's sensor has seven eighths), steps those of 16 bit over +-2 g and +-250 deg/s. The gyroscope's bias
        walks by 0.05 millidegrees per second in five minutes.

        Parameters
        ----------
        acc_bandwidth, gyr_bandwidth : float, optional
            Corners of the low-pass, Hz.
        """
        return cls(
            acc=SensorNoise.from_density(350e-6 * 9.80665, acc_bandwidth, resolution=9.80665 / 16384),
            gyr=SensorNoise.from_density(
                float(np.radians(0.005)), gyr_bandwidth, random_walk=5e-8, resolution=float(np.radians(1 / 131))
            ),
            temperature_resolution=1 / 340,
        )

    @classmethod
    def gy86(cls) -> Noise:
        """Return a GY-86 read quickly: an MPU6050 behind its 44 Hz filter, an HMC5883L at its fastest, 75 Hz.

        The MPU6050 is that of `mpu6050`, its setting 3 (44 and 42 Hz). The HMC5883L has the 2 mG deviation and, at its
        usual range of +-1.3 G, the 1090 steps a gauss of its data sheet.
        """
        chip = cls.mpu6050(44.0, 42.0)
        return replace(chip, mag=SensorNoise(0.2, resolution=100.0 / 1090.0), mag_rate=75.0)

    def sensor(self, name: str) -> SensorNoise:
        """Return the noise of sensor `name`: "acc", "gyr" or "mag".

        Parameters
        ----------
        name : str
            "acc", "gyr" or "mag".
        """
        return {"acc": self.acc, "gyr": self.gyr, "mag": self.mag}[name]

    def white(self) -> dict[str, float]:
        """Return the standard deviation of the white noise for each sensor, in its unit."""
        return {name: self.sensor(name).white for name in ("acc", "gyr", "mag")}


def sampling_times(noise: Noise, seed: int, duration: float, rate: float) -> Array:
    """Return the times (n,), s, at which samples are taken: an even grid from 0, jittered, with some rows lost."""
    rng = stream(seed, "sampling times")
    t = np.arange(round(duration * rate)) / rate
    if noise.jitter > 0.0:
        t = t + np.clip(noise.jitter * rng.standard_normal(t.size), -0.4 / rate, 0.4 / rate)
    if noise.dropped > 0.0:
        kept = rng.random(t.size) >= noise.dropped
        kept[:1] = True
        t = t[kept]
    return t


def magnetometer_rows(noise: Noise, t: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which rows (n,) hold a new sample of the magnetometer."""
    if noise.mag_rate is None:
        return np.ones(t.size, dtype=np.bool_)
    count = np.floor(t * noise.mag_rate + 0.25)
    return np.diff(count, prepend=-np.inf) > 0.0


def noisy_attitude(rotation: Array, noise: Noise, rng: np.random.Generator) -> Array:
    """Return reference attitudes (n, 3, 3), each turned by a random error in the body frame."""
    if noise.attitude_deg == 0.0:
        return rotation
    error = np.radians(noise.attitude_deg) * rng.standard_normal((rotation.shape[0], 3))
    angle = np.linalg.norm(error, axis=1)
    return np.asarray(rotation @ rotation_about(error / angle[:, None], angle), dtype=np.float64)
