"""Paper C's filters against scipy and numpy, and what spoiled readings do to them."""

from typing import Any

import numpy as np
import pytest
from filter_state import bias_of, own
from imufit import _imufit
from imufit.replaying import PAPER_C_GAINS
from scipy.spatial.transform import Rotation
from test_filters import FIELD, FRAMES, UP, G, Motion, angles, rotation_of, scalar_first

HALF_TURNS = Rotation.from_rotvec(
    np.pi * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0], [0.6, 0, -0.8], [0.48, 0.6, 0.64]])
)


def pairs(frame: str, noise: float) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """Attitudes all over the sphere, half turns among them, with their readings."""
    rng = np.random.default_rng(3)
    truth = Rotation.concatenate([HALF_TURNS, Rotation.random(150, rng=rng)])
    acc = truth.inv().apply(np.array(UP[frame]) * G) + rng.normal(0.0, noise * G, (len(truth), 3))
    mag = truth.inv().apply(FIELD[frame]) + rng.normal(0.0, noise * 48.0, (len(truth), 3))
    return truth, acc, mag


def attitudes(name: str, frame: str, acc: np.ndarray, mag: np.ndarray, **settings: float) -> Rotation:
    made = _imufit.Filter(name, frame=frame, gravity=G, mag_reference=FIELD[frame], settings=settings)
    t = 0.01 * np.arange(len(acc))
    return rotation_of(made.run(t, acc, np.zeros_like(acc), mag)[0])


class TestVectors:
    """TRIAD and QUEST against scipy's `align_vectors`: 1e-9 rad."""

    @pytest.mark.parametrize("frame", FRAMES)
    def test_triad_is_scipys_alignment_with_the_specific_force_met_exactly(self, frame: str) -> None:
        truth, acc, mag = pairs(frame, 0.1)
        found = attitudes("triad", frame, acc, mag)
        for k in range(len(truth)):
            expected, _ = Rotation.align_vectors([UP[frame], FIELD[frame]], [acc[k], mag[k]], weights=[np.inf, 1.0])
            assert angles(expected, found[k]) < 1e-9

    @pytest.mark.parametrize("frame", FRAMES)
    @pytest.mark.parametrize("weights", [(1.0, 1.0), (1.0, 0.1), (0.2, 3.0), (5.0, 0.05)])
    def test_quest_is_scipys_alignment_with_the_same_weights(self, frame: str, weights: tuple[float, float]) -> None:
        truth, acc, mag = pairs(frame, 0.1)
        found = attitudes("quest", frame, acc, mag, k_1=weights[0], k_2=weights[1])
        field = np.array(FIELD[frame]) / np.linalg.norm(FIELD[frame])
        for k in range(len(truth)):
            seen = [acc[k] / np.linalg.norm(acc[k]), mag[k] / np.linalg.norm(mag[k])]
            expected, _ = Rotation.align_vectors([UP[frame], field], seen, weights=weights)
            assert angles(expected, found[k]) < 1e-9

    def test_ideal_vectors_give_any_attitude_also_half_turns(self) -> None:
        truth, acc, mag = pairs("NED", 0.0)
        for name in ("triad", "quest"):
            assert angles(truth, attitudes(name, "NED", acc, mag)).max() < 1e-12

    def test_quest_without_a_known_dip_is_triad_and_a_wrong_dip_does_not_tilt(self) -> None:
        truth, acc, mag = pairs("NED", 0.0)
        up = np.array(UP["NED"])
        mag += 20.0 * truth.inv().apply(up)
        with_dip = angles(truth, attitudes("quest", "NED", acc, mag, k_2=1.0))
        without = attitudes("quest", "NED", acc, mag, k_2=1.0, dip=0.0)
        assert with_dip.min() > 0.02
        assert angles(truth, without).max() < 1e-12
        assert angles(attitudes("triad", "NED", acc, mag), without).max() < 1e-14

    def test_euler_angles_are_scipys(self) -> None:
        rotation = Rotation.random(2000, rng=np.random.default_rng(5))
        euler = _imufit.euler_from_quaternion(scalar_first(rotation))
        np.testing.assert_allclose(euler[:, ::-1], rotation.as_euler("ZYX"), atol=1e-9)
        back = rotation_of(_imufit.quaternion_from_euler(euler))
        assert angles(rotation, back).max() < 1e-9


