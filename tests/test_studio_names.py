"""Names in words on the page: effects, channels and covariates, and columns that keep their own name."""

import imufit
import pytest
from imufit.studio.names import (
    channel_name,
    covariate_name,
    effect_name,
    estimating,
    model_name,
    parameter_name,
    with_symbol,
)


def test_effects_have_the_names_of_the_catalogue():
    assert all(effect_name(card.id) == card.name for card in imufit.catalogue())
    assert parameter_name("gyr.scale", "x") == "gyroscope scale error x"
    assert effect_name("acc.column:<b>") == "influence of <b> on the accelerometer"


@pytest.mark.parametrize(
    ("symbol", "words"),
    [
        ("f_x", "specific force x"),
        ("omega_y", "angular rate y"),
        ("omega_norm", "size of the angular rate"),
        ("temp", "temperature"),
        ("t", "time"),
        ("temp*omega_norm", "temperature times size of the angular rate"),
        ("ref_px*ref_py*ref_pz", "position x times position y times position z"),
        ("supply", "supply"),
        ("domega/dt", "change of the angular rate"),
        ("a*b", "a*b"),
        ("omega_q", "omega_q"),
        ("", ""),
    ],
)
def test_covariates_have_words_and_columns_their_own_name(symbol, words):
    assert covariate_name(symbol) == words


def test_channels_and_models_have_words():
    assert channel_name("gyr_x") == "gyroscope x"
    assert with_symbol("gyroscope x", "gyr_x") == "gyroscope x (gyr_x)"
    assert with_symbol("supply", "supply") == "supply"
    assert model_name(()) == "the ideal sensor"
    assert model_name(("acc.bias",)) == "the model with accelerometer bias"
    assert (
        estimating(("acc.bias", "gyr.scale"))
        == "estimating the model with 2 effects from the log, for its values and its bar"
    )
