"""Ways to spoil a log: each takes a sound log and a generator, and gives the log as a user would have it.

A way gives None where the mistake could not be noticed in that log by anyone: nothing to clip, no room for counts.
Attitudes are scalar first and turn body vectors into the reference frame, as docs/conventions.md says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfilt, sosfiltfilt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[Any]
Table = dict[str, Array]
Metadata = dict[str, Any]

G = 9.80665
"""Standard gravity, m/s^2: the metadata's default."""
DEGREE = np.pi / 180.0
"""One degree, rad."""
SHORT = 32767
"""Largest count of a 16-bit register."""
EPOCH = 1_714_564_800.0
"""A day in 2024, s since 1970: what a logger with a clock writes."""
AXES = "xyz"
UP = {"NED": (0.0, 0.0, -1.0), "ENU": (0.0, 0.0, 1.0), "NWU": (0.0, 0.0, 1.0)}
"""Up in each reference frame."""
READINGS = tuple(f"{sensor}_{axis}" for sensor in ("acc", "gyr", "mag") for axis in AXES)
QUATERNION = ("ref_qw", "ref_qx", "ref_qy", "ref_qz")
MOUNTED = 0.01
"""Rotation between the sensor and its rig at the angle zero, rad, from which on the sensor is mounted at an angle."""

EVEN = 0.02
"""Distance of a time from that of even steps, s, up to which the number of a row stands for its time."""


@dataclass(frozen=True)
class Log:
    """A log outside of the package: columns, metadata, and the bytes of its text where the text is the mistake."""

    table: Table
    metadata: Metadata
    text: bytes | None = None

    def put(self, **columns: Array) -> Log:
        """The log with columns put in or replaced, the order of the others kept."""
        return replace(self, table={**self.table, **columns})

    def tell(self, **entries: Any) -> Log:
        """The log with other metadata."""
        return replace(self, metadata={**self.metadata, **entries})

    def without(self, *names: str) -> Log:
        """The log without some columns."""
        return replace(self, table={name: column for name, column in self.table.items() if name not in names})

    def rows(self, chosen: Array) -> Log:
        """Rows by number or by a mask."""
        return replace(self, table={name: column[chosen] for name, column in self.table.items()})

    def vector(self, sensor: str) -> Array:
        """Readings of a sensor, n x 3."""
        return np.column_stack([self.table[name] for name in columns_of(sensor)])

    @property
    def n(self) -> int:
        return len(self.table["t"])


Spoil = Callable[[Log, np.random.Generator], Log | None]


def columns_of(sensor: str) -> tuple[str, ...]:
    """Names of the columns of a sensor, of a part of the reference, or of one column."""
    if sensor == "ref_q":
        return QUATERNION
    if sensor in ("acc", "gyr", "mag"):
        return tuple(f"{sensor}_{axis}" for axis in AXES)
    return tuple(f"ref_p{axis}" for axis in AXES) if sensor == "ref_p" else (sensor,)


def changed(log: Log, names: Sequence[str], change: Callable[[Array], Array]) -> Log:
    """The log with each of some columns changed alike."""
    return log.put(**{name: change(log.table[name]) for name in names if name in log.table})


# Units.


def times(sensor: str, factor: float, *, offset: float = 0.0, whole: bool = False) -> Spoil:
    """Write a sensor in another unit; whole numbers must fit a register."""

    def spoil(log: Log, _: np.random.Generator) -> Log | None:
        names = [name for name in columns_of(sensor) if name in log.table]
        if whole and max(np.nanmax(np.abs(log.table[name] * factor)) for name in names) > SHORT:
            return None
        return changed(log, names, lambda x: np.round(x * factor + offset) if whole else x * factor + offset)

    return spoil


def degrees_of_rig(log: Log, _: np.random.Generator) -> Log | None:
    """Leave the rig's angle as the only reference, in degrees."""
    vector = np.zeros((len(log.table["t"]), 3))
    vector[:, "xyz".index(log.metadata["rig_axis"])] = log.table["ref_angle"]
    w, *xyz = (log.table[name] for name in QUATERNION)
    mount = Rotation.from_quat(np.column_stack([*xyz, w])) * Rotation.from_rotvec(vector).inv()
    if float(np.median(mount.magnitude())) > MOUNTED:
        # The quaternion alone holds how the sensor is mounted: without it the angle of the sound log is another one.
        return None
    return log.without(*QUATERNION).put(ref_angle=log.table["ref_angle"] / DEGREE)


