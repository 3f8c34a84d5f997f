"""Channels over time in a report: true samples, the extremes among them, in memory that does not grow with the log."""

from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit.comparing import compare_with_rows, rows_of_fit
from imufit.comparing.traces import STRETCHES, _Kept
from imufit.diagnosing.ladder import ladder
from imufit.figures.spectrum import lines
from imufit.log import Log
from imufit.results import ResidualTrace
from imufit.results.residual_trace import extreme_rows, stretches_of


@pytest.fixture(scope="module")
def log() -> Log:
    return imufit.simulate(
        "handheld", {"acc.scale": None, "gyr.bias_temperature": None}, 5, 60.0, size="large"
    ).to_log()


@pytest.fixture(scope="module")
def climbed(log: Log) -> imufit.Ladder:
    return ladder(imufit.SensorModel().fit(log))


@pytest.fixture(scope="module")
def traces(climbed: imufit.Ladder) -> dict[str, ResidualTrace]:
    return {trace.channel: trace for trace in rows_of_fit(climbed.fit, climbed.start).traces}


def at(log: Log, trace: ResidualTrace, values: np.ndarray) -> np.ndarray:
    """Values of the rows of a log that a trace holds; NaN where the line is interrupted."""
    rows = np.searchsorted(log.t, trace.t)
    np.testing.assert_array_equal(log.t[rows], trace.t)
    return values[rows]


def test_a_trace_holds_samples_of_the_log_and_their_residuals(
    log: Log, climbed: imufit.Ladder, traces: dict[str, ResidualTrace]
) -> None:
    assert set(climbed.model) == {"acc.scale", "gyr.bias_temperature"}
    assert len(traces) == 9
    for channel, trace in traces.items():
        sensor, axis = channel[:3], "xyz".index(channel[-1])
        np.testing.assert_array_equal(trace.measured, at(log, trace, getattr(log, sensor)[:, axis]))
        after, before = (fit.residuals(sensor)[:, axis] for fit in (climbed.fit, climbed.start))
        np.testing.assert_array_equal(trace.residual, at(log, trace, after))
        np.testing.assert_array_equal(trace.before, at(log, trace, before))
        assert np.nanmax(trace.residual) == np.nanmax(after)
        assert np.nanmin(trace.before) == np.nanmin(before)
        assert trace.t.size <= 6 * STRETCHES


def test_what_an_effect_adds_is_what_the_residual_lacks(traces: dict[str, ResidualTrace]) -> None:
    trace = traces["acc_y"]
    assert set(trace.parts) == {"acc.scale"}
    # Everything else that is fitted along moves a little, too.
    left = trace.before - trace.residual - trace.parts["acc.scale"]
    assert np.nanmax(np.abs(left)) < 0.02 * np.nanmax(np.abs(trace.parts["acc.scale"]))
    assert set(traces["mag_x"].parts) == set()


def test_a_candidate_explains_what_the_evidence_predicts(log: Log, climbed: imufit.Ladder) -> None:
    best = climbed.first.best
    assert best is not None
    trace = next(each for each in rows_of_fit(climbed.start, candidate=best).traces if best in each.parts)
    assert trace.model == best
    assert trace.first_model == "the ideal sensor"
    assert np.nanstd(trace.residual) < 0.8 * np.nanstd(trace.before)


def test_a_model_as_it_stands_has_one_residual(log: Log) -> None:
    comparison, rows = compare_with_rows(imufit.SensorModel(), log)
    assert comparison.to_dict() == imufit.compare(log).to_dict()
    assert {part.channel for part in rows.noise} == {trace.channel for trace in rows.traces}
    assert {trace.before for trace in rows.traces} == {None}
    assert rows.field is not None
    assert rows.field.shape[1] == 3
    assert len(rows.field) <= 400
    assert rows.rests == ()


def test_a_stream_has_the_traces_of_the_log_in_memory(tmp_path: Path, log: Log) -> None:
    path = tmp_path / "log.parquet"
    log.write(path)
    held, streamed = (
        compare_with_rows(imufit.SensorModel(), imufit.open_log(path, stream=stream))[1].traces
        for stream in (False, True)
    )
    for one, other in zip(held, streamed, strict=True):
        np.testing.assert_array_equal(one.t, other.t)
        np.testing.assert_array_equal(one.residual, other.residual)


@pytest.mark.parametrize("piece", [997, 16_384, 100_000])
def test_the_extremes_of_two_million_rows_stay_however_they_are_cut(piece: int) -> None:
    n = 2_000_000
    rng = np.random.default_rng(2)
    t = 0.01 * np.arange(n)
    measured, residual = np.sin(t), rng.standard_normal(n)
    residual[1_234_567], residual[7] = 40.0, -50.0
    rows = slice(0, n) if piece > 997 else slice(1_200_000, 1_260_000)
    t, measured, residual = t[rows], measured[rows], residual[rows]
    kept = _Kept(float(t[0]), float(t[-1]))
    for first in range(0, t.size, piece):
        cut = slice(first, first + piece)
        kept.add(t[cut], [measured[cut], residual[cut]], [2.0 * measured[cut]])
    times, series, parts = kept.lines(0.01)
    assert times.size <= 4 * STRETCHES
    assert (series[1].max(), series[1].min()) == (residual.max(), residual.min())
    np.testing.assert_array_equal(parts[0], 2.0 * series[0])
    found = np.searchsorted(t, times)
    np.testing.assert_array_equal(series[1], residual[found])
    stretch = stretches_of(t, float(t[0]), float(t[-1]), STRETCHES)
    np.testing.assert_array_equal(found, extreme_rows(stretch, [measured, residual]))


def test_a_line_is_interrupted_over_a_gap_and_stays_so_where_it_is_thinned() -> None:
    t = np.r_[np.arange(0.0, 40.0, 0.01), np.arange(60.0, 100.0, 0.01)]
    kept = _Kept(0.0, 100.0)
    kept.add(t, [np.sin(t), np.cos(t)], [])
    times, (measured, residual), _ = kept.lines(0.01)
    gap = np.flatnonzero(np.isnan(measured))
    assert gap.size == 1
    assert 40.0 < times[gap[0]] < 60.0
    thin = ResidualTrace("gyr_x", "rad/s", times, measured, residual, None).thinned(20)
    assert thin.t.size < 0.5 * times.size
    assert np.isnan(thin.measured).sum() == 1
    assert np.nanmax(thin.residual) == np.nanmax(residual)


def test_missing_values_are_never_extremes() -> None:
    values = np.array([np.nan, 3.0, 1.0, np.nan, np.nan, np.nan, 2.0, 2.0])
    stretch = np.array([0, 0, 0, 1, 1, 2, 2, 2])
    assert extreme_rows(stretch, [values]).tolist() == [1, 2, 6]


def test_a_line_in_a_spectrum_is_marked_and_noise_is_not() -> None:
    rng = np.random.default_rng(8)
    assert sum(len(lines(rng.exponential(size=256))) for _ in range(300)) <= 3
    density = rng.exponential(size=256)
    density[100] += 60.0
    assert lines(density) == [100]
    assert lines(1.0 / np.arange(1.0, 257.0) ** 3) == []
