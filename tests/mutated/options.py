"""Options of every command, read off the command line itself, with values as meant and as nobody means them."""

from random import Random

import click
from imufit.cli.app import imufit

from mutated.hostile import NAMES, NUMBERS, TEXTS

FILTERS = (
    "accel",
    "gyro",
    "complementary",
    "kalman",
    "triad",
    "mahony",
    "madgwick",
    "quest",
    "hybrid",
    "mekf",
    "smoother",
)

# fmt: off
EFFECTS = (
    "acc.bias", "acc.scale", "acc.misalignment", "acc.bias_temperature", "acc.scale_temperature", "acc.bias_drift",
    "acc.quadratic", "acc.cubic", "acc.lever_arm", "acc.vibration_rectification", "acc.delay", "acc.lowpass",
    "acc.saturation", "gyr.bias", "gyr.scale", "gyr.misalignment", "gyr.bias_temperature", "gyr.scale_temperature",
    "gyr.bias_drift", "gyr.warmup", "gyr.quadratic", "gyr.cubic", "gyr.scale_asymmetry", "gyr.g_sensitivity",
    "gyr.earth_rate", "gyr.vibration_rectification", "gyr.delay", "gyr.lowpass", "gyr.saturation", "mag.hard_iron",
    "mag.soft_iron", "mag.current", "mag.field_reference", "mag.bias_temperature", "mag.scale_temperature",
    "mag.delay", "ref.alignment", "ref.tilt", "ref.delay", "ref.skew", "ref.lowpass", "rig.backlash", "rig.flexure",
    "rig.periodic", "acc.column:vbat", "gyr.column:motor_current", "mag.column:vbat",
)
# fmt: on
"""The ids of the public contract."""

# Nothing that exists outside the folder: an output that is written over it would be lost.
FOLDERS = ("missing/folder/x", "/proc/nope/x", ".", "/", "", "nul\x00.csv", "x" * 300, "-")

PATHS = ("output", "json", "settings", "model", "answer", "effects-from")

LEFT_OUT = {"live", "port", "on", "header", "keep", "form", "help", "html", "plot"}
"""Options that need a device, or are drawn apart since figures and pages take a second."""

MEANT = {
    "map": ("acc_x=acc_x[g]", "acc_x=-acc_y", "t=t[ms]", "t=row[50Hz]", "temp=temp[K]", "acc_x=acc_x[*0.5+1]"),
    "cost": ("vector", "magnitude"),
    "sensor": ("acc", "gyr", "mag"),
    "hold": ("0.2", "1"),
    "band": ("0.1", "5"),
    "filter": (*FILTERS, "mahony,mekf", "complementary,kalman"),
    "set": ("mahony.kp=1", "kalman.acc_noise=0.01", "mekf.acc_noise=0.1", "complementary.gain=0.1"),
    "gain": ("kp", "gain", "acc_noise"),
    "by": ("error", "prediction"),
    "metric": ("total", "heading", "inclination"),
    "horizon": ("0.5", "2"),
    "to": ("c-header", "arduino", "imufusion", "ahrs", "json"),
    "effects": (*EFFECTS, "acc.bias,gyr.bias", "gyr.scale,gyr.misalignment,ref.alignment", ",".join(EFFECTS)),
    "effect": tuple(EFFECTS),
    "size": ("large", "small"),
    "duration": ("6",),
    "rate": ("50",),
    "seed": ("1",),
    "hidden": ("1",),
    "fault": ("stuck", "knock"),
    "frame": ("NED", "ENU", "NWU"),
    "rests": ("6",),
    "settings": ("settings.toml",),
    "model": ("model.toml", "wide.toml", "calibration.toml"),
    "answer": ("answer.json", "ladder.json", "compare.json"),
}
"""Values as they are meant, by the option's name without dashes."""

ASSIGNED = (
    "mahony.kp",
    "kalman.acc_noise",
    "mekf.gyr_noise",
    "replay.start",
    "accel.x",
    "complementary.gain",
    "gyr.bias:x",
)
MAPPED = ("t", "acc_x", "gyr_z", "temp", "vbat", "pose", "ref_qw")
UNITS = (
    "g",
    "*nan",
    "*inf",
    "*1e308",
    "*0",
    "0 LSB/g",
    "1e400 LSB/g",
    "16384 LSB/g + inf",
    "furlong",
    "",
    "g]",
    "[g",
    "K",
)


def options(command: str) -> dict[str, click.Option]:
    """Return the options of a command by their long names; empty for a command that is not there."""
    found = imufit.commands.get(command)
    return {
        max(option.opts, key=len).lstrip("-"): option
        for option in (found.params if found else ())
        if isinstance(option, click.Option)
    }


def drawable(command: str) -> list[str]:
    return [name for name in options(command) if name not in LEFT_OUT]


def meant(rng: Random, name: str, option: click.Option) -> list[str]:
    """Write an option with a value that people use; nothing where none is known."""
    if option.is_flag:
        return [f"--{name}"]
    return [f"--{name}", rng.choice(MEANT[name])] if name in MEANT else []


def unmeant(rng: Random, name: str, option: click.Option) -> list[str]:
    """Write an option with a value that nobody means."""
    flag = f"--{name}"
    if option.is_flag:
        return [flag, flag]
    number, text = rng.choice(NUMBERS), rng.choice((*NAMES, *TEXTS))
    source, unit, effect = rng.choice((*MAPPED, *NAMES)), rng.choice(UNITS), rng.choice(EFFECTS)
    values = {
        "map": (f"{rng.choice(MAPPED)}={source}[{unit}]", f"{text}=acc_x", f"t=row[{number}Hz]", text),
        "set": (f"{rng.choice(ASSIGNED)}={number}", f"{text}=1", text),
        "effect": (f"{effect}:x={number}", f"{text}:x=1", text),
        "effects": (text, f"{effect},{text}", f"acc.column:{text}", ",".join(EFFECTS * 2)),
        **dict.fromkeys(PATHS, (*FOLDERS, *NAMES[:20], f"{text[:200]}.csv", "log.csv")),
    }.get(name, (number, number, text))
    return [flag, rng.choice(values), *(["gain"] if option.nargs == 2 else [])]
