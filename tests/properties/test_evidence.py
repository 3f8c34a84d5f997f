"""Evidence is a sum over rows: however a log is cut, the same comes out."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable

import numpy as np
import pytest
from engine import NO_FILTERS, analysis_of, pieces, swaying
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from imufit import Log, _imufit, ladder
from imufit.fitting import passes
from imufit.fitting.passes import CHANNELS, chunk_arrays
from imufit.lab import simulate
from imufit.lab.simulate import Noise
from imufit.log.log import concatenate

BLOCKS = 12
FILTERS = [[0.6, -0.2, 0.1], [0.4], [], [0.3, 0.1], [0.5], [0.2], [0.7, -0.1], [], [0.3]]
few = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.data_too_large, HealthCheck.too_slow])


def rugged_log(seed: int = 3, duration: float = 40.0) -> Log:
    """Jitter, lost rows, a slow magnetometer and thermometer, gaps in sensors and reference."""
    noise = Noise(jitter=1e-3, dropped=0.02, mag_rate=20.0, attitude_deg=0.01, position=1e-4)
    log = simulate.simulate(
        "handheld", {"gyr.bias": None}, seed, duration, noise=noise, covariates=("motor_current",), size="large"
    ).to_log()
    log.gyr[700:760] = np.nan
    log.acc[1500, 1] = np.nan
    log.ref_q[2100:2150] = np.nan
    log.ref_p[900:905] = np.nan
    log.temp[np.arange(log.n) % 10 != 0] = np.nan
    kept = np.ones(log.n, np.bool_)
    kept[2600:2900] = False
    return log.select(kept)


class Rugged:
    """The log and its analysis, out of sight of hypothesis, which would print all of it."""

    def __init__(self) -> None:
        self.log = rugged_log()
        self.analysis = analysis_of(self.log).logs[0]


@pytest.fixture(scope="module")
def rugged():
    return Rugged()


def taken(analysis, filters, chunks: Iterable[dict]) -> _imufit.Evidence:
    asked = [(effect, [0.0] * len(effect.parameters)) for effect in analysis.surveyed.effects.values()]
    evidence = _imufit.Evidence(analysis.facts, [], asked, BLOCKS, filters)
    for chunk in chunks:
        evidence.add(chunk)
    return evidence


def assert_same(
    one: _imufit.Evidence,
    other: _imufit.Evidence,
    blocks: Iterable[int | None] = (None, *range(BLOCKS)),
    within: float = 1e-9,
) -> None:
    for channel in range(len(CHANNELS)):
        assert one.count(channel) == other.count(channel)
        for block in blocks:
            a, b = one.gram(channel, block), other.gram(channel, block)
            assert (a is None) == (b is None)
            if a is not None:
                size = np.sqrt(np.diag(a))
                assert np.all(np.abs(a - b) <= within * np.outer(size, size)), f"{CHANNELS[channel]}, block {block}"


@pytest.mark.parametrize("filters", [NO_FILTERS, FILTERS], ids=["white", "whitened"])
@given(data=st.data())
@few
def test_pieces_sum_to_the_whole_wherever_the_log_is_cut(rugged, filters, data):
    log, analysis = rugged.log, rugged.analysis
    cuts = data.draw(st.lists(st.integers(1, log.n - 1), max_size=8))
    margin = analysis.facts.margin + data.draw(st.integers(0, 300))
    names = analysis.passes.covariates
    whole = taken(analysis, filters, pieces(log, names, [], 0))
    chunks = pieces(log, names, cuts, margin)
    assert_same(whole, taken(analysis, filters, chunks))

    merged = taken(analysis, filters, [])
    for chunk in data.draw(st.permutations(chunks)):
        merged.merge(taken(analysis, filters, [chunk]))
    assert_same(whole, merged)


@given(rows=st.integers(50, 5000), extra=st.integers(0, 100))
@few
def test_chunks_of_any_size_give_the_same_evidence(rugged, rows, extra):
    log, analysis = rugged.log, rugged.analysis
    chunks = [chunk_arrays(c, analysis.passes.covariates) for c in log.chunks(rows, analysis.facts.margin + extra)]
    whole = taken(analysis, FILTERS, pieces(log, analysis.passes.covariates, [], 0))
    assert_same(whole, taken(analysis, FILTERS, chunks))


def test_evidence_of_different_questions_cannot_be_added():
    log = swaying(duration=5.0, noise=1.0)
    facts = analysis_of(log).logs[0].facts
    bias, arm = ((_imufit.find_effect(key), [0.0, 0.0, 0.0]) for key in ("gyr.bias", "acc.lever_arm"))
    one = _imufit.Evidence(facts, [], [bias], BLOCKS, NO_FILTERS)
    for other in (
        _imufit.Evidence(facts, [], [arm], BLOCKS, NO_FILTERS),
        _imufit.Evidence(facts, [], [bias], BLOCKS + 1, NO_FILTERS),
        _imufit.Evidence(facts, [], [bias], BLOCKS, FILTERS),
    ):
        with pytest.raises(ValueError, match="different layouts"):
            one.merge(other)


def test_evidence_around_other_parameters_cannot_be_added():
    log = swaying(duration=5.0, noise=1.0)
    facts = analysis_of(log).logs[0].facts
    bias = _imufit.find_effect("gyr.bias")
    one, other = (_imufit.Evidence(facts, [(bias, [x, 0.0, 0.0])], [], BLOCKS, NO_FILTERS) for x in (0.0, 1.0))
    with pytest.raises(ValueError, match="different layouts"):
        one.merge(other)


def test_two_recordings_of_one_sensor_add_up():
    halves = [swaying(duration=20.0, noise=1.0, seed=seed) for seed in (1, 2)]
    later = halves[1].t + halves[0].t[-1] + 30.0
    whole = concatenate([halves[0], Log(**{**vars(halves[1]), "t": later})])
    analysis = analysis_of(whole).logs[0]
    names = analysis.passes.covariates
    both = taken(analysis, NO_FILTERS, pieces(whole, names, [], 0))
    # The gap keeps the two apart, so that each may be read without the other.
    parts = []
    for piece, start in ((whole.rows(0, halves[0].n), 0), (whole.rows(halves[0].n, whole.n), halves[0].n)):
        (chunk,) = pieces(piece, names, [], 0)
        parts.append(taken(analysis, NO_FILTERS, [{**chunk, "offset": start}]))
    parts[0].merge(parts[1])
    # Time counted from another start is rounded elsewhere; every second derivative multiplies that by 1/dt^2, and what
    # a reference loses of a force is a fourth derivative of its position.
    assert_same(both, parts[0], within=1e-7)


@pytest.mark.parametrize("effects", [{"gyr.g_sensitivity": None}, {"acc.scale": None, "mag.hard_iron": None}, {}])
def test_answers_do_not_depend_on_the_size_of_chunks(effects, monkeypatch):
    noise = Noise.realistic()
    log = simulate.simulate("handheld", effects, 5, 40.0, noise=noise, size="large", noise_in_metadata=False).to_log()
    answers = []
    for rows in (65536, 617):
        monkeypatch.setattr(passes, "CHUNK_ROWS", rows)
        answers.append(ladder(log))
    first = answers[0]
    assert set(first.model) == set(effects)
    for other in answers[1:]:
        assert other.model == first.model
        assert other.verdict == first.verdict
        assert [c.effect for c in other.first.candidates[:3]] == [c.effect for c in first.first.candidates[:3]]
        assert other.ratio_end == pytest.approx(first.ratio_end, rel=1e-6)
        for a, b in zip(first.fit.parameters, other.fit.parameters, strict=True):
            assert abs(a.value - b.value) < 1e-4 * a.standard_error
            assert a.standard_error == pytest.approx(b.standard_error, rel=1e-4)


SCRIPT = """
import json
from imufit import ladder
from imufit.lab import simulate
log = simulate.simulate("arm", {"acc.bias": None, "gyr.scale": None}, 2, 40.0, size="large").to_log()
answer = ladder(log)
print(json.dumps([answer.to_dict(), answer.diagnosis.to_dict(), answer.comparison_end.to_dict()], sort_keys=True))
"""


def test_answers_do_not_depend_on_the_number_of_threads():
    answers = []
    for threads in ("1", "3"):
        environment = {**os.environ, "RAYON_NUM_THREADS": threads}
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
        )
        answers.append(json.loads(run.stdout))
    assert answers[0][0]["verdict"] == "adequate"
    assert answers[0] == answers[1]


@pytest.mark.parametrize(("mag_rate", "correlation_time"), [(5.0, 2.0), (2.0, 2.0), (1.0, 2.0)])
def test_a_slow_magnetometer_keeps_its_samples_when_its_noise_is_coloured(mag_rate, correlation_time):
    coloured = simulate.SensorNoise(0.1, coloured=0.5, correlation_time=correlation_time)
    noise = Noise(mag_rate=mag_rate, mag=coloured)
    log = simulate.simulate("handheld", {}, 1, 240.0, noise=noise, noise_in_metadata=False).to_log()
    analysis = analysis_of(log, "mag.hard_iron").logs[0]
    index = CHANNELS.index("mag_x")
    assert analysis.filters[index]
    assert analysis.white.count(index) > 0.9 * np.isfinite(log.mag[:, 0]).sum()
