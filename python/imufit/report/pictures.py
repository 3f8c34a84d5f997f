"""The figures of a report, each with the name of its file, drawn as wide as is asked."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Final

import numpy as np

from imufit.figures import style
from imufit.results.noise_part import drawn_noise
from imufit.results.parameter import drawn_parameters

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from imufit.results import (
        Addition,
        AttitudeBins,
        Comparison,
        Diagnosis,
        Ladder,
        LogRows,
        NoisePart,
        Panel,
        Parameter,
        ResidualTrace,
        Spectrum,
    )

WIDE: Final = 11.2
"""Width of a figure that fills the page, inches at 96 pixels: 1075 of them."""
SMALL: Final = 4.1
"""Width of a figure with others beside it, inches."""
PHONE: Final = 3.75
"""Width of a figure that fills a phone's page, inches: 360 pixels."""
PANELS_OF_WORST, PANELS_OF_OTHERS = 6, 2
"""Covariates that are drawn for the worst channel and for each of the others: 22 panels take 220 kB of a page, and two
seconds to draw."""
STRETCHES_OF_OTHERS: Final = 90
"""Stretches of time that the still figure of another channel keeps apart: four pixels each in 400."""
CANDIDATES_DRAWN: Final = 12


@dataclass(frozen=True)
class Picture:
    """One figure of a report.

    Attributes
    ----------
    name : str
        Name of its file, without an ending.
    description : str
        Contents, for readers who cannot see it.
    draw : callable
        Makes the figure, as wide as is asked (inches).
    width : float or None
        Its usual width, inches; None fills the page.
    """

    name: str
    description: str
    draw: Callable[[float], style.PlainFigure]
    width: float | None = None

    def complete(self) -> style.PlainFigure:
        """Draw it at its usual width, with its layout found."""
        figure = self.draw(self.width or WIDE)
        figure.lay_out()
        return figure


@dataclass(frozen=True)
class Pictures:
    """All figures of a report by the question that they answer.

    Attributes
    ----------
    fall, noise, candidates, proposed, parameters : Picture or None
        The error over the steps; the parts of the noise floor; the ranked effects; predicted and fitted parameters.
    traces : tuple of Picture
        One per channel, the worst first.
    panels : dict of str to list of Picture
        Residual against covariates, by channel, the worst first.
    spectra, allan, attitude, space : tuple of Picture
        Residual by frequency; Allan deviation; attitude error; the sensor in space.
    """

    fall: Picture | None = None
    noise: Picture | None = None
    candidates: Picture | None = None
    proposed: Picture | None = None
    parameters: Picture | None = None
    traces: tuple[Picture, ...] = ()
    panels: dict[str, list[Picture]] = field(default_factory=dict)
    spectra: tuple[Picture, ...] = ()
    allan: tuple[Picture, ...] = ()
    attitude: tuple[Picture, ...] = ()
    space: tuple[Picture, ...] = ()

    def __iter__(self) -> Iterator[Picture]:
        """Every figure, in the order of the page."""
        for single in (self.fall, self.noise):
            if single is not None:
                yield single
        yield from self.traces
        for panels in self.panels.values():
            yield from panels
        yield from (*self.spectra, *self.allan, *self.attitude)
        for single in (self.candidates, self.proposed, self.parameters):
            if single is not None:
                yield single
        yield from self.space


def pictures(
    comparison: Comparison | None = None,
    diagnosis: Diagnosis | None = None,
    ladder: Ladder | None = None,
    *,
    addition: Addition | None = None,
    rows: LogRows | None = None,
) -> Pictures:
    """List the figures of whatever results there are, as `page` shows them.

    Parameters
    ----------
    comparison, diagnosis, ladder, addition : optional
        The results.
    rows : LogRows, optional
        Rows of the log.
    """
    if ladder is not None:
        comparison = comparison or ladder.comparison_start
        diagnosis = diagnosis or ladder.first or ladder.diagnosis
    best = None if diagnosis is None else diagnosis.best_candidate
    fitted = fitted_parameters(ladder, addition)
    order = worst_first(comparison)
    return Pictures(
        fall=_fall(ladder, addition),
        noise=_noise(noise_of(ladder, diagnosis, rows)),
        candidates=_sized(
            "candidates",
            "Expected held-out error of the ranked candidates",
            1.6 + 0.3 * min(len(diagnosis.candidates), CANDIDATES_DRAWN),
            diagnosis.plot,
        )
        if diagnosis is not None and diagnosis.candidates
        else None,
        proposed=_parameters("predicted_parameters", "Predicted parameters over their typical sizes", best.parameters)
        if best is not None
        else None,
        parameters=_parameters("fitted_parameters", "Fitted parameters over their typical sizes", fitted),
        traces=_traces(rows, order),
        panels=_panels(comparison.panels, order) if comparison is not None else {},
        spectra=_spectra(comparison.spectra, order) if comparison is not None else (),
        allan=_allan(rows),
        attitude=_attitude(comparison, ladder),
        space=_space(fitted or (best.parameters if best is not None else ()), rows),
    )


