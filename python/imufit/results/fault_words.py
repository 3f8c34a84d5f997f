"""The sentences on faults of the data: what shows a fault, and what to do about it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.figures import quantity
from imufit.log.columns import SENSOR_NAMES
from imufit.log.origin import Origin
from imufit.remedy import Remedy, mapped, option, when_read
from imufit.results.phrasing import capital

Array = NDArray[np.float64]

AXES: Final = "xyz"
PARTS: Final = "wxyz"
UNITS: Final = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}

UNKNOWN: Final = "S"
"""A lag that only the user knows."""

Words = tuple[str, str | Remedy]
"""Evidence and remedy."""


def read_anew(columns: Mapping[str, str], origin: Origin) -> Remedy:
    """Name the mapping that makes columns of a log anew, in the file's own names.

    Parameters
    ----------
    columns : mapping
        Source text for each column that changes, in terms of the log.
    origin : Origin
        How the log was read.
    """
    return when_read(mapped(origin.mapping(columns)))


def falls(sensor: str, before: float, after: float) -> str:
    """Say how the residual falls, as a share of the reading's RMS; of shares of the sum of squares."""
    first, last = (100.0 * float(np.sqrt(share)) for share in (before, after))
    return f"from {first:.3g} to {last:.2g} % of {sensor}"


def changed(change: Words, left: Sequence[str], alike: Words | None) -> Words:
    """Say how a log has to be read, and what looks the same."""
    text = f"{change[0]} Read so, the residual falls {', '.join(left)}."
    if alike is not None:
        text += f" Here this looks the same: {alike[0][0].lower()}{alike[0][1:]} {alike[1]}"
    return text, change[1]


def mount(sensors: Sequence[str], matrix: Array, excited: str, origin: Origin) -> Words:
    """Say that all sensors are turned alike; one that is excited stands for the others."""
    turned_back = {target: source for sensor in sensors for target, source in mapping(sensor, matrix).items()}
    return (
        "The axes of every sensor are turned against the body that the reference describes: "
        f"{_shown(excited, matrix)}, and so on.",
        "Turn them back with "
        + read_anew(turned_back, origin)
        + f", or multiply the reference from the right by a turn of {_turn(matrix.T)}.",
    )


def frame(name: str, declared: str) -> Words:
    """Say that the reference is in another frame."""
    text = f"The reference is in the frame {name}, not {declared} as the log states."
    return text, "Declare the frame: " + when_read(option("frame", name)) + "."


def quaternion(places: Sequence[int], signs: Sequence[float], origin: Origin) -> Words:
    """Say how the four numbers of the reference have to be read.

    Parameters
    ----------
    places : sequence of int
        Column, counted from ``ref_qw``, in which each of the true w x y z stands.
    signs : sequence of float
        Sign of each.
    origin : Origin
        Columns of the file, which the remedy names.
    """
    last = "has its scalar last" if places[0] == 3 else ""
    turned = [f"ref_q{PARTS[place]}" for place, sign in zip(places, signs, strict=True) if sign < 0.0]
    if len(turned) == 3:
        other = (
            "is the inverse: it takes vectors of the reference frame into the body, or its angle counts the other way"
        )
    elif turned:
        hand = " (a left-handed reference)" if len(turned) == 2 else " (mirrored)"
        other = f"has the wrong sign in {' and '.join(turned)}{hand}"
    else:
        other = ""
    to_do = [*(["Put the scalar first"] if last else [])]
    to_do += ["conjugate it" if len(turned) == 3 else f"turn the sign of {' and '.join(turned)}"] if turned else []
    said = {
        f"ref_q{part}": f"{'-' if sign < 0.0 else ''}ref_q{PARTS[place]}"
        for part, place, sign in zip(PARTS, places, signs, strict=True)
        if sign < 0.0 or PARTS[place] != part
    }
    remedy = " and ".join(to_do)
    return (
        f"The reference attitude {', and '.join(each for each in (last, other) if each)}.",
        f"{capital(remedy)}: " + read_anew(said, origin) + ".",
    )


def clock(factor: float, origin: Origin) -> Words:
    """Say that the true time is a multiple of `t`."""
    size = f"{factor:g} times as long as" if factor > 1.0 else f"1/{1.0 / factor:g} as long as"
    return (
        f"The clock is at another rate: by the turns of the reference, the steps between rows are {size} in t.",
        "Put t right: " + read_anew({"t": f"t[*{factor:g}]"}, origin) + ".",
    )


def axes(sensor: str, matrix: Array, left: str, other: str | Remedy | None, origin: Origin) -> Words:
    """Say which axes of a sensor are exchanged or turned round; `other` is another remedy."""
    if np.array_equal(matrix, -np.eye(3)):
        what = f"{sensor} has the opposite sign on every axis"
        if sensor == "acc":
            what += ": gravity instead of specific force, or a reference whose vertical axis points the other way"
    else:
        handed = "" if np.linalg.det(matrix) > 0.0 else " (a left-handed set of axes)"
        name = SENSOR_NAMES[sensor]
        what = f"The axes of the {name} are exchanged or turned round{handed}: {_shown(sensor, matrix)}"
    remedy = "Put them right with " + read_anew(mapping(sensor, matrix), origin)
    remedy += "." if other is None else ", or: " + other
    return f"{what}. Read so, the residual falls {left}.", remedy


