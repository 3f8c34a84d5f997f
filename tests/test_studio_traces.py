"""Columns of a log as points on a screen: measured, reference, covariates, predicted and residual."""

import numpy as np
import pytest
from imufit.lab.simulate import simulate
from imufit.log import Log, LogStream
from imufit.loop import SensorModel
from imufit.studio import traces as module
from imufit.studio.traces import Kind, ModelTraces, Points, Traces


@pytest.fixture(scope="module")
def log():
    return simulate("handheld", {"gyr.bias": {"x": 0.02, "y": -0.01, "z": 0.03}}, 3, 60.0).to_log()


@pytest.fixture(scope="module")
def long():
    """A log of more rows than are read again for a window of 100 pixels, with a gap, a spike and a slow column."""
    n = 50_000
    t = np.arange(n) * 0.01
    t[30_000:] += 20.0
    acc = np.column_stack([np.sin(t), np.cos(t), np.full(n, -9.8)])
    acc[12_345, 0] = 30.0
    slow = np.where(np.arange(n) % 10 == 0, t, np.nan)
    return Log(t, acc=acc, covariates={"speed": slow})


def test_channels_are_the_columns_with_their_kind_and_unit(log):
    found = {channel.name: channel for channel in Traces(log).channels}
    assert found["acc_x"].kind is Kind.MEASURED
    assert found["acc_x"].unit == "m/s^2"
    assert found["ref_qw"].kind is Kind.REFERENCE
    assert found["temp"].kind is Kind.COVARIATE
    assert "t" not in found
    assert len(found) == len([v for v in log.table().values() if v.dtype != object]) - 1


def test_wide_window_shows_spike_and_gap_and_a_narrow_one_the_rows(long):
    traces = Traces(long)
    traces.build()
    assert traces.rows == long.n
    wide = traces.window(["acc_x", "speed"], *traces.span, 100)
    assert np.nanmax(wide["acc_x"].high) == 30.0
    assert wide["acc_x"].t.size <= 200
    for points in wide.values():
        (gap,) = np.flatnonzero(np.isnan(points.low))
        assert points.t[gap] == pytest.approx(310.0, abs=6.0)
    narrow = traces.window(["acc_x", "speed"], 123.0, 124.0, 200)
    inside = (long.t >= 123.0) & (long.t <= 124.0)
    shown = (narrow["acc_x"].t >= 123.0) & (narrow["acc_x"].t <= 124.0)
    assert np.array_equal(narrow["acc_x"].t[shown], long.t[inside])
    assert np.array_equal(narrow["acc_x"].low[shown], long.acc[inside, 0])
    # lines reach the edges of the window, and samples of a slow column are joined
    assert narrow["acc_x"].t[0] < 123.0
    assert narrow["acc_x"].t[-1] > 124.0
    assert not np.isnan(narrow["speed"].low).any()


def test_unknown_column_is_a_key_error(long):
    traces = Traces(long)
    traces.build()
    for window in ((0.0, 1.0), traces.span):
        with pytest.raises(KeyError, match="acc_w"):
            traces.window(["acc_w"], *window, 100)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_log_on_disk_gives_the_points_of_the_log_in_memory(long, tmp_path, suffix):
    path = tmp_path / f"long{suffix}"
    long.write(path)
    held = Traces(long)
    held.build()
    with Traces(LogStream(path)) as traces:
        traces.build()
        for window in ((0.0, 520.0), (299.0, 321.0), (123.4, 123.5)):
            for name in ("acc_x", "speed"):
                ours, theirs = (each.window([name], *window, 100)[name] for each in (traces, held))
                for one, other in zip(ours, theirs, strict=True):
                    np.testing.assert_allclose(one, other, rtol=1e-9)
        # a window inside the rows that were read last reads nothing
        reads = []
        traces._read_again._read = lambda *given: reads.append(given)
        traces.window(["speed"], 123.42, 123.48, 100)
        assert not reads
        copies = [] if traces._copy is None else [traces._copy.name]
    assert len(copies) == (suffix == ".csv")
    assert all(not (tmp_path / copy).exists() for copy in copies)


def test_windows_are_there_while_the_log_is_still_read(long):
    traces, seen = Traces(long), []
    traces.build(lambda done, total, _words: seen.append((done, total, traces.window(["acc_x"], *traces.span, 10))))
    assert [(done, total) for done, total, _ in seen] == [(long.n, long.n)]
    assert seen[0][2]["acc_x"].t.size


def built(log, fit):
    """The traces of a log, and those of a model fitted to it, after their passes."""
    traces = Traces(log)
    traces.build()
    model = ModelTraces(traces, fit.analysis.logs[0], fit.analysis.own_step(0, fit.estimate.step))
    model.build()
    return traces, model