def worst_first(comparison: Comparison | None) -> list[str]:
    """Return the channels of a comparison, the one furthest over its floor first.

    Parameters
    ----------
    comparison : Comparison or None
        None has no channels.
    """
    channels = comparison.channels if comparison is not None else ()
    ranked = sorted(channels, key=lambda item: -item.ratio if math.isfinite(item.ratio) else math.inf)
    return [item.channel for item in ranked]


def noise_of(ladder: Ladder | None, diagnosis: Diagnosis | None, rows: LogRows | None) -> tuple[NoisePart, ...]:
    """Return the parts of the noise floor, from the last answer or else from the rows.

    Parameters
    ----------
    ladder, diagnosis, rows : optional
        The results.
    """
    last = ladder.diagnosis if ladder is not None else diagnosis
    return (last.noise if last is not None else ()) or (rows.noise if rows is not None else ())


def _noise(parts: Sequence[NoisePart]) -> Picture | None:
    if not parts:
        return None
    height = 1.6 + 0.26 * len({part.channel for part in parts})
    words = "Parts of the noise floor of each channel"
    return _sized("noise_floor_parts", words, height, lambda figure: drawn_noise(parts, figure))


def in_order(traces: Sequence[ResidualTrace], order: Sequence[str]) -> list[ResidualTrace]:
    """Return traces in the order of their channels; channels that are not listed come last.

    Parameters
    ----------
    traces : sequence of ResidualTrace
        One per channel.
    order : sequence of str
        Channels.
    """
    return sorted(traces, key=lambda trace: order.index(trace.channel) if trace.channel in order else len(order))


def fitted_parameters(ladder: Ladder | None, addition: Addition | None) -> tuple[Parameter, ...]:
    """Return the parameters of the final model; none where nothing was fitted.

    Parameters
    ----------
    ladder, addition : optional
        The results.
    """
    if addition is not None:
        return tuple(addition.parameters)
    return tuple(getattr(ladder.fit, "parameters", ()) or ()) if ladder is not None else ()


def _sized(
    name: str, description: str, height: float, draw: Callable[[Figure], object], usual: float | None = None
) -> Picture:
    """Make a picture of what draws itself on a figure."""

    def drawn(width: float) -> style.PlainFigure:
        figure = style.new_figure(width, height)
        draw(figure)
        return figure

    return Picture(name, description, drawn, usual)


def _file_name(text: str) -> str:
    """Return a text as part of a file's name: names of columns may hold any letter."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "column"


def _fall(ladder: Ladder | None, addition: Addition | None) -> Picture | None:
    description = "Held-out error over the noise floor, step by step"
    if ladder is not None:
        return _sized("error_fall", description, 4.2, ladder.plot)
    if addition is None:
        return None

    def drawn(figure: Figure) -> None:
        from imufit.figures.waterfall import waterfall  # noqa: PLC0415

        one = {name: [getattr(addition, name)] for name in ("before", "expected", "after")}
        training = getattr(addition.fit, "training_ratio", math.nan)
        waterfall([addition.effect], **one, training=[training], start=addition.before, ax=figure)

    return _sized("error_fall", description, 4.2, drawn)


def _parameters(name: str, description: str, parameters: Sequence[Parameter]) -> Picture | None:
    # The picture holds values against typical sizes: a column's parameters have none.
    if all(item.typical is None for item in parameters):
        return None
    height = 1.6 + 0.28 * len(parameters)
    return _sized(name, description, height, lambda figure: drawn_parameters(parameters, figure))


def _traces(rows: LogRows | None, order: Sequence[str]) -> tuple[Picture, ...]:
    traces = rows.traces if rows is not None else ()
    return tuple(
        _sized(
            f"trace_{_file_name(trace.channel)}",
            f"{trace.channel} over time: measured, predicted and residual",
            4.6,
            trace.plot if not place else trace.thinned(STRETCHES_OF_OTHERS).plot,
            SMALL if place else None,
        )
        for place, trace in enumerate(in_order(traces, order))
    )


def _panels(panels: Sequence[Panel], order: Sequence[str]) -> dict[str, list[Picture]]:
    """Residual against the covariates of largest share, by channel."""
    found: dict[str, list[Picture]] = {}
    for place, channel in enumerate(order):
        own = sorted(
            (panel for panel in panels if panel.channel == channel),
            key=lambda panel: -panel.share if math.isfinite(panel.share) else math.inf,
        )
        # A covariate that explains nothing is drawn only where none explains more.
        own = [panel for panel in own if panel.share > 0.0] or own[:1]
        for number, panel in enumerate(own[: PANELS_OF_OTHERS if place else PANELS_OF_WORST]):
            found.setdefault(channel, []).append(
                _sized(
                    f"residual_{_file_name(channel)}_{number + 1}_{_file_name(panel.covariate)}",
                    f"Binned residual of {channel} against {panel.covariate}",
                    2.4,
                    panel.plot,
                    SMALL,
                )
            )
    return found


def _spectra(spectra: Sequence[Spectrum], order: Sequence[str]) -> tuple[Picture, ...]:
    """Spectra of a sensor's channels, the sensor of the worst channel first."""
    from imufit.figures.spectrum import residual_spectra  # noqa: PLC0415

    sensors = list(dict.fromkeys(channel[:3] for channel in order))
    groups = {key: list(group) for key, group in groupby(spectra, key=lambda spectrum: spectrum.channel[:3])}

    def picture(sensor: str) -> Picture:
        words = f"Spectrum of the residual of {sensor} over its noise floor"
        return _sized(f"spectrum_{sensor}", words, 3.0, lambda figure: residual_spectra(groups[sensor], figure), SMALL)

    return tuple(picture(sensor) for sensor in sorted(groups, key=sensors.index))


