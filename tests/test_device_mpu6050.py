"""MPU6050 frames against the data sheet's numbers and an independent decoding."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from imufit import InputError
from imufit.devices.chips import mpu6050
from imufit.replaying import replay

COUNTS = arrays(np.int16, st.tuples(st.integers(0, 40), st.just(7)))
SELECTIONS = st.tuples(st.integers(0, 3), st.integers(0, 3))


def encoded(counts: np.ndarray, temperature: bool = True) -> bytes:
    columns = range(7) if temperature else [0, 1, 2, 4, 5, 6]
    return b"".join(struct.pack(f">{len(row)}h", *row) for row in counts[:, list(columns)].tolist())


class TestFigures:
    """The maker's numbers."""

    def test_addresses_and_registers(self) -> None:
        assert (mpu6050.ADDRESS, mpu6050.ADDRESS_AD0_HIGH) == (0x68, 0x69)
        published = {"ACCEL_XOUT_H": 0x3B, "ACCEL_YOUT_H": 0x3D, "ACCEL_ZOUT_H": 0x3F, "TEMP_OUT_H": 0x41}
        published |= {"GYRO_XOUT_H": 0x43, "GYRO_YOUT_H": 0x45, "GYRO_ZOUT_H": 0x47, "WHO_AM_I": 0x75}
        assert {name: mpu6050.REGISTERS[name] for name in published} == published
        assert len(set(mpu6050.REGISTERS.values())) == len(mpu6050.REGISTERS)

    def test_ranges(self) -> None:
        assert [(s.range, s.sensitivity) for s in mpu6050.ACC_RANGES] == [(2, 16384), (4, 8192), (8, 4096), (16, 2048)]
        assert [(s.range, s.sensitivity) for s in mpu6050.GYR_RANGES] == [
            (250, 131),
            (500, 65.5),
            (1000, 32.8),
            (2000, 16.4),
        ]
        for config, selection in ((0x00, 0), (0x08, 1), (0x10, 2), (0x18, 3), (0xE8, 1)):
            assert mpu6050.full_scale_selection(config) == selection

    def test_low_pass_and_rate(self) -> None:
        slowest = mpu6050.LOW_PASS[6]
        assert (slowest.acc_bandwidth, slowest.gyr_bandwidth) == (5.0, 5.0)
        assert (slowest.acc_delay, slowest.gyr_delay) == pytest.approx((0.0190, 0.0186))
        delays = [(f.acc_delay, f.gyr_delay) for f in mpu6050.LOW_PASS]
        assert delays == sorted(delays)
        assert mpu6050.sample_rate(0, 0) == 8000.0
        assert mpu6050.sample_rate(4, 3) == 200.0

    @pytest.mark.parametrize("selection", range(4))
    def test_one_g_and_one_degree_per_second_in_every_range(self, selection: int) -> None:
        acc, gyr = mpu6050.ACC_RANGES[selection], mpu6050.GYR_RANGES[selection]
        counts = np.array([[0, 0, acc.sensitivity, -521, round(10 * gyr.sensitivity), 0, 0]], np.int16)
        frames = mpu6050.decode(encoded(counts), selection, selection)
        np.testing.assert_allclose(frames.acc, [[0.0, 0.0, 9.80665]], rtol=1e-15)
        np.testing.assert_allclose(frames.gyr, np.radians([[10.0, 0.0, 0.0]]), rtol=1e-15)
        assert frames.temp is not None
        assert frames.temp[0] == pytest.approx(35.0, abs=0.003)  # -521 at 35 degC in the product specification
        assert frames.acc_range == pytest.approx(acc.range * 9.80665)
        assert frames.gyr_range == pytest.approx(np.radians(gyr.range), rel=1e-3)


