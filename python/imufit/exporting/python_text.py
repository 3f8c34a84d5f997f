"""Pieces of Python text that several forms share."""

from __future__ import annotations

from imufit.exporting.affine import Affine, Array


def head(model: Affine, *lines: str) -> str:
    """Comments at the head of a file, and those on each sensor's parameters."""
    said = [line for sensor in model.sensors.values() for line in sensor.parameters]
    return "\n".join(f"# {line}".rstrip() for line in (*model.remarks(), *said, *lines))


def array(values: Array) -> str:
    """Return an array as a call of numpy, every digit kept."""
    return f"np.array({values.tolist()!r})"
