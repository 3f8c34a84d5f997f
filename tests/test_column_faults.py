"""Columns that hold something else than their names say: named with a mapping that restores them."""

import numpy as np
import pandas as pd
import pytest
from imufit import Log
from imufit.faults import row_faults
from imufit.faults.units import units_of_field, wrong_units
from imufit.fitting.surveyed_log import survey
from imufit.lab.simulate import simulate
from imufit.log import parse_mapping
from imufit.model.effect_stack import EffectStack
from imufit.results import DataFault
from pasted import python_mappings, shell_mappings

DEG = np.pi / 180.0


def sound(seed: int = 5, scenario: str = "handheld") -> Log:
    return simulate(scenario, {}, seed=seed, duration=20.0, frame="ENU").to_log()


def faults(table: pd.DataFrame, log: Log, **told: object) -> tuple[DataFault, ...]:
    metadata = {**log.metadata.to_mapping(), **told}
    read = Log.from_dataframe(table, metadata)
    return survey(EffectStack(()), [read], lambda *_: None, keep_constants=False)[0].faults


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gyr_z": ("gyr_z", 0.1 / DEG)}, None),
        ({"gyr_x": ("mag_y", 1.0), "mag_y": ("gyr_x", 1.0)}, "exchanged"),
        ({f"ref_p{axis}": (f"ref_p{axis}", 1e3) for axis in "xyz"}, "mm"),
        ({f"gyr_{axis}": (f"gyr_{axis}", 4.0) for axis in "xyz"}, "range"),
    ],
)
def test_the_mapping_restores_the_columns(change, words) -> None:
    log = sound()
    right = log.to_dataframe()
    table = right.assign(**{name: right[source] * factor for name, (source, factor) in change.items()})
    found = [fault for fault in faults(table, log) if fault.spoils]
    if words is None:
        # A factor that no unit has, on one axis: an effect is to find it, or nothing.
        assert not found
        return
    (fault,) = found
    assert words in f"{fault.evidence} {fault.remedy}"
    mapping = python_mappings(fault.remedy)[0]
    assert mapping == parse_mapping(shell_mappings(fault.shell_remedy)[0])
    restored = Log.from_dataframe(table, log.metadata.to_mapping(), mapping=mapping).to_dataframe()
    for name in change:
        np.testing.assert_allclose(restored[name], right[name], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("told", "scenario"),
    [
        ({"gravity": 1.0}, "handheld"),
        ({"gravity": 1.0}, "turntable"),  # without positions every ideal reading has the length of gravity
        ({"mag_reference": "flipped"}, "handheld"),
        ({"mag_reference": "gauss"}, "handheld"),
    ],
)
def test_metadata_that_the_readings_deny_are_named(told, scenario: str) -> None:
    log = sound(scenario=scenario)
    field = np.array(log.metadata.mag_reference)
    other = {"flipped": field * [1.0, 1.0, -1.0], "gauss": field * 0.01}
    told = {key: other[value].tolist() if isinstance(value, str) else value for key, value in told.items()}
    (fault,) = faults(log.to_dataframe(), log, **told)
    assert fault.fault == "metadata"
    assert next(iter(told)) in fault.remedy


@pytest.mark.parametrize(("value", "rows"), [(500.0, 1), (-999.0, 25)])
def test_a_sample_that_nothing_leads_up_to_is_left_out(value: float, rows: int) -> None:
    log = sound()
    table = log.to_dataframe()
    table.loc[table.index[700 : 700 + rows], "acc_x"] = value
    found, left_out = row_faults(Log.from_dataframe(table, log.metadata.to_mapping()))
    (fault,) = found
    assert (fault.channel, fault.rows, fault.left_out) == ("acc_x", rows, True)
    assert left_out == [("acc", 700, 700 + rows)]


def test_a_blow_with_rows_before_and_after_it_is_a_reading() -> None:
    log = sound()
    table = log.to_dataframe()
    blow = 200.0 * np.array([0.1, 0.6, 1.0, 0.5, -0.3, 0.1])
    table.loc[table.index[700:706], "acc_x"] += blow
    assert row_faults(Log.from_dataframe(table, log.metadata.to_mapping())) == ([], [])


def test_two_units_that_fit_alike_are_both_named() -> None:
    assert {unit.unit for unit in wrong_units("acc", 100.0)} == {"cm/s^2", "mg"}
    assert [unit.unit for unit in wrong_units("gyr", 1.0 / DEG)] == ["deg/s"]
    assert wrong_units("gyr", -1.0) == ()


def test_a_field_of_the_earth_is_in_no_other_unit() -> None:
    assert units_of_field(45.0) == ()
    assert "T" in {unit.unit for unit in units_of_field(45e-6)}