def _allan(rows: LogRows | None) -> tuple[Picture, ...]:
    if rows is None or rows.allan is None:
        return ()
    from imufit.figures.allan import allan_figure  # noqa: PLC0415

    channels = list(rows.allan.channels.values())

    def picture(sensor: str) -> Picture:
        own = [channel for channel in channels if channel.name.startswith(f"{sensor}_")]
        return _sized(
            f"allan_{sensor}",
            f"Allan deviation of {sensor} at rest",
            3.0,
            lambda figure: allan_figure(own, figure),
            SMALL,
        )

    return tuple(picture(sensor) for sensor in dict.fromkeys(channel.name[:3] for channel in channels))


def _attitude(comparison: Comparison | None, ladder: Ladder | None) -> tuple[Picture, ...]:
    """Attitude error against each quantity, one picture for each part of the error."""
    found = ladder.attitude if ladder is not None else comparison.attitude if comparison is not None else None
    if found is None:
        return ()
    return tuple(
        _sized(
            f"attitude_{item.part}_{_file_name(item.quantity)}",
            f"Attitude error, {item.part}, against {item.quantity.replace('_', ' ')}",
            2.4,
            partial(_attitude_panel, item),
            SMALL,
        )
        for item in found.bins
    )


def _attitude_panel(item: AttitudeBins, figure: Figure) -> None:
    from imufit.figures.attitude import attitude_panels  # noqa: PLC0415

    attitude_panels([item], "", figure)


def _space(parameters: Sequence[Parameter], rows: LogRows | None) -> tuple[Picture, ...]:
    """Draw the sensor in space, where the model has an effect that turns axes or moves the field."""
    by_effect = {key: {item.name: item.value for item in group} for key, group in groupby(parameters, _effect)}
    found: list[Picture] = []
    for sensor in ("acc", "gyr"):
        if (values := by_effect.get(f"{sensor}.misalignment")) is not None:
            found.append(_axes(sensor, values))
    if "mag.hard_iron" in by_effect or "mag.soft_iron" in by_effect:
        found.append(_iron(by_effect.get("mag.hard_iron", {}), by_effect.get("mag.soft_iron", {}), rows))
    if rows is not None and rows.rests:
        found.append(_rests(rows))
    return tuple(found)


def _effect(parameter: Parameter) -> str:
    return parameter.effect


def _matrix(values: dict[str, float]) -> np.ndarray:
    """Return the matrix with entries named by row and column; those without a name are zero."""
    return np.array([[values.get(row + column, 0.0) for column in "xyz"] for row in "xyz"])


def _axes(sensor: str, values: dict[str, float]) -> Picture:
    def drawn(figure: Figure) -> None:
        from imufit.figures.sensor_3d import misaligned_axes  # noqa: PLC0415

        misaligned_axes(_matrix(values), sensor, figure)

    return _sized(f"axes_{sensor}", f"Sensitive axes of {sensor} beside those of the body", 3.8, drawn, SMALL)


def _iron(hard: dict[str, float], soft: dict[str, float], rows: LogRows | None) -> Picture:
    def drawn(figure: Figure) -> None:
        from imufit.figures.sensor_3d import field_ellipsoid  # noqa: PLC0415

        centre = np.array([hard.get(axis, 0.0) for axis in "xyz"])
        field_ellipsoid(centre, _matrix(soft), None if rows is None else rows.field, figure)

    return _sized("field_ellipsoid", "Measured field, its ellipsoid, and an ideal sensor's sphere", 3.6, drawn, SMALL)


def _rests(rows: LogRows) -> Picture:
    def drawn(figure: Figure) -> None:
        from imufit.figures.sensor_3d import pose_sphere  # noqa: PLC0415

        names, means = zip(*rows.rests, strict=True)
        pose_sphere(np.array(means), names, figure)

    return _sized("poses_on_sphere", "Direction up in the sensor's axes at each rest", 3.6, drawn, SMALL)
