"""Allan deviation: the estimator against allantools, what is read off, and what cannot be seen."""

import json
from dataclasses import replace

import allantools
import numpy as np
import pytest
from cli_stand_in import run, strict_json
from imufit import _imufit
from imufit.allan_deviation import allan, filter_noise
from imufit.errors import InputError
from imufit.lab.simulate import Noise, SensorNoise
from imufit.log import Log, read
from imufit.replaying import read_settings

STEP = 0.01


def still(seconds: float = 600.0, seed: int = 1, *, white=(0.02, 1e-3, 0.3), walk: float = 0.0) -> Log:
    """A sensor that lies still, its noise drawn by the simulator."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(round(seconds / STEP))
    acc, gyr, mag = (SensorNoise(size, random_walk=walk if k == 1 else 0.0) for k, size in enumerate(white))
    noise = Noise(acc=acc, gyr=gyr, mag=mag)
    return Log.from_arrays(
        t,
        acc=noise.acc.draw(rng, t) + np.array([0.0, 0.0, 9.80665]),
        gyr=noise.gyr.draw(rng, t) + 0.01,
        mag=noise.mag.draw(rng, t) + np.array([20.0, 0.0, 40.0]),
        frame="NWU",
    )


def flicker(n: int, size: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of the bias instability `size` of IEEE Std 952: its two-sided density is size^2 / (2 pi f)."""
    frequency = np.fft.rfftfreq(n, STEP)
    density = np.zeros_like(frequency)
    density[1:] = 2.0 * size**2 / (2.0 * np.pi * frequency[1:])
    spectrum = np.sqrt(0.25 * density * n / STEP) * (rng.normal(size=(2, frequency.size)) * [[1.0], [1j]]).sum(axis=0)
    return np.fft.irfft(spectrum, n)


def gyro_alone(readings: np.ndarray) -> Log:
    rest = still(len(readings) * STEP)
    return replace(rest, gyr=readings, mag=None)


def test_it_is_the_estimator_of_allantools():
    log = still(100.0, walk=1e-4)
    for channel in allan(log).channels.values():
        readings = getattr(log, channel.name[:3])[:, "xyz".index(channel.name[-1])]
        _, expected, _, terms = allantools.oadev(readings, rate=1.0 / STEP, data_type="freq", taus=channel.tau)
        np.testing.assert_allclose(channel.deviation, expected, rtol=1e-9)
        factors = np.rint(channel.tau / STEP).astype(int).tolist()
        # Of phases there is one more than of readings: allantools counts as many differences as this does.
        assert _imufit.allan_deviation([np.ascontiguousarray(readings)], factors)[1] == list(terms)


@pytest.mark.parametrize(("kind", "alpha"), [("quantisation", 2), ("white", 0), ("flicker", -1), ("walk", -2)])
def test_degrees_of_freedom_are_those_of_allantools(kind, alpha):
    for samples, factor in [(1000, 1), (1000, 2), (1000, 10), (100_000, 333), (500, 100)]:
        expected = allantools.edf_simple(samples + 1, factor, alpha)
        assert _imufit.allan_freedom(kind, samples, factor) == pytest.approx(max(1.0, expected), rel=1e-9)


def test_white_noise_and_random_walk_are_recovered_within_their_errors():
    misses = []
    for seed in range(4):
        found = allan(still(1800.0, seed, white=(0.02, 1e-3, 0.3), walk=5e-5), sensors=("acc", "gyr"))
        for channel in found.channels.values():
            size = {"acc": 0.02, "gyr": 1e-3}[channel.name[:3]]
            white = channel.terms["white"]
            misses.append((white.value - size * np.sqrt(STEP)) / white.standard_error)
            assert channel.scatter == pytest.approx(size, rel=0.01)
            assert channel.noise_density == pytest.approx(size * np.sqrt(2.0 * STEP), rel=0.02)
            if channel.name.startswith("gyr"):
                walk = channel.terms["walk"]
                misses.append((walk.value - 5e-5) / walk.standard_error)
    assert np.abs(misses).max() < 4.0
    assert 0.5 < np.sqrt(np.mean(np.square(misses))) < 1.6


def test_bias_instability_is_recovered_where_the_curve_has_a_floor():
    rng = np.random.default_rng(5)
    size, n = 2e-4, 2**18
    readings = np.stack([flicker(n, size, rng) for _ in range(3)], axis=1) + rng.normal(0.0, 1e-3, (n, 3))
    for channel in list(allan(gyro_alone(readings)).channels.values())[3:]:
        term = channel.terms["flicker"]
        assert term.value == pytest.approx(size, abs=4.0 * term.standard_error, rel=0.1)
        assert channel.terms["walk"].value is None
        assert not channel.still_falling


def test_a_short_log_says_what_it_cannot_show():
    found = allan(still(60.0))
    for channel in found.channels.values():
        assert channel.terms["flicker"].value is None
        assert channel.terms["walk"].value is None
        assert channel.terms["white"].value is not None
        assert channel.still_falling
        assert channel.terms["flicker"].at_most > 0.0
    assert any("no floor within 60 s" in remark for remark in found.remarks)
    assert "<" in str(found)


def test_quantisation_of_the_integral_is_read_off():
    rng = np.random.default_rng(2)
    angle = np.round(rng.uniform(-5e-4, 5e-4, (60_001, 3)) / 1e-12) * 1e-12
    found = allan(gyro_alone(np.diff(angle, axis=0) / STEP))
    expected = np.sqrt(1e-3**2 / 12.0)
    for axis in "xyz":
        term = found.channels[f"gyr_{axis}"].terms["quantisation"]
        assert term.value == pytest.approx(expected, rel=0.02)