def normalised(sensor: str) -> Spoil:
    """Divide every reading by its own length, as filters do inside."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        x = log.vector(sensor)
        unit = x / np.linalg.norm(x, axis=1, keepdims=True)
        return log.put(**{name: unit[:, k] for k, name in enumerate(columns_of(sensor))})

    return spoil


# Axes and signs.


def axes(order: str, *sensors: str) -> Spoil:
    """Write axes in another order and sign: "-y x z" puts minus the reading of y into the column x."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        new = {}
        for sensor in sensors:
            for axis, source in zip(AXES, order.split(), strict=True):
                if f"{sensor}_x" in log.table:
                    new[f"{sensor}_{axis}"] = log.table[f"{sensor}_{source[-1]}"] * (-1.0 if source[0] == "-" else 1.0)
        return log.put(**new)

    return spoil


def exchanged(*pairs: tuple[str, str]) -> Spoil:
    """Exchange columns by name."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        return log.put(**{a: log.table[b] for one, other in pairs for a, b in ((one, other), (other, one))})

    return spoil


def gravity_removed(log: Log, _: np.random.Generator) -> Log:
    """Linear acceleration in the place of specific force: the phone's other sensor."""
    up = attitude(log).inv().apply(np.array(UP[log.metadata.get("frame", "NED")]))
    linear = log.vector("acc") - float(log.metadata.get("gravity", G)) * up
    return log.put(**{name: linear[:, k] for k, name in enumerate(columns_of("acc"))})


# The reference.


def attitude(log: Log) -> Rotation:
    """Reference attitude; the identity where it was not measured."""
    q = np.column_stack([log.table[name] for name in QUATERNION])
    q = np.where(np.isfinite(q).all(axis=1)[:, None], q, [1.0, 0.0, 0.0, 0.0])
    return Rotation.from_quat(q[:, [1, 2, 3, 0]])


def with_reference(log: Log, q: Array) -> Log:
    """The log with another reference, scalar first; rows that had none keep none."""
    missing = ~np.isfinite(log.table["ref_qw"])
    return log.put(**{name: np.where(missing, np.nan, q[:, k]) for k, name in enumerate(QUATERNION)})


def scalar_first(rotation: Rotation) -> Array:
    """Quaternions of rotations, scalar first, without jumps of the sign."""
    q = rotation.as_quat()[:, [3, 0, 1, 2]]
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(flips)])[:, None]


def quaternion(*, order: str = "wxyz", signs: Sequence[float] = (1, 1, 1, 1), factor: float = 1.0) -> Spoil:
    """Write w x y z in another order, with other signs, or not of unit length."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        sources = [log.table[f"ref_q{part}"] * sign * factor for part, sign in zip(order, signs, strict=True)]
        return log.put(**dict(zip(QUATERNION, sources, strict=True)))

    return spoil


def euler_columns(log: Log, _: np.random.Generator) -> Log:
    """Roll, pitch and yaw in degrees in columns of their own, no quaternion."""
    roll, pitch, yaw = attitude(log).as_euler("ZYX", degrees=True).T[::-1]
    return log.without(*QUATERNION).put(ref_roll=roll, ref_pitch=pitch, ref_yaw=yaw)


def euler_in_quaternion(log: Log, _: np.random.Generator) -> Log:
    """Roll, pitch and yaw in degrees in the columns of the quaternion."""
    angles = attitude(log).as_euler("ZYX", degrees=True)[:, ::-1]
    return with_reference(log, np.column_stack([np.zeros(log.n), angles]))


def sign_flips(log: Log, rng: np.random.Generator) -> Log:
    """Turn the sign of whole quaternions at random: the same attitude."""
    signs = rng.choice([-1.0, 1.0], log.n)
    return changed(log, QUATERNION, lambda x: x * signs)


def reference_at(when: Callable[[Array], Array]) -> Spoil:
    """Take the reference, position included, at other times of the log."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        t = log.table["t"]
        turned = np.unwrap(scalar_first(attitude(log)), axis=0)
        new = {name: turned[:, k] for k, name in enumerate(QUATERNION)}
        new |= {name: log.table[name] for name in (*columns_of("ref_p"), "ref_angle") if name in log.table}
        moved = log.put(**{name: np.interp(when(t), t, column) for name, column in new.items()})
        length = np.sqrt(sum(moved.table[name] ** 2 for name in QUATERNION))
        moved = changed(moved, QUATERNION, lambda x: x / length)
        inside = (when(t) >= t[0]) & (when(t) <= t[-1]) & np.isfinite(log.table["ref_qw"])
        return moved.rows(inside)

    return spoil