class TestDecoding:
    """Bursts."""

    @settings(max_examples=100, deadline=None)
    @given(COUNTS, SELECTIONS, st.booleans())
    def test_what_was_encoded_comes_back(
        self, counts: np.ndarray, selections: tuple[int, int], temperature: bool
    ) -> None:
        data = encoded(counts, temperature)
        frames = mpu6050.decode(data, *selections, temperature=temperature)
        g, rate = mpu6050.ACC_RANGES[selections[0]].sensitivity, mpu6050.GYR_RANGES[selections[1]].sensitivity
        found = np.column_stack([frames.acc / 9.80665 * g, np.degrees(frames.gyr) * rate])
        raw = np.frombuffer(data, ">i2").reshape(len(counts), 7 if temperature else 6)
        np.testing.assert_allclose(found, raw[:, [0, 1, 2, -3, -2, -1]], atol=1e-9)
        np.testing.assert_array_equal(np.rint(found), counts[:, [0, 1, 2, 4, 5, 6]])
        if temperature:
            np.testing.assert_allclose(frames.temp, raw[:, 3] / 340.0 + 36.53, atol=1e-12)
        else:
            assert frames.temp is None
        ends = (counts == 32767) | (counts == -32768)
        np.testing.assert_array_equal(frames.acc_clipped, ends[:, :3])
        np.testing.assert_array_equal(frames.gyr_clipped, ends[:, 4:])

    @settings(max_examples=50, deadline=None)
    @given(COUNTS, st.lists(st.integers(1, 40), max_size=40), st.booleans())
    def test_a_stream_in_any_pieces_is_the_burst(self, counts: np.ndarray, sizes: list[int], temperature: bool) -> None:
        data = encoded(counts, temperature)
        whole = mpu6050.decode(data, temperature=temperature)
        acc, left, at = [np.empty((0, 3))], b"", 0
        for size in [*sizes, len(data)]:
            frames = mpu6050.decode(left + data[at : at + size], temperature=temperature, partial=True)
            at, left = at + size, frames.remainder
            acc.append(frames.acc)
        assert left == b""
        np.testing.assert_array_equal(np.concatenate(acc), whole.acc)

    def test_every_kind_of_bytes_is_the_same(self) -> None:
        counts = np.arange(70, dtype=np.int16).reshape(10, 7) * 7
        data = encoded(counts)
        expected = mpu6050.decode(data).acc
        table = np.frombuffer(data, np.uint8).reshape(10, 14)
        for same in (bytearray(data), memoryview(data), table, np.asfortranarray(table), table.ravel()):
            np.testing.assert_array_equal(mpu6050.decode(same).acc, expected)
        assert mpu6050.decode(b"").n == 0


class TestLog:
    """Frames and times are a log."""

    def test_a_sensor_that_points_z_up_has_its_specific_force_there(self) -> None:
        counts = np.tile(np.array([0, 0, 16384, -521, 13, 0, 0], np.int16), (50, 1))
        log = mpu6050.decode(encoded(counts)).to_log(np.arange(50) * 0.01, frame="ENU")
        assert log.covariates == {}
        assert log.metadata.sensor == "MPU6050"
        np.testing.assert_allclose(log.temp, 35.0, atol=0.003)
        result = replay(log, ["accel"])
        np.testing.assert_allclose(result.euler("accel"), 0.0, atol=1e-12)

    def test_clipped_rows_are_marked_and_known_to_a_replay(self) -> None:
        counts = np.tile(np.array([0, 0, 16384, 0, 0, 0, 0], np.int16), (50, 1))
        counts[20, 1] = 32767
        counts[30:32, 5] = -32768
        log = mpu6050.decode(encoded(counts)).to_log(np.arange(50) * 0.01, frame="ENU")
        np.testing.assert_array_equal(np.flatnonzero(log.covariates["acc_clipped"]), [20])
        np.testing.assert_array_equal(np.flatnonzero(log.covariates["gyr_clipped"]), [30, 31])
        assert replay(log, ["kalman"]).skipped == {"acc_clipped": 1, "gyr_clipped": 2}


class TestRefusals:
    """What cannot be decoded, is refused with the place and what to do."""

    def test_a_truncated_burst(self) -> None:
        with pytest.raises(InputError, match=r"row 2: 31 bytes.*frame 2, from byte 28 on.*partial=True") as caught:
            mpu6050.decode(bytes(31))
        assert caught.value.row == 2
        with pytest.raises(InputError, match="whole frames of 12 bytes"):
            mpu6050.decode(bytes(14), temperature=False)

    def test_what_is_no_range_no_bytes_or_no_time(self) -> None:
        for wrong in (4, -1, 300, 1.0, True):
            with pytest.raises(InputError, match=r"afs_sel is .* selects no range"):
                mpu6050.decode(bytes(14), afs_sel=wrong)  # type: ignore[arg-type]
        with pytest.raises(InputError, match="fs_sel is 4"):
            mpu6050.decode(bytes(14), fs_sel=4)
        with pytest.raises(InputError, match="dtype int16, not bytes"):
            mpu6050.decode(np.zeros(7, np.int16))  # type: ignore[arg-type]
        with pytest.raises(InputError, match="of type str, not bytes"):
            mpu6050.decode("00")  # type: ignore[arg-type]
        with pytest.raises(InputError, match=r"t has shape \(2,\) for 1 frames"):
            mpu6050.decode(bytes(14)).to_log([0.0, 0.1])
        with pytest.raises(InputError, match="DLPF_CFG is 7"):
            mpu6050.sample_rate(0, 7)
        with pytest.raises(InputError, match="SMPLRT_DIV is 256"):
            mpu6050.sample_rate(256, 1)
