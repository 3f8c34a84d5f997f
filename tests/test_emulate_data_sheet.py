"""The errors of an emulated sensor out of the box."""

from imufit.devices.emulate.data_sheet import LIMITS, data_sheet_errors


def test_the_errors_keep_to_the_data_sheet_and_differ_from_sensor_to_sensor():
    one, two = data_sheet_errors(1), data_sheet_errors(2)
    assert one == data_sheet_errors(1)
    assert one != two
    for effect, limits in LIMITS.items():
        for (_, value), limit in zip(sorted(one[effect].items()), limits, strict=True):
            assert 0.0 < abs(value) <= limit
