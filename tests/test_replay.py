"""`imufit.replay`: from a log to attitudes, errors, JSON and a log again."""

import json
from dataclasses import replace as with_fields

import numpy as np
import pytest
from imufit import replaying as package
from imufit.log import Log
from imufit.replaying import FILTERS, SETTINGS, estimate_mag_reference, replay
from scipy.spatial.transform import Rotation, RotationSpline

FIELD_ENU = np.array([3.0, 18.0, -43.0])


def made_log(n: int = 2000, mag: bool = True, reference: bool = True, noise: float = 1.0, **metadata: object) -> Log:
    rng = np.random.default_rng(5)
    t = 0.01 * np.arange(n)
    knots = np.linspace(0, t[-1] + 0.01, 20)
    truth = RotationSpline(knots, Rotation.from_rotvec(rng.normal(0, 0.5, (20, 3))))
    r = truth(t)
    back = r.inv()
    acc = back.apply([0, 0, 9.80665]) + noise * rng.normal(0, 0.05, (n, 3))
    field = back.apply(FIELD_ENU) + noise * rng.normal(0, 0.3, (n, 3))
    gyr = truth(t, 1) + noise * rng.normal(0, 0.002, (n, 3))
    return Log.from_arrays(
        t, acc=acc, gyr=gyr, mag=field if mag else None, reference=r if reference else None, frame="ENU", **metadata
    )


def test_the_default_filters_follow_the_reference() -> None:
    result = replay(made_log())
    assert list(result.attitude) == ["gyro", "triad", "mahony"]
    assert all(q.shape == (2000, 4) for q in result.attitude.values())
    for errors in result.errors.values():
        assert errors is not None
        assert 0.0 < errors["total_deg"] < 3.0
        assert errors["total_deg"] ** 2 == pytest.approx(
            errors["heading_deg"] ** 2 + errors["inclination_deg"] ** 2, rel=0.05
        )
        assert errors["sd_deg"] <= errors["total_deg"]
    assert result.skipped == {}


def test_json_has_the_fixed_keys() -> None:
    value = json.loads(json.dumps(replay(made_log()).to_dict(), allow_nan=False))
    assert list(value) == ["n", "skipped", "filters", "tilt", "ranks"]
    assert value["n"] == 2000
    keys = ["total_deg", "heading_deg", "inclination_deg", "roll_deg", "pitch_deg", "yaw_deg", "sd_deg", "tilt"]
    assert all(list(errors) == keys for errors in value["filters"].values())
    without = replay(made_log(reference=False)).to_dict()
    assert without["filters"] == {"gyro": None, "triad": None, "mahony": None}


def test_the_log_gets_a_quaternion_and_three_angles_per_filter() -> None:
    log = made_log()
    result = replay(log, ["mahony"])
    covariates = result.to_log().covariates
    names = [f"mahony_{part}" for part in ("qw", "qx", "qy", "qz", "roll", "pitch", "yaw")]
    assert list(covariates) == names
    euler = result.rotation("mahony").as_euler("ZYX")[:, ::-1]
    np.testing.assert_allclose(np.column_stack([covariates[name] for name in names[4:]]), euler, atol=1e-9)
    table = result.to_dataframe()
    assert list(table)[:8] == ["t", *names]
    rmse = np.sqrt(np.mean(table["mahony_total_deg"] ** 2))
    assert rmse == pytest.approx(result.to_dict()["filters"]["mahony"]["total_deg"], rel=1e-12)
    assert log.covariates == {}


def test_only_rows_in_movement_count() -> None:
    log = made_log()
    movement = (np.arange(log.n) >= 1500).astype(float)
    marked = with_fields(log, covariates={"movement": movement})
    assert log.ref_q is not None
    unseen = log.ref_q.copy()
    unseen[:1500] = np.nan
    cut = with_fields(log, ref_q=unseen, metadata=with_fields(log.metadata, mag_reference=tuple(FIELD_ENU)))
    marked = with_fields(marked, metadata=cut.metadata)
    assert replay(marked).errors == replay(cut).errors
    assert replay(marked).errors != replay(with_fields(log, metadata=cut.metadata)).errors


def test_the_field_in_the_reference_frame_is_the_mean_over_the_log() -> None:
    log = made_log()
    field = estimate_mag_reference(log)
    assert field is not None
    np.testing.assert_allclose(field, FIELD_ENU, atol=0.05)
    np.testing.assert_array_equal(replay(log).mag_reference, field)
    known = made_log(mag_reference=[1.0, 2.0, -40.0])
    np.testing.assert_array_equal(replay(known).mag_reference, [1.0, 2.0, -40.0])
    assert replay(made_log(reference=False)).mag_reference is None