def _shown(sensor: str, matrix: Array) -> str:
    """Say what each axis of a sensor shows, such as ``gyr_x shows -y``, where it is not its own."""
    other = [i for i in range(3) if not np.array_equal(matrix[i], np.eye(3)[i])]
    return ", ".join(f"{sensor}_{AXES[i]} shows {_signed(matrix[i], '')}" for i in other)


def mapping(sensor: str, matrix: Array) -> dict[str, str]:
    """Return the mapping of columns that undoes a signed permutation, such as gyr_x from gyr_y and gyr_y from gyr_x.

    Parameters
    ----------
    sensor : str
        Its prefix.
    matrix : ndarray
        (3, 3) signed permutation P: the reading is P times the true vector.
    """
    back = matrix.T
    other = [i for i in range(3) if not np.array_equal(back[i], np.eye(3)[i])]
    return {f"{sensor}_{AXES[i]}": _signed(back[i], f"{sensor}_") for i in other}


def _turn(matrix: Array) -> str:
    """Say a rotation as angle and axis."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - costs a fifth of a second that many commands do not need

    vector = Rotation.from_matrix(matrix).as_rotvec()
    angle = float(np.linalg.norm(vector))
    axis = vector / max(angle, 1e-12)
    named = [k for k in range(3) if abs(abs(axis[k]) - 1.0) < 1e-6]
    if named:
        return f"{np.degrees(angle):.0f} deg about {'-' if axis[named[0]] < 0 else ''}{AXES[named[0]]}"
    numbers = ", ".join(f"{value:.3g}" for value in axis)
    return f"{np.degrees(angle):.0f} deg about ({numbers})"


def _signed(row: Array, prefix: str) -> str:
    k = int(np.argmax(np.abs(row)))
    return f"{'-' if row[k] < 0.0 else ''}{prefix}{AXES[k]}"


def late(lag: float, correlation: float, declared: float, path: Path | None) -> Words:
    """Say that the reference's stamps are late by a lag, s, and how well the rates agree then and as declared."""
    return (
        f"The reference is {abs(lag):.2f} s {'late' if lag > 0.0 else 'early'} against the sensors (correlation of "
        f"the rates {correlation:.2f}, {declared:.2f} as declared).",
        "Shift the reference: " + _joined(path, f"{lag:.4f}"),
    )


def skew(lag: float, rate: float, correlation: float, declared: float, path: Path | None) -> Words:
    """Say that the reference's clock runs at another rate, from a lag on, s, and how well the rates agree then."""
    apart = f"{abs(lag):.2f}"
    begins = f"{apart} s {'late' if lag > 0.0 else 'early'}" if float(apart) else "together with it"
    return (
        f"The clock of the reference runs {100.0 * abs(rate):.3g} % {'fast' if rate > 0.0 else 'slow'} against the "
        f"sensors', and begins {begins} (correlation of the rates {correlation:.2f}, {declared:.2f} as declared).",
        "Put the reference on their clock: " + _joined(path, f"{round(lag, 4) + 0.0:.4f}", rate),
    )


def _joined(path: Path | None, lag: str, rate: float | None = None) -> Remedy:
    """Name the call that joins a log with itself: its reference is moved by a lag, s, and a rate of its clock."""
    python, shell = ("log", "LOG") if path is None else (repr(str(path)), shlex.quote(str(path)))
    options = () if lag == UNKNOWN else (("lag", float(lag)),)
    known = Remedy(f"imufit.join({python}, {python}, lag={lag}", f"imufit join {shell} {shell} --lag {lag}", options)
    if rate is not None:
        known += Remedy(f", skew={rate:.6f}", f" --skew {1e6 * rate:.0f}", (("skew", round(rate, 6)),))
    return known + Remedy(").log", " -o joined.parquet")


def another_motion(declared: float, lags: Sequence[tuple[float, float]], *, fits: bool) -> Words:
    """Say that the reference is of another motion; lags, s, with the correlation of the rates at each."""
    shown = " and ".join(f"{lag:.2f} s ({correlation:.2f})" for lag, correlation in lags)
    if fits:
        text = (
            f"As declared, ref_q shows another motion than the sensors (correlation of the rates {declared:.2f}), and "
            f"not one lag alone puts them together, but each of {shown} as well as the other: the motion repeats "
            "itself, or the reference was put together from another recording."
        )
        return text, "Look whether it is the right file; where the lag is known, " + _joined(
            None, UNKNOWN
        ) + " moves it."
    text = (
        "ref_q belongs to another motion: its rates and those of the gyroscope have nothing in common at any time "
        f"(correlation {declared:.2f} as declared{f', at best after a lag of {shown}' if shown else ''})."
    )
    return text, "Look for the reference of this recording, and whether it is of the same body."