def test_a_filter_in_the_sensor_is_left_out_of_the_fit():
    rng = np.random.default_rng(3)
    t = STEP * np.arange(60_000)
    noise = SensorNoise.from_density(1e-3, 5.0)
    log = replace(still(600.0), gyr=noise.draw(rng, t))
    found = allan(log)
    for axis in "xyz":
        channel = found.channels[f"gyr_{axis}"]
        assert channel.tau_start > 2.0 * STEP
        assert channel.noise_density == pytest.approx(
            1e-3, abs=4.0 * np.sqrt(2.0) * channel.terms["white"].standard_error
        )
    assert any("left out of the fit" in remark for remark in found.remarks)


def test_lost_rows_and_gaps_change_nothing_but_the_certainty():
    log = still(300.0, 7)
    kept = np.random.default_rng(1).random(log.n) > 0.01
    kept[[0, -1]] = True
    kept[12_000:13_000] = False
    whole, holed = allan(log).channels["gyr_y"], allan(log.select(kept)).channels["gyr_y"]
    common = min(len(whole.tau), len(holed.tau))
    assert holed.step == pytest.approx(STEP, rel=1e-9)
    np.testing.assert_allclose(holed.tau[:common], whole.tau[:common])
    sure = whole.freedom[:common] > 100.0
    np.testing.assert_allclose(holed.deviation[:common][sure], whole.deviation[:common][sure], rtol=0.1)
    assert (holed.freedom[:common] <= whole.freedom[:common]).all()


def test_a_slow_magnetometer_has_its_own_step():
    log = still(100.0)
    mag = log.mag.copy()
    mag[np.arange(log.n) % 5 != 0] = np.nan
    channel = allan(replace(log, mag=mag)).channels["mag_x"]
    assert channel.step == pytest.approx(0.05)
    assert channel.scatter == pytest.approx(0.3, rel=0.05)


def moved(log: Log) -> Log:
    """Turned for five seconds in the middle."""
    turning = (log.t >= 40.0) & (log.t < 45.0)
    gyr, acc = log.gyr.copy(), log.acc.copy()
    gyr[turning] += 1.0
    acc[turning] += np.random.default_rng(0).normal(0.0, 3.0, (turning.sum(), 3))
    return replace(log, gyr=gyr, acc=acc)


def test_only_the_longest_rest_of_a_moving_log_is_used():
    found = allan(moved(still(180.0)))
    assert found.duration == pytest.approx(135.0, abs=1.5)
    assert "only its longest rest" in found.notes[0]
    for name, size in (("acc_x", 0.02), ("gyr_z", 1e-3)):
        assert found.channels[name].scatter == pytest.approx(size, rel=0.05)


def test_a_log_that_never_rests_is_refused():
    log = still(20.0)
    acc = log.acc + 5.0 * np.sin(3.0 * log.t)[:, None]
    gyr = log.gyr + np.cos(2.0 * log.t)[:, None]
    with pytest.raises(InputError, match="never rests"):
        allan(replace(log, acc=acc, gyr=gyr))


def test_it_feeds_the_noise_floor_and_the_filters():
    log = still(200.0)
    found = allan(log)
    noise = found.to_log(log).metadata.noise
    assert noise == pytest.approx({"acc": 0.02, "gyr": 1e-3, "mag": 0.3}, rel=0.02)
    kalman = filter_noise(found)["kalman"]
    assert kalman["gyr_noise"] == pytest.approx(1e-3 * np.sqrt(STEP), rel=0.03)
    assert kalman["acc_noise"] == pytest.approx(0.02 * np.sqrt(STEP) / 9.80665, rel=0.03)
    assert "bias_walk" not in kalman


def test_results_come_as_table_json_frame_and_figure():
    found = allan(still(60.0))
    value = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert set(value["channels"]) == {f"{sensor}_{axis}" for sensor in ("acc", "gyr", "mag") for axis in "xyz"}
    frame = found.to_dataframe()
    assert len(frame) == sum(len(channel.tau) for channel in found.channels.values())
    assert (frame["low"] < frame["deviation"]).all()
    assert (frame["deviation"] < frame["high"]).all()
    assert len(found.plot().axes) == 3


def test_command(capsys, tmp_path):
    path, out_path, toml = tmp_path / "rest.parquet", tmp_path / "known.parquet", tmp_path / "noise.toml"
    still(60.0).write(path)
    code, out, err = run(
        capsys, "allan", path, "-o", out_path, "--settings", toml, "--plot", tmp_path / "allan.png", "--json", "-"
    )
    assert (code, err) == (0, [])
    value = strict_json(out)
    assert read(out_path).metadata.noise == pytest.approx(value["noise"])
    assert read_settings(toml) == value["filters"]
    assert (tmp_path / "allan.png").stat().st_size > 0
    code, out, err = run(capsys, "replay", path, "--filter", "kalman", "--settings", toml, "--json", "-")
    assert (code, err) == (0, [])
    code, out, err = run(capsys, "allan", path)
    assert (code, err) == (0, [])
    assert "noise density" in out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[kalmann]\nacc_noise = 1.0\n", "Did you mean kalman"),
        ("[kalman]\nacc_nois = 1.0\n", "Did you mean acc_noise"),
        ('[kalman]\nacc_noise = "1"\n', "not a number"),
        ("kalman = 3\n", "not a table"),
        ("[kalman\n", "not valid TOML"),
    ],
)
def test_wrong_settings_files_are_refused(capsys, tmp_path, text, said):
    path, toml = tmp_path / "rest.parquet", tmp_path / "settings.toml"
    still(1.0).write(path)
    toml.write_text(text, encoding="utf-8")
    code, out, err = run(capsys, "replay", path, "--filter", "kalman", "--settings", toml)
    assert (code, out) == (2, "")
    assert len(err) == 1
    assert said in err[0]
