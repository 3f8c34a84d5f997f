"""Live rows are corrected exactly where an effect needs nothing but the present row, whoever wrote it."""

from functools import cache

import numpy as np
import pytest
from imufit import InputError, Log, SensorModel, _imufit, effect
from imufit.devices.monitor.correction import LiveCorrection
from imufit.lab import simulate
from imufit.log.columns import GROUPS
from imufit.model.catalogue import find_effect
from imufit.model.effect import forget

BUILT_IN = [*(e.id for e in _imufit.built_in_effects()), *(f"{s}.column:motor_current" for s in ("acc", "gyr", "mag"))]
PIECE = 7


@cache
def rows() -> Log:
    """Readings as a device sends them: no reference."""
    log = simulate.simulate("handheld", {}, 3, 5.0, covariates=("motor_current",)).to_log()
    return Log(
        t=log.t,
        acc=log.acc,
        gyr=log.gyr,
        mag=log.mag,
        temp=log.temp,
        covariates={**log.covariates},
        metadata=log.metadata,
    )


def model_of(effect_id: str, **constants) -> SensorModel:
    values = {
        name: 0.1 * (size or 1.0) * (1.0 - 0.3 * k)
        for k, (name, _, size) in enumerate(find_effect(effect_id).parameters)
    }
    return SensorModel([effect_id], {effect_id: values}, constants=constants)


def readings(log: Log) -> np.ndarray:
    return np.hstack([log.acc, log.gyr, log.mag])


def pieces(log: Log):
    for begin in range(0, log.n, PIECE):
        rows = slice(begin, begin + PIECE)
        batch = {"t": log.t[rows], "temp": log.temp[rows]} | {k: v[rows] for k, v in log.covariates.items()}
        for name in ("acc", "gyr", "mag"):
            batch |= {axis: getattr(log, name)[rows, k] for k, axis in enumerate(GROUPS[name])}
        yield batch


def live(model: SensorModel, log: Log) -> np.ndarray:
    correction = LiveCorrection(model)
    axes = [axis for name in ("acc", "gyr", "mag") for axis in GROUPS[name]]
    return np.vstack([np.column_stack([out[axis] for axis in axes]) for out in map(correction, pieces(log))])


def same_row_by_row(model: SensorModel, log: Log) -> bool:
    """Return whether pieces of the log, corrected each by itself, are the whole log corrected."""
    try:
        whole = readings(model.apply(log))
        apart = [
            readings(
                model.apply(
                    Log(
                        t=log.t[rows],
                        acc=log.acc[rows],
                        gyr=log.gyr[rows],
                        mag=log.mag[rows],
                        temp=log.temp[rows],
                        covariates={k: v[rows] for k, v in log.covariates.items()},
                    )
                )
            )
            for rows in (slice(begin, begin + PIECE) for begin in range(0, log.n, PIECE))
        ]
    except InputError:
        return False
    return bool(np.allclose(np.vstack(apart), whole, rtol=1e-9, atol=1e-12, equal_nan=True))


@pytest.fixture
def user_effect():
    """The decorator; effects made with it are forgotten after the test."""
    made = []

    def define(effect_id, **options):
        made.append(effect_id)
        return effect(effect_id, **options)

    yield define
    for effect_id in made:
        forget(effect_id)


@pytest.mark.parametrize("effect_id", BUILT_IN)
def test_a_built_in_effect_is_taken_out_of_live_rows_wherever_a_row_alone_is_enough(effect_id):
    log = rows()
    model = model_of(effect_id, temperature_mean=25.0, covariate_means={"motor_current": 0.5})
    if same_row_by_row(model, log):
        np.testing.assert_allclose(live(model, log), readings(model.apply(log)), rtol=1e-9, atol=1e-12)
    else:
        with pytest.raises(InputError, match=f"{effect_id} needs .*which live rows do not have"):
            LiveCorrection(model)


def test_a_users_effect_is_refused_unless_it_says_that_a_row_is_enough(user_effect):
    # The name is that of an effect which other sensors have built in: only what an effect declares counts.
    @user_effect("mag.bias", parameters={"k": "s"})
    def late(w, k):
        return k * (np.cross(w.m, w.omega) + w.alpha)

    with pytest.raises(InputError, match=r"mag\.bias needs the rows around a row"):
        LiveCorrection(model_of("mag.bias"))

    @user_effect("gyr.since", parameters={"k": "rad/s/s"}, reach="history")
    def since(w, k):
        return k * (w.t - w.t_start)

    with pytest.raises(InputError, match=r"gyr\.since needs all rows since the start"):
        LiveCorrection(model_of("gyr.since"))


def test_a_users_effect_of_the_row_is_taken_out_of_live_rows(user_effect):
    @user_effect("gyr.pull", parameters={"k": "rad/s/A"}, needs=["motor_current"], reach="row")
    def pull(w, k):
        return np.outer(w.column("motor_current"), [0.0, 0.0, k])

    log, model = rows(), model_of("gyr.pull")
    corrected = live(model, log)
    assert same_row_by_row(model, log)
    np.testing.assert_allclose(corrected, readings(model.apply(log)), rtol=1e-9, atol=1e-12)
    assert np.abs(corrected - readings(log)).max() > 0.01


@pytest.mark.parametrize(("needs", "said"), [(["temp"], "needs temperature_mean"), ([], "no column temp")])
def test_a_temperature_never_counts_from_the_mean_of_a_batch(user_effect, needs, said):
    @user_effect("acc.warm", parameters={"k": "m/s^2/K"}, needs=needs, reach="row")
    def warm(w, k):
        return k * w.temperature

    with pytest.raises(InputError, match=said):
        live(model_of("acc.warm"), rows())
    log, model = rows(), model_of("acc.warm", temperature_mean=25.0)
    np.testing.assert_allclose(live(model, log), readings(model.apply(log)), rtol=1e-9, atol=1e-12)


def test_a_columns_effect_needs_the_mean_that_it_counts_from():
    with pytest.raises(InputError, match=r"gyr\.column:motor_current needs the mean of motor_current"):
        LiveCorrection(model_of("gyr.column:motor_current"))
