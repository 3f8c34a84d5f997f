"""Whether a serial line carries what a device sends, and the highest rate at which it does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imufit.devices.emulate.device import Device
from imufit.devices.emulate.form import Binary, Text, cell
from imufit.errors import InputError
from imufit.remedy import keyword, option

BITS = 10
"""Bits of the line for a byte: start, eight, stop."""
PROBED = 20000
"""Rows by which the length of a line of text is judged."""
LATEST = np.uint32(0xFFFFFFFF)


@dataclass(frozen=True)
class Load:
    """The load of a device on its line.

    Attributes
    ----------
    a_row : float
        Bytes of a row with what every row has.
    a_second : float
        Bytes a second besides: announcements, and what slower sensors add to their rows.
    """

    a_row: float
    a_second: float

    def bytes_a_second(self, rate: float) -> float:
        """Return the load at a rate.

        Parameters
        ----------
        rate : float
            Rows a second.
        """
        return self.a_row * rate + self.a_second

    def highest_rate(self, baud: int) -> float:
        """Return the highest whole number of rows a second that a line carries.

        Parameters
        ----------
        baud : int
            Bits a second.

        Raises
        ------
        InputError
            Not even one row a second.
        """
        rate = float(np.floor((baud / BITS - self.a_second) / self.a_row))
        if rate < 1.0:
            raise InputError(
                f"a line of {baud} baud carries less than one sample a second",
                remedy="Give a higher " + keyword("baud") + ".",
            )
        return rate


def load_of(device: Device, form: Binary | Text) -> Load:
    """Return what a device puts on its line in a form.

    Parameters
    ----------
    device : Device
        Its streams and readings.
    form : Binary or Text
        A form of its own, which is used up.
    """
    if isinstance(form, Text):
        step = max(1, len(device.values) // PROBED)
        values = device.values[::step]
        # The longest cell of each column: lines must fit whatever the readings are.
        cells = [max(len(cell(v)) for v in column) for column in values.T.tolist()]
        return Load(float(len(str(LATEST)) + sum(1 + width for width in cells) + 2), 0.0)
    full = np.nan_to_num(device.values[:1])
    widths = device.widths
    first = full.copy()
    first[:, widths[0] :] = np.nan
    a_row = len(form.rows(np.array([LATEST]), first)[0])
    a_second, at = float(len(form.announce())), widths[0]
    for (rate, *_), width in zip(device.streams[1:], widths[1:], strict=True):
        one = np.full_like(full, np.nan)
        one[:, : widths[0]], one[:, at : at + width] = full[:, : widths[0]], full[:, at : at + width]
        a_second += rate * (len(form.rows(np.array([LATEST]), one)[0]) - a_row)
        at += width
    return Load(float(a_row), a_second)


def check(load: Load, rate: float, baud: int) -> None:
    """Refuse a rate that the line does not carry.

    Parameters
    ----------
    load : Load
        What the device sends.
    rate : float
        Rows a second of real time.
    baud : int
        Bits a second.

    Raises
    ------
    InputError
        States the highest rate that fits.
    """
    if load.bytes_a_second(rate) > baud / BITS:
        raise InputError(
            f"{rate:g} samples a second are {load.bytes_a_second(rate):.0f} bytes a second, but a line of {baud} baud "
            f"carries {baud / BITS:.0f}",
            remedy="Use "
            + option("rate", load.highest_rate(baud), shell=f"{load.highest_rate(baud):g}")
            + ", which is the highest that fits, or "
            + option("rate", "max"),
        )