def smoothed(corner: float, lost: float) -> Words:
    """Say that the reference was smoothed, from which frequency on, Hz, and which part of the motion lies there."""
    return (
        f"The reference is smoothed: ref_q shows less than half of every motion faster than {corner:.2g} Hz, in which "
        f"{100.0 * lost:.2g} % of the gyroscope's power lie.",
        "Export the reference without its low-pass filter.",
    )


def reference_stands(swing: float) -> Words:
    """Say that the reference does not move, while the gyroscope turned by an angle in rad."""
    return (
        f"The reference does not move: ref_q stands at one attitude, while the gyroscope turned by "
        f"{np.degrees(swing):.0f} deg.",
        "Look for a tracker that lost the body, or a column that was filled with one value, and record the reference "
        "again.",
    )


def reference_held(rows: float, rate: float) -> Words:
    """Say that each attitude of the reference is repeated, over so many rows, and how many there are in a second."""
    return (
        f"The reference is held: ref_q repeats each attitude in {rows:.0f} rows, {rate:.3g} of them a second, while "
        "the gyroscope turns.",
        "Write each attitude in the row of its own time alone, and leave ref_* empty in the rows between.",
    )


def own_filter(left: float, unforeseen: float) -> Words:
    """Say that the reference follows the readings: what is left, and what an instrument would leave at least, rad/s."""
    return (
        "The reference was made from the log's own readings: ref_q follows the noise of the gyroscope sample by sample "
        f"(to {quantity.quantity(left, 'rad/s')}, where the noise is {quantity.quantity(unforeseen, 'rad/s')}), as a "
        "filter of these readings does.",
        "Such a filter shares the errors of the sensor: take the reference from another instrument.",
    )


def stuck(sensor: str, axes: str, rows: int, span: tuple[float, float], moved: float) -> Words:
    """Say that a value stood still."""
    which = f"{sensor}_{axes}" if len(axes) == 1 else f"{sensor} ({', '.join(axes)})"
    return (
        f"{which} repeats one value in {rows} rows at {quantity.span(*span)}, while by the reference it should have "
        f"changed by {quantity.quantity(moved, UNITS[sensor])}.",
        "Look for a bus that hangs or a buffer that is read without a new sample; record again.",
    )


def duplicate(sensors: Sequence[str], rows: int, span: tuple[float, float], lag: float) -> Words:
    """Say that a block of samples was recorded twice."""
    return (
        f"The {rows} rows at {quantity.span(*span)} repeat the samples of {' '.join(sensors)} of "
        f"{quantity.quantity(lag, 's')} before, bit for bit.",
        "Delete the copy, and look for a buffer that is written twice.",
    )


def backlog(rows: int, span: tuple[float, float], rate: float, usual: float, *, moved: bool) -> Words:
    """Say that rows are stamped with their arrival."""
    harmless = "" if moved else " The body was at rest, so they do no harm here."
    return (
        f"{rows} rows at {quantity.span(*span)} come at {rate:.0f} a second instead of {usual:.0f}: their times are "
        f"those of arrival, not of sampling.{harmless}",
        "Let the sensor stamp its samples, or cut these rows off.",
    )


def jump(when: float, turned: float, read: float) -> Words:
    """Say that the reference goes on somewhere else, the time, s, and by how much both turned in that step, rad."""
    return (
        f"From the row at t = {when:.6g} s to the next the reference turns by {np.degrees(turned):.3g} deg and the "
        f"gyroscope by {np.degrees(read):.2g} deg: rows were lost there and t goes on as if none were missing, or the "
        "reference jumped.",
        f"Cut the log in two at t = {when:.6g} s, and let the sensor stamp its samples instead of counting rows.",
    )


def clipped(channel: str, end: float, rows: int, span: tuple[float, float]) -> Words:
    """Say that readings stand at the end of a range."""
    sensor = channel[:3]
    return (
        f"{channel} stands at the end of its range, {quantity.quantity(end, UNITS[sensor])}, in {rows} rows at "
        f"{quantity.span(*span)}.",
        f"Set a larger range, or move less; {sensor}.saturation models the loss.",
    )


def wrapped(sensor: str, end: float, again: int, beyond: int) -> Words:
    """Say that readings beyond the range came in again at the other end."""
    return (
        f"Beyond {quantity.quantity(end, UNITS[sensor])} the readings of {sensor} come in again at the other end of "
        f"the range: in {again} of {beyond} samples in which the reference shows more than that.",
        "Set a larger range; or find where the reading is cut to fewer bits, and record again.",
    )


def knock(when: float, width: float, turn: Sequence[float]) -> Words:
    """Say that the mount shifted at one instant, known to within a width, by a turn in rad about each axis."""
    angle = np.degrees(np.linalg.norm(turn))
    axes = ", ".join(quantity.quantity(value, "rad") for value in turn)
    return (
        f"From {when:.4g} s on (within {width:.2g} s) every sensor is turned by {angle:.3g} deg against the reference "
        f"(x y z {axes}): the mount shifted, or the reference jumped.",
        f"Fasten sensor and markers, and record again, or cut the log in two at {when:.4g} s.",
    )