def driven_by_numpy(motion: Motion, start: Rotation, gains: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Passive filter on TRIAD's matrix, matrices throughout; scipy's alignment is TRIAD."""
    k_1, k_2, k_i, k_p = gains
    field = np.array(FIELD[motion.frame])
    r, bias, out = start.as_matrix(), np.zeros(3), [start.as_matrix()]
    for k in range(1, len(motion.t)):
        dt = motion.t[k] - motion.t[k - 1]
        rate = (motion.gyr[k] + motion.gyr[k - 1]) / 2.0 - bias
        r = r @ Rotation.from_rotvec(rate * dt).as_matrix()
        measured, _ = Rotation.align_vectors(
            [UP[motion.frame], field], [motion.acc[k], motion.mag[k]], weights=[np.inf, 1.0]
        )
        error = measured.as_matrix() @ r.T
        part = (error - error.T) / 2.0
        w_n = np.array([part[2, 1], part[0, 2], part[1, 0]])
        w_mes = r.T @ (np.array([k_1, k_1, k_2]) / 2.0 * w_n)
        bias = bias - 0.5 * k_i * w_mes * dt
        r = r @ Rotation.from_rotvec(k_p * w_mes * dt).as_matrix()
        out.append(r)
    return np.array(out), bias


class TestHybrid:
    """Both readings of the paper's figures 1 and 2."""

    @pytest.mark.parametrize("frame", FRAMES)
    @pytest.mark.parametrize("gains", [(1.0, 1.0, 0.2, 20.0), (5.0, 0.1, 0.2, 10.0)])
    def test_driven_is_an_independent_integration_of_the_passive_filter(
        self, frame: str, gains: tuple[float, ...]
    ) -> None:
        motion = Motion(500, frame=frame, noise=3.0, seed=2)
        start = Rotation.from_rotvec([0.6, -0.3, 0.9]) * motion.truth[0]
        expected, bias = driven_by_numpy(motion, start, gains)
        made = _imufit.Filter(
            "hybrid",
            frame=frame,
            gravity=G,
            mag_reference=FIELD[frame],
            settings=dict(zip(("k_1", "k_2", "k_i", "k_p"), gains, strict=True)),
            rules={"recovery": 0.0},
            initial=scalar_first(start)[0].tolist(),
        )
        q, _ = made.run(motion.t, motion.acc, motion.gyr, motion.mag)
        assert angles(Rotation.from_matrix(expected), rotation_of(q)).max() < 1e-9
        np.testing.assert_allclose(bias_of(made.state), bias, atol=1e-9)

    def test_seeded_is_mahonys_filter_started_at_triads_attitude_whatever_was_given(self) -> None:
        motion = Motion(1000, noise=3.0)
        gains = {"k_1": 5.0, "k_2": 0.1, "k_i": 0.2, "k_p": 10.0}
        mahony, _ = motion.run("mahony", settings=gains)
        seeded, _ = motion.run("hybrid", settings={**gains, "driven": 0.0}, initial=[1.0, 0.0, 0.0, 0.0])
        plain, _ = motion.run("mahony", settings=gains, initial=[1.0, 0.0, 0.0, 0.0])
        assert angles(rotation_of(mahony), rotation_of(seeded)).max() < 1e-12
        assert angles(rotation_of(plain[:20]), rotation_of(seeded[:20])).max() > 0.1

    def test_the_papers_gains_are_settings_of_both_filters(self) -> None:
        printed = {"figure_3": [1, 1, 0.2, 20], "figure_4": [5, 0.1, 0.2, 10]}
        motion = Motion(50)
        for figure, gains in printed.items():
            assert list(PAPER_C_GAINS[figure].values()) == gains
            for name in ("mahony", "hybrid"):
                q, _ = motion.run(name, settings=PAPER_C_GAINS[figure])
                assert angles(motion.truth, rotation_of(q)).max() < 1e-3

    @pytest.mark.parametrize("driven", [0.0, 1.0])
    def test_a_slow_magnetometer_pulls_the_heading_as_fast_as_a_quick_one(self, driven: float) -> None:
        n = 2000
        t, acc, gyr = np.arange(n) * 0.01, np.tile([0, 0, -G], (n, 1)), np.zeros((n, 3))
        gyr[1:10, 2] = 5.0  # a turn that did not happen, after the start
        mag = np.tile([20.0, 0.0, 40.0], (n, 1))
        slow = mag.copy()
        slow[np.arange(n) % 10 != 0] = np.nan
        headings = []
        for column in (mag, slow):
            made = _imufit.Filter("hybrid", settings={"k_i": 0.0, "driven": driven})
            headings.append(_imufit.euler_from_quaternion(made.run(t, acc, gyr, column)[0])[1000, 2])
        assert headings[0] == pytest.approx(headings[1], rel=0.05)
        assert 0.0 < headings[0] < 0.1


SOFT = {"k_p": 2.0, "k_i": 0.0}
CASES: dict[str, tuple[str, dict[str, float]]] = {
    "triad": ("triad", {}),
    "quest": ("quest", {}),
    "mahony": ("mahony", SOFT),
    "seeded": ("hybrid", {**SOFT, "driven": 0.0}),
    "driven": ("hybrid", {**SOFT, "driven": 1.0}),
}
"""Filters with the settings under which they are spoiled."""
STATED_ROWS = {"triad": 1, "quest": 1, "mahony": 400, "seeded": 400, "driven": 400}
"""Rows of 0.01 s within which they recover: one, or 8 / k_p seconds."""


def spoiled(fault: str) -> tuple[Motion, slice, dict[str, int], dict[str, Any]]:
    """Spoil a motion; rows that are spoiled, what should be counted, and options of the filter."""
    motion, rows, options = Motion(2000, seed=4), slice(1000, 1100), {}
    counted: dict[str, int] = {}
    match fault:
        case "free fall":
            motion.acc[rows] = np.random.default_rng(0).normal(0.0, 0.3, (100, 3))
            counted = {"free_fall": 100}
        case "magnet parallel to gravity":
            motion.mag[rows] = -5.0 * motion.acc[rows]
            counted = {"no_heading": 100}
        case "saturated gyro":
            motion.gyr[rows] = np.clip(3.0 * motion.gyr[rows], -0.3, 0.3)
            options = {"rules": {"gyr_range": 0.3}}
        case "gap":
            keep = np.r_[0:500, 1500:2000]
            motion.truth, motion.t = motion.truth[keep], motion.t[keep]
            motion.acc, motion.gyr, motion.mag = (
                np.ascontiguousarray(column[keep]) for column in (motion.acc, motion.gyr, motion.mag)
            )
            rows, counted = slice(500, 501), {"gap": 1}
        case _:
            sensor, value = fault.split()
            rows = slice(1000, 1001)
            getattr(motion, sensor)[1000, 1 if value == "inf" else slice(None)] = float(value)
            counted = {f"{sensor}_{'missing' if value == 'nan' else 'not_finite'}": 1}
    return motion, rows, counted, options


FAULTS = (
    *(f"{sensor} {value}" for sensor in ("acc", "gyr", "mag") for value in ("nan", "inf")),
    "free fall",
    "magnet parallel to gravity",
    "saturated gyro",
    "gap",
)


class TestFaults:
    """State finite, rows counted, recovered within the stated time."""

    @pytest.mark.parametrize("fault", FAULTS)
    @pytest.mark.parametrize("case", CASES)
    def test_a_fault_is_counted_and_gone_after_the_stated_time(self, case: str, fault: str) -> None:
        motion, rows, counted, options = spoiled(fault)
        name, settings = CASES[case]
        made = _imufit.Filter(
            name, gravity=G, mag_reference=FIELD["NED"], settings=settings, rules=options.get("rules")
        )
        q, skipped = made.run(motion.t, motion.acc, motion.gyr, motion.mag)
        if fault == "saturated gyro":
            assert skipped["gyr_clipped"] >= 100
        else:
            assert skipped == counted
        assert np.isfinite(own(made.state)).all()
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-12)
        error = angles(motion.truth, rotation_of(q))
        left = error[rows.start : rows.stop + 1].max() if fault != "gap" else error[rows.start]
        stated = 1 if case == "seeded" and fault == "gap" else STATED_ROWS[case]
        after = rows.stop - (1 if fault == "gap" and stated == 1 else 0) + stated
        assert error[: rows.start].max() < 2e-3
        assert error[after : after + 200].max() < left / 10.0 + 2e-3

    def test_the_faults_hurt(self) -> None:
        found = {}
        for fault in ("saturated gyro", "gap"):
            motion, _, _, options = spoiled(fault)
            q, _ = motion.run("hybrid", settings=SOFT, **options)
            found[fault] = angles(motion.truth, rotation_of(q)).max()
        assert min(found.values()) > 0.05


@pytest.mark.parametrize(("name", "driven"), [("gyro", None), ("mahony", None), ("hybrid", 0.0), ("hybrid", 1.0)])
def test_the_norm_stays_one_over_a_million_steps(name: str, driven: float | None) -> None:
    """`benches/norm.py` takes 1e8 steps."""
    rng, n = np.random.default_rng(6), 100_000
    t, gyr = 0.005 * np.arange(1, n + 1), rng.normal(0.0, 3.0, (n, 3))
    acc, mag = rng.normal(0.0, 10.0, (n, 3)), rng.normal(0.0, 40.0, (n, 3))
    made = _imufit.Filter(name, settings={} if driven is None else {"driven": driven})
    for piece in range(10):
        q, _ = made.run(t + piece * t[-1], acc, gyr, mag)
        assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < 1e-12
