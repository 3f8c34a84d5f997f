"""Noise settings of the filters, from an Allan deviation."""

from __future__ import annotations

from imufit import _imufit
from imufit.allan_deviation.result import Allan

_SETTINGS = {"acc_noise": ("acc", "white"), "gyr_noise": ("gyr", "white"), "mag_noise": ("mag", "white")}
_WALKS = {"bias_walk": ("gyr", "walk")}


def filter_noise(found: Allan) -> dict[str, dict[str, float]]:
    """Return the noise settings of every filter that has such settings, to be given to `imufit.replaying.replay`.

    A filter's noise density is the random walk N of the integral (IEEE Std 952): the variance of the integral grows by
    N^2 in a second. That is 1/sqrt(2) of the one-sided density in data sheets. Where a filter wants the noise of an
    angle instead of that of the readings, the accelerometer's N is divided by gravity and the magnetometer's by the
    length of the field. A figure that the log does not show keeps the filter's default.

    These are the noises of a sensor at rest. In motion the specific force is not gravity, and `acc_noise` has to be
    larger: `imufit.tune` finds out how much.

    Parameters
    ----------
    found : Allan
        Of a log at rest.

    Returns
    -------
    dict
        Filter, setting, value.
    """
    settings: dict[str, dict[str, float]] = {}
    lengths = {"acc": found.gravity, "mag": found.field}
    for name, description in _imufit.filter_descriptions().items():
        for setting, entry in description["settings"].items():
            sensor, kind = {**_SETTINGS, **_WALKS}.get(setting, ("", ""))
            value = found.term(sensor, kind) if sensor else None
            if value is None:
                continue
            length = lengths.get(sensor)
            if sensor in lengths and entry["unit"].startswith("rad"):
                if length is None:
                    continue
                value /= length
            settings.setdefault(name, {})[setting] = value
    return settings