def reference_smoothed(log: Log, _: np.random.Generator) -> Log | None:
    """Low-pass the reference at 1 Hz without delay, as an optical system's export does."""
    if not np.isfinite(log.table["ref_qw"]).all():
        return None
    sos = butter(2, 1.0, fs=rate(log), output="sos")
    q = sosfiltfilt(sos, scalar_first(attitude(log)), axis=0)
    moved = with_reference(log, q / np.linalg.norm(q, axis=1, keepdims=True))
    return changed(moved, columns_of("ref_p"), lambda x: sosfiltfilt(sos, x))


def reference_held(hertz: float) -> Spoil:
    """Repeat each value of the reference until the next one comes."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        step = max(2, round(rate(log) / hertz))
        held = np.arange(log.n) // step * step
        return changed(log, (*QUATERNION, *columns_of("ref_p"), "ref_angle"), lambda x: x[held])

    return spoil


def reference_stands(log: Log, _: np.random.Generator) -> Log:
    """One attitude in every row: the tracker lost the body."""
    return changed(log, (*QUATERNION, *columns_of("ref_p")), lambda x: np.full(log.n, x[np.isfinite(x)][0]))


def reference_of_another(log: Log, _: np.random.Generator) -> Log:
    """Take the motion of the other end of the recording, as if the wrong file stood beside this one."""
    return changed(log, (*QUATERNION, *columns_of("ref_p")), lambda x: np.roll(x, log.n // 3))


def own_filter(log: Log, _: np.random.Generator) -> Log:
    """A complementary filter of the log's own readings as the reference."""
    up = np.array(UP[log.metadata.get("frame", "NED")])
    acc, gyr, t = log.vector("acc"), log.vector("gyr"), log.table["t"]
    acc = acc / np.linalg.norm(acc, axis=1, keepdims=True)
    pull = 0.5  # rad/s per rad: the usual gain of such a filter
    now = attitude(log)[0]
    q = np.empty((log.n, 4))
    for k in range(log.n):
        q[k] = now.as_quat()[[3, 0, 1, 2]]
        dt = t[min(k + 1, log.n - 1)] - t[k]
        error = np.cross(acc[k], now.inv().apply(up))
        now = now * Rotation.from_rotvec((gyr[k] + pull * error) * dt)
    return with_reference(log, q)


# The clock.


def rate(log: Log) -> float:
    """Samples per second."""
    return 1.0 / float(np.median(np.diff(log.table["t"])))


def clock(change: Callable[[Array], Array]) -> Spoil:
    """Write the time otherwise."""
    return lambda log, _: log.put(t=change(log.table["t"]))


def clock_counts(log: Log, _: np.random.Generator) -> Log | None:
    """The number of the row in place of its time; of uneven times, which no mapping restores, None."""
    t = log.table["t"]
    if np.abs(t - np.linspace(t[0], t[-1], log.n)).max() > EVEN:
        return None
    return log.put(t=np.arange(log.n, dtype=float))


def clock_by_row(log: Log, _: np.random.Generator) -> Log:
    """A step from row to row a thousand times too long: a log at 100 Hz that claims to be one at 0.1 Hz."""
    return log.put(t=np.arange(log.n) * (1000.0 / rate(log)))


def clock_steps_back(log: Log, rng: np.random.Generator) -> Log:
    """The clock is set back by half a second once."""
    at = int(rng.uniform(0.3, 0.7) * log.n)
    return log.put(t=log.table["t"] - 0.5 * (np.arange(log.n) >= at))


def clock_restarts(log: Log, _: np.random.Generator) -> Log:
    """The board restarts in the middle, and its time with it."""
    t, at = log.table["t"], log.n // 2
    return log.put(t=np.where(np.arange(log.n) >= at, t - t[at], t - t[0]))