def test_without_a_magnetometer_the_heading_starts_at_the_reference() -> None:
    log = made_log(mag=False)
    assert log.ref_q is not None
    unseen = log.ref_q.copy()
    unseen[:100] = np.nan
    result = replay(with_fields(log, ref_q=unseen))
    assert list(result.attitude) == ["gyro", "mahony"]  # no triad without a field
    assert result.skipped == {"not_started": 100}
    np.testing.assert_allclose(result.attitude["gyro"][100], unseen[100], atol=1e-12)
    assert result.errors["gyro"] is not None
    assert result.errors["gyro"]["total_deg"] < 1.0


def test_the_initial_attitude_can_be_given() -> None:
    log = made_log(noise=0.0)
    given = Rotation.from_rotvec([0.1, 0.2, 0.3])
    w_first = given.as_quat()[[3, 0, 1, 2]]
    for initial in (given, w_first, w_first.tolist()):
        np.testing.assert_allclose(replay(log, ["gyro"], initial=initial).attitude["gyro"][0], w_first, atol=1e-15)
    assert log.ref_q is not None
    by_reference = replay(log, ["gyro"], initial="reference").attitude["gyro"][0]
    np.testing.assert_allclose(by_reference, log.ref_q[0], atol=1e-15)


def test_rows_before_the_start_are_no_rotation() -> None:
    log = made_log()
    assert log.acc is not None
    late = log.acc.copy()
    late[:7] = np.nan
    result = replay(with_fields(log, acc=late), ["mahony"], initial="vectors")
    angles = result.rotation("mahony").as_rotvec()
    assert np.isnan(angles[:7]).all()
    np.testing.assert_allclose(angles[7:], Rotation.from_quat(result.attitude["mahony"][7:, [1, 2, 3, 0]]).as_rotvec())


def test_settings_reach_their_filter() -> None:
    log = made_log()
    a, b = (replay(log, ["mahony"], {"mahony": {"k_p": k_p}}) for k_p in (0.5, 20.0))
    assert np.array_equal(a.attitude["mahony"], replay(log, ["mahony"]).attitude["mahony"])
    assert not np.array_equal(a.attitude["mahony"], b.attitude["mahony"])
    assert all(setting["meaning"] and setting["unit"] for group in SETTINGS.values() for setting in group.values())


def test_a_slow_log_has_no_gaps_by_its_own_measure() -> None:
    log = made_log()
    slow = with_fields(log, t=log.t * 300.0, gyr=log.gyr / 300.0)
    assert replay(slow).skipped == {}
    assert replay(slow, settings={"replay": {"max_gap": 1.0}}).skipped == {"gap": log.n - 1}


def test_no_filter_named_is_every_filter_the_log_allows() -> None:
    assert list(replay(made_log(), ()).attitude) == list(FILTERS)
    assert "triad" not in replay(made_log(mag=False), ()).attitude


def test_progress_is_told() -> None:
    told: list[tuple[int, int, str]] = []
    replay(made_log(), progress=lambda *row: told.append(row))
    assert told[-1][:2] == (3, 3)
    assert "mahony" in told[-2][2]


def test_what_cannot_be_replayed_is_refused() -> None:
    log = made_log(mag=False, reference=False)
    with pytest.raises(ValueError, match="triad needs mag"):
        replay(log, ["triad"])
    with pytest.raises(ValueError, match="the log has mag, from which no filter"):
        replay(Log.from_arrays(log.t, mag=np.ones((log.n, 3))))
    with pytest.raises(ValueError, match="is unknown"):
        replay(log, ["nonsense"])
    with pytest.raises(ValueError, match="the filter is unknown"):
        replay(log, settings={"mahonny": {}})
    with pytest.raises(ValueError, match="no reference attitude"):
        replay(log, initial="reference")
    with pytest.raises(ValueError, match="initial is 'north'"):
        replay(log, initial="north")
    with pytest.raises(ValueError, match="was not replayed"):
        replay(log).rotation("triad")


def test_every_filter_has_its_sentence() -> None:
    assert package.FILTERS is FILTERS
    assert all(sentence.endswith(".") for sentence in FILTERS.values())
