"""Hand-made results of one loop: a gyroscope with g-sensitivity, as the engine would hand them over."""

import math

import numpy as np
from imufit.results import (
    Addition,
    AttitudeBins,
    AttitudeComparison,
    AttitudeDependence,
    Candidate,
    ChannelResidual,
    Comparison,
    Diagnosis,
    EffectCard,
    Ladder,
    LogRows,
    NoisePart,
    Panel,
    Parameter,
    ResidualTrace,
    Rival,
    Spectrum,
    Step,
    Unexplained,
    Where,
)

G_SENSITIVITY = tuple(
    Parameter("gyr.g_sensitivity", name, value, 2.1e-6, "rad/s/(m/s^2)", 3e-5)
    for name, value in zip(
        ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"),
        (3.6e-5, -1e-6, 2e-6, 4e-6, 1.9e-5, 0.0, 1e-6, 3e-6, 1.4e-4),
        strict=True,
    )
)
BIAS = tuple(
    Parameter("gyr.bias", name, value, 2e-5, "rad/s", 0.02)
    for name, value in zip("xyz", (0.01, -0.02, 0.004), strict=True)
)


def attitude(before, after):
    """Errors of a filter whose heading goes with the rate."""
    errors = [
        None if total is None else {"total": total, "heading": 0.8 * total, "inclination": 0.6 * total}
        for total in (before, after)
    ]
    x = np.linspace(0.0, 200.0, 10)
    bins = tuple(
        AttitudeBins(part, "angular_rate", "deg/s", x, before * x / 200.0, (after or before) * x / 200.0)
        for part in ("heading", "inclination")
    )
    goes_with = (AttitudeDependence("heading", "angular_rate", 0.83, 0.05),)
    return AttitudeComparison(
        "mahony", *errors, goes_with, bins, "filter", f"The attitude of mahony is off by {before}."
    )


def panel(channel, covariate, unit, share, shape):
    """Panel whose mean follows `shape` over -1..1."""
    x = np.linspace(-1.0, 1.0, 21)
    scale = {"t": 600.0, "temp": 20.0, "acc_x": 9.8, "acc_y": 9.8, "gyr_x": 2.0}.get(covariate, 1.0)
    floor = 0.05 if channel.startswith("acc") else 0.002
    return Panel(
        channel,
        covariate,
        "m/s^2" if channel.startswith("acc") else "rad/s",
        unit,
        scale * x,
        floor * shape(x),
        floor * (0.05 + 0.1 * x**2),
        floor,
        share,
    )


def comparison():
    """Comparison of the biased model, NaN included."""
    channels = tuple(
        ChannelResidual(f"{sensor}_{axis}", ratio * floor, 0.01 * floor, floor, ratio, unit, 120_000)
        for sensor, unit, floor, ratios in (
            ("acc", "m/s^2", 0.05, (1.01, 1.0, 1.02)),
            ("gyr", "rad/s", 0.002, (1.52, 1.18, float("nan"))),
        )
        for axis, ratio in zip("xyz", ratios, strict=True)
    )
    covariates = (
        ("t", "s"),
        ("temp", "degC"),
        ("acc_x", "m/s^2"),
        ("acc_y", "m/s^2"),
        ("gyr_x", "rad/s"),
        ("motor", "A"),
    )
    panels = []
    for place, channel in enumerate(item.channel for item in channels):
        for covariate, unit in covariates:
            steep = channel == "gyr_x" and covariate == "acc_y"
            bent = channel == "gyr_y" and covariate == "temp"
            shape = (
                (lambda x: 2.4 * x)
                if steep
                else (lambda x: 1.2 * np.abs(x))
                if bent
                else (lambda x, p=place: 0.05 * np.sin(9 * x + p))
            )
            panels.append(panel(channel, covariate, unit, 0.63 if steep else 0.21 if bent else 0.004, shape))
    frequency = np.geomspace(0.05, 50.0, 120)
    spectra = tuple(
        Spectrum(
            item.channel,
            item.unit + "/sqrt(Hz)",
            frequency,
            1e-4 * (1.0 + (40.0 if item.channel == "gyr_x" else 0.3) / (1.0 + (8 * np.log(frequency / 0.7)) ** 2)),
            1e-4,
        )
        for item in channels
    )
    return Comparison(
        120_000,
        1200.0,
        ("gyr.bias",),
        channels,
        {"acc": 1.01, "gyr": 1.38},
        attitude(3.21, None),
        (Where("gyr_x", "acc_y", 0.63, 120.0, 900.0), Where("gyr_y", "temp", 0.21, 0.0, 300.5)),
        tuple(panels),
        spectra,
        ((300.0, 360.0, "gyr_x", 1.93), (60.0, 120.0, "gyr_y", 1.4)),
        ("The noise floor is estimated from 14 s of rest.",),
    )