def gap_closed(log: Log, rng: np.random.Generator) -> Log | None:
    """Two seconds of rows are lost while the body turns, and the time is written by row number."""
    t, lost = log.table["t"], round(2.0 * rate(log))
    turn = (attitude(log)[: log.n - lost].inv() * attitude(log)[lost:]).magnitude()
    far = np.flatnonzero(turn[log.n // 5 : -log.n // 5] > 0.5)
    if not len(far):
        return None
    at = log.n // 5 + int(rng.choice(far))
    kept = log.rows(np.r_[0:at, at + lost : log.n])
    return kept.put(t=t[: kept.n])


# Rows and values.


def shuffled(log: Log, rng: np.random.Generator) -> Log:
    """Rows in any order."""
    return log.rows(rng.permutation(log.n))


def rows_doubled(log: Log, rng: np.random.Generator) -> Log:
    """Every 50th row stands twice, its time too."""
    twice = np.ones(log.n, int)
    twice[rng.integers(0, 50) :: 50] = 2
    return log.rows(np.repeat(np.arange(log.n), twice))


def block_twice(log: Log, rng: np.random.Generator) -> Log:
    """A buffer of 200 rows is written twice over the next one; the time goes on."""
    at = int(rng.integers(log.n // 4, log.n // 2))
    order = np.arange(log.n)
    order[at + 200 : at + 400] = order[at : at + 200]
    return log.rows(order).put(t=log.table["t"])


def rows_dropped(log: Log, rng: np.random.Generator) -> Log:
    """One row in twenty is lost at random, the time is right."""
    return log.rows(rng.random(log.n) > 0.05)


def bursts(log: Log, rng: np.random.Generator, length: int, count: int = 12) -> Array:
    """Mask of rows in bursts, away from the ends."""
    mask = np.zeros(log.n, bool)
    for at in rng.integers(log.n // 20, log.n - log.n // 20 - length, count):
        mask[at : at + length] = True
    return mask


def filled(filler: float | None, length: int = 25) -> Spoil:
    """Lost samples hold a filler, or the last value before them."""

    def spoil(log: Log, rng: np.random.Generator) -> Log:
        mask = bursts(log, rng, length)
        last = np.maximum.accumulate(np.where(mask, 0, np.arange(log.n)))
        names = [name for name in READINGS if name in log.table]
        return changed(log, names, lambda x: x[last] if filler is None else np.where(mask, filler, x))

    return spoil


def spike(sensor: str, size: float) -> Spoil:
    """One sample of one axis that nothing has measured."""

    def spoil(log: Log, rng: np.random.Generator) -> Log:
        at = int(rng.integers(log.n // 4, log.n // 2))
        return changed(log, [f"{sensor}_x"], lambda x: np.where(np.arange(log.n) == at, size, x))

    return spoil


def constant(*names: str) -> Spoil:
    """Columns that never change."""
    return lambda log, _: changed(log, names, lambda x: np.full(log.n, x[np.isfinite(x)][0]))


def late_death(sensor: str) -> Spoil:
    """A sensor that hangs from two thirds of the log on."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        return changed(log, columns_of(sensor), lambda x: x[np.minimum(np.arange(log.n), 2 * log.n // 3)])

    return spoil


def clipped(sensor: str) -> Spoil:
    """Cut readings at the 96th percentile of their absolute values, as a range too small does."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        end = float(np.nanquantile(np.abs(log.vector(sensor)), 0.96))
        return changed(log, columns_of(sensor), lambda x: np.clip(x, -end, end))

    return spoil


def wrapped(sensor: str) -> Spoil:
    """Readings beyond the range come in again at the other end, as a cut of bits does."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        end = float(np.nanquantile(np.abs(log.vector(sensor)), 0.96))
        return changed(log, columns_of(sensor), lambda x: (x + end) % (2 * end) - end)

    return spoil


def bytes_swapped(sensor: str, full: float) -> Spoil:
    """Read 16-bit counts with their bytes in the wrong order."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        lsb = full / SHORT
        return changed(
            log,
            columns_of(sensor),
            lambda x: np.clip(np.round(np.nan_to_num(x) / lsb), -SHORT, SHORT).astype("<i2").byteswap() * lsb,
        )

    return spoil


def coarse(sensor: str, full: float) -> Spoil:
    """Keep the upper eight of sixteen bits of a range, rounded down as a shift does."""
    return lambda log, _: changed(log, columns_of(sensor), lambda x: np.floor(x / (full / 128)) * (full / 128))


def copied(target: str, source: str) -> Spoil:
    """One column is a copy of another."""
    return lambda log, _: log.put(**{target: log.table[source].copy()})


def covariate_of_length(log: Log, _: np.random.Generator) -> Log:
    """A column with the length of the accelerometer's reading."""
    return log.put(acc_norm=np.linalg.norm(log.vector("acc"), axis=1))


def low_pass(sensor: str, hertz: float) -> Spoil:
    """The sensor's own filter is switched on."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        sos = butter(2, hertz, fs=rate(log), output="sos")
        return changed(log, columns_of(sensor), lambda x: x[0] + sosfilt(sos, x - x[0]))

    return spoil


# Metadata and names.


def declared(frame: str) -> Spoil:
    """Declare another frame, one whose up is another."""

    def spoil(log: Log, _: np.random.Generator) -> Log | None:
        same = UP[log.metadata.get("frame", "NED")] == UP[frame]
        return None if same else log.tell(frame=frame)

    return spoil


def frame_misspelt(log: Log, _: np.random.Generator) -> Log:
    """`frme` in the place of `frame`."""
    rest = {key: value for key, value in log.metadata.items() if key != "frame"}
    return replace(log, metadata={"frme": log.metadata.get("frame", "NED"), **rest})


def told(**entries: Any) -> Spoil:
    """Metadata that are not so."""
    return lambda log, _: log.tell(**entries)


def noise_told(sensor: str, factor: float) -> Spoil:
    """Write the noise of a sensor in another unit."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        noise = log.metadata["noise"]
        return log.tell(noise={**noise, sensor: np.asarray(noise[sensor]).item() * factor})

    return spoil


def field_told(factor: float, down: float = 1.0) -> Spoil:
    """Write the field in another unit, or with its vertical the other way round."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        x, y, z = (factor * float(part) for part in log.metadata["mag_reference"])
        return log.tell(mag_reference=[x, y, down * z])

    return spoil


def rig_axis(axis: str | None) -> Spoil:
    """Leave the rig's angle as the only reference, with its axis wrong or not told."""

    def spoil(log: Log, _: np.random.Generator) -> Log | None:
        if axis == log.metadata["rig_axis"]:
            return None
        kept = {key: value for key, value in log.metadata.items() if key != "rig_axis"}
        left = replace(log, metadata=kept if axis is None else {**kept, "rig_axis": axis})
        return left.without(*QUATERNION)

    return spoil


def renamed(names: dict[str, str], **factors: float) -> Spoil:
    """Other names for columns, in a file that says nothing else; factors by sensor."""

    def spoil(log: Log, _: np.random.Generator) -> Log:
        table = {
            names.get(name, name): column * factors.get(name[:3], 1.0) if name in names else column
            for name, column in log.table.items()
        }
        return replace(log, table=table)

    return spoil


# Text.


def as_csv(log: Log, separator: str = ",") -> str:
    """The table as text, full precision, empty cells for missing samples."""
    columns = [
        ["" if isinstance(x, float) and np.isnan(x) else str(x) for x in column.tolist()]
        for column in log.table.values()
    ]
    lines = [separator.join(log.table), *(separator.join(cells) for cells in zip(*columns, strict=True))]
    return "\n".join(lines) + "\n"


def text(write: Callable[[Log], str], encoding: str = "utf-8") -> Spoil:
    """A file whose text is the mistake."""
    return lambda log, _: replace(log, text=write(log).encode(encoding))


def decimal_commas(log: Log) -> str:
    """Semicolons between cells, commas in numbers."""
    return as_csv(log, ";").replace(".", ",")


def thousands_commas(log: Log) -> str:
    """Commas both between cells and in numbers: a table that nobody can read."""
    return as_csv(log).replace(".", ",")


def header_again(log: Log) -> str:
    """The header stands in the middle once more, as two files laid end to end have it."""
    lines = as_csv(log).splitlines(keepends=True)
    return "".join([*lines[: log.n // 2], lines[0], *lines[log.n // 2 :]])


def cut_line(log: Log) -> str:
    """A line in the middle breaks off."""
    lines = as_csv(log).splitlines(keepends=True)
    lines[log.n // 2] = lines[log.n // 2][:25] + "\n"
    return "".join(lines)


def dates(log: Log) -> str:
    """The time of day as text."""
    stamps = np.datetime64("2024-05-01T12:00:00") + np.round(log.table["t"] * 1e6).astype("timedelta64[us]")
    return as_csv(log.put(t=stamps.astype(str)))


def word_for_missing(log: Log) -> str:
    """A word in the place of missing samples."""
    lines = as_csv(log).splitlines(keepends=True)
    for k in range(log.n // 2, log.n // 2 + 20):
        cells = lines[k].split(",")
        cells[1] = "timeout"
        lines[k] = ",".join(cells)
    return "".join(lines)