def test_residual_and_predicted_are_those_of_the_fit(log):
    fit = SensorModel(["gyr.bias"]).fit(log)
    _, model = built(log, fit)
    assert {channel.name for channel in model.channels} >= {"gyr_x", "acc_z"}
    residual, predicted = model.window(["gyr_x"], 10.0, 11.0, 500)["gyr_x"]
    inside = (residual.t >= 10.0) & (residual.t <= 11.0)
    rows = (log.t >= 10.0) & (log.t <= 11.0)
    expected = fit.residuals("gyr")[rows, 0]
    np.testing.assert_allclose(residual.low[inside], expected, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(predicted.low[inside], log.gyr[rows, 0] - expected, rtol=0.0, atol=1e-12)


def test_wide_residual_comes_from_the_pyramid_and_keeps_the_extremes(log, monkeypatch):
    monkeypatch.setattr(module, "EVALUATED", 500)
    fit = SensorModel().fit(log)
    traces, model = built(log, fit)
    residual, _ = model.window(["gyr_z"], *traces.span, 50)["gyr_z"]
    exact = fit.residuals("gyr")[:, 2]
    assert residual.t.size <= 100
    assert np.nanmax(residual.high) == pytest.approx(np.nanmax(exact), abs=1e-12)
    assert np.nanmin(residual.low) == pytest.approx(np.nanmin(exact), abs=1e-12)
    narrow, _ = model.window(["gyr_z"], 30.0, 31.0, 500)["gyr_z"]
    inside = (narrow.t >= 30.0) & (narrow.t <= 31.0)
    np.testing.assert_allclose(narrow.low[inside], exact[(log.t >= 30.0) & (log.t <= 31.0)], rtol=0.0, atol=1e-9)


def test_rows_that_an_excerpt_leaves_out_have_a_residual_in_a_narrow_window(log, monkeypatch):
    """A long log is judged by stretches; where a person looks between them, the model is evaluated all the same."""
    exact = SensorModel().fit(log).residuals("acc")[:, 1]
    monkeypatch.setattr("imufit.log.excerpt.MOST_ROWS", 2400)
    monkeypatch.setattr(module, "EVALUATED", 500)
    fit = SensorModel().fit(log)
    judged = fit.analysis.logs[0].passes.log
    assert judged.n == 2400 < log.n
    traces, model = built(log, fit)
    wide, _ = model.window(["acc_y"], *traces.span, 400)["acc_y"]
    assert np.isnan(wide.low).sum() > 20  # between the stretches
    narrow, _ = model.window(["acc_y"], 20.0, 22.0, 500)["acc_y"]
    inside = (narrow.t >= 20.0) & (narrow.t <= 22.0)
    assert not np.isnan(narrow.low).any()
    np.testing.assert_allclose(narrow.low[inside], exact[(log.t >= 20.0) & (log.t <= 22.0)], rtol=0.0, atol=1e-9)


def test_window_with_few_judged_rows_shows_rows_from_all_over_it(log, monkeypatch):
    exact = SensorModel().fit(log).residuals("acc")[:, 1]
    monkeypatch.setattr("imufit.log.excerpt.MOST_ROWS", 1200)
    monkeypatch.setattr(module, "EVALUATED", 1280)
    fit = SensorModel().fit(log)
    _, model = built(log, fit)
    begin, end = 15.0, 35.0
    found, _ = model.window(["acc_y"], begin, end, 2000)["acc_y"]
    seen = np.isfinite(found.low)
    assert seen.sum() > 400  # the few judged rows are four blocks
    shown = found.t[seen]
    assert np.histogram(shown, bins=3, range=(begin, end))[0].min() > 60  # all over the window
    rows = np.searchsorted(log.t, shown - 1e-9)
    np.testing.assert_allclose(found.low[seen], exact[rows], rtol=0.0, atol=1e-9)


def test_model_of_a_log_without_reference_is_refused_in_words():
    log = simulate("six_sides", {}, 1, 60.0).to_log().with_fields(ref_q=None)
    fit = SensorModel().fit(log)
    with pytest.raises(module.InputError, match="no reference attitude"):
        ModelTraces(Traces(log), fit.analysis.logs[0], fit.analysis.own_step(0, fit.estimate.step))


def test_line_of_points_covers_low_and_high_and_breaks_over_gaps():
    points = Points(np.arange(4.0), np.array([1.0, 2.0, np.nan, 4.0]), np.array([1.0, 3.0, np.nan, 5.0]))
    t, values = points.line()
    assert t.tolist() == [0.0, 0.75, 1.25, 2.0, 2.75, 3.25]
    np.testing.assert_array_equal(values, [1.0, 2.0, 3.0, np.nan, 4.0, 5.0])


def test_line_of_a_slope_is_no_staircase():
    t = np.arange(30.0)
    points = Points(t, -t - 0.5, -t + 0.5)
    times, values = points.line()
    assert np.all(np.diff(times) > 0.0)
    assert np.all(np.diff(values)[1::2] <= 0.0)
    np.testing.assert_allclose(values[2:-2], -times[2:-2], atol=0.3)