def diagnosis(verdict="missing"):
    """Diagnosis with a clear winner, or an ambiguous, unknown or adequate one."""
    rows = (
        ("gyr.g_sensitivity", 3e-9, 1.03, 0.41, G_SENSITIVITY, (Rival("gyr.misalignment", 0.31),), "significant"),
        ("gyr.misalignment", 0.004, 1.41, 0.09, (), (Rival("gyr.g_sensitivity", 0.31),), "significant"),
        ("gyr.bias_temperature", 0.31, 1.519, 0.01, (), (), "not significant"),
        ("acc.cubic", 1.0, 1.523, -0.01, (), (), "not significant"),
        ("mag.soft_iron", math.nan, math.nan, math.nan, (), (), "not testable here"),
    )
    candidates = tuple(
        Candidate(
            effect,
            status,
            1.52,
            after,
            "Acceleration bends the sensing structure." if status == "significant" else "",
            1.0 - p,
            -math.log(p),
            gain,
            0.02,
            parameters,
            rivals,
            {item.name: (5e-6, item.unit) for item in parameters} or {"x": (1e-4, "rad/s")},
        )
        for effect, p, after, gain, parameters, rivals, status in rows
    )
    missing = verdict == "missing"
    return Diagnosis(
        verdict,
        "gyr.g_sensitivity" if missing else None,
        ("gyr.g_sensitivity", "gyr.misalignment") if verdict == "ambiguous" else (),
        candidates if verdict != "adequate" else candidates[2:],
        (Unexplained("gyr_x", "motor", 0.4, "V-shaped", 100.0, 220.0),) if verdict == "unknown" else (),
        ("gyr.bias",),
        "Turn the sensor about y at rest, then shake it along x." if verdict == "ambiguous" else None,
        "Gyro x reads 0.02 deg/s per g: acceleration bends the sensing structure." if missing else "",
        (),
    )


def trace(channel, samples=900, effects=("gyr.bias", "gyr.g_sensitivity")):
    """Trace of one channel with a spike, a gap and effects that go with time."""
    rng = np.random.default_rng(len(channel) + ord(channel[-1]))
    t = np.linspace(0.0, 1200.0, samples)
    floor = 0.05 if channel.startswith("acc") else 0.002
    parts = {effect: floor * (1 + place) * np.sin(t / (100.0 + 50 * place)) for place, effect in enumerate(effects)}
    measured = 5.0 * floor * np.cos(t / 60.0)
    residual = rng.normal(scale=floor, size=samples)
    residual[samples // 3] = 9.0 * floor
    before = residual + sum(parts.values(), np.zeros(samples))
    for line in (measured, residual, before, *parts.values()):
        line[samples // 2] = np.nan
    unit = "m/s^2" if channel.startswith("acc") else "rad/s"
    return ResidualTrace(channel, unit, t, measured, residual, before, parts, floor, " + ".join(effects), "the ideal")


def rows(samples=900, effects=("gyr.bias", "gyr.g_sensitivity")):
    """Rows of the log: six channels, a field on its sphere."""
    field = np.random.default_rng(4).normal(size=(300, 3))
    field *= 48.0 / np.linalg.norm(field, axis=1, keepdims=True)
    names = [f"{sensor}_{axis}" for sensor in ("acc", "gyr") for axis in "xyz"]
    return LogRows(tuple(trace(name, samples, effects) for name in names), field + np.array([4.0, -3.0, 2.0]))


def noise():
    """Parts of the noise floor of two channels."""
    return tuple(
        NoisePart(channel, component, 1e-4, "rad/s", share)
        for channel in ("gyr_x", "gyr_y")
        for component, share in (("white", 0.7), ("reference", 0.3), ("random_walk", 0.4))
    )


def addition():
    """The winner added."""
    return Addition(
        "gyr.g_sensitivity", 1.52, 1.03, 1.04, True, BIAS + G_SENSITIVITY, ("gyr.bias", "gyr.g_sensitivity"), None
    )


def ladder(large=True):
    """Ladder of three steps with a large fall, or of none."""
    steps = (
        Step("gyr.bias", 23.1, 1.61, 1.6, 1.59),
        Step("gyr.g_sensitivity", 1.6, 1.07, 1.08, 1.06),
        Step("gyr.bias_temperature", 1.08, 1.02, 1.07, 1.0),
    )
    return Ladder(
        steps if large else (),
        tuple(step.effect for step in steps) if large else (),
        "adequate",
        23.1 if large else 1.01,
        1.07 if large else 1.01,
        attitude(3.2, 0.41) if large else None,
        diagnosis("adequate"),
        comparison(),
        comparison(),
        diagnosis(),
        None,
        "Nothing that this log can show is missing.",
    )


def card():
    """Card of g-sensitivity."""
    return EffectCard(
        "gyr.g_sensitivity",
        "gyr",
        "g-sensitivity",
        "Acceleration bends the sensing structure of the gyroscope.",
        "G f",
        tuple((item.name, item.unit, item.typical) for item in G_SENSITIVITY),
        "Residual rate grows in proportion to specific force.",
        "gyr.misalignment if every turn is about gravity",
        "Six static poses.",
    )
