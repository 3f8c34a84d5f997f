"""Faults of the data: what is put in is named with its place and a remedy, and sound logs show none."""

from dataclasses import replace

import imufit
import numpy as np
import pandas as pd
import pytest
from imufit import Diagnosis, Log, SensorModel
from imufit.cli.app import main
from imufit.faults import row_faults
from imufit.faults.frames import PERMUTATIONS
from imufit.lab.simulate import FAULTS, simulate, with_fault
from imufit.results import fault_words
from pasted import python_mappings
from scipy.spatial.transform import Rotation

GLOBAL = [
    name for name in FAULTS if name.partition(".")[0] in ("units", "range", "axes", "mount", "frame", "reference")
]

CURED = ("axes.exchanged", "axes.flipped", "mount", "frame.gravity", "reference.conjugate", "reference.scalar_last")
"""Faults whose remedy is another mapping of columns."""


def faulty(scenario: str, fault: str, seed: int = 1, duration: float = 12.0) -> Log:
    return with_fault(simulate(scenario, {"acc.bias": None}, seed=seed, duration=duration), fault).to_log()


def diagnosed(log: Log) -> Diagnosis:
    return SensorModel().fit(log).diagnose()


@pytest.mark.parametrize("fault", [name for name in GLOBAL if name not in CURED])
def test_what_spoils_a_log_is_named_instead_of_an_effect(fault: str) -> None:
    found = diagnosed(faulty("handheld", fault))
    assert {each.fault for each in found.data_faults} == set(FAULTS[fault].names[:1])
    assert found.verdict == "unknown"
    assert found.best is None
    assert found.candidates == ()
    assert found.data_faults[0].remedy in found.sentence


def mapped(log: Log, remedy: str) -> Log:
    """Apply the mapping of columns that a remedy names, without units."""
    table = log.to_dataframe()
    (mapping,) = python_mappings(remedy)
    assert all("[" not in source for source in mapping.values())
    new = {target: table[s.lstrip("-")] * (-1.0 if s.startswith("-") else 1.0) for target, s in mapping.items()}
    return Log.from_dataframe(table.assign(**new), log.metadata)


@pytest.mark.parametrize("fault", CURED)
def test_the_remedy_cures(fault: str) -> None:
    log = faulty("arm", fault)
    (found,) = SensorModel().compare(log).data_faults
    assert found.fault == FAULTS[fault].names[0]
    cured = diagnosed(mapped(log, found.remedy))
    assert cured.data_faults == ()
    assert cured.best == "acc.bias"


def test_a_field_estimated_from_wrong_axes_does_not_hide_them() -> None:
    log = faulty("poses", "axes.exchanged", seed=3)
    log = replace(log, metadata=replace(log.metadata, mag_reference=None))
    sensors = {each.sensor for each in diagnosed(log).data_faults}
    assert len(sensors) == 1
    assert sensors <= {"acc", "gyr", "mag"}


def test_an_angle_in_degrees_is_told_from_a_gyroscope_in_another_unit() -> None:
    simulated = simulate("tilt", {}, seed=1, duration=20.0).to_log()
    assert simulated.ref_angle is not None
    table = {"acc": simulated.acc, "gyr": simulated.gyr, "ref_angle": np.degrees(simulated.ref_angle)}
    log = Log.from_arrays(simulated.t, **table, frame="NED", rig_axis="x")
    (found,) = diagnosed(log).data_faults
    assert (found.fault, found.sensor) == ("units", "ref")
    assert "ref_angle[deg]" in found.remedy


def test_signed_permutations_are_undone_by_their_mapping() -> None:
    y = np.array([1.0, 2.0, 3.0])
    for matrix in PERMUTATIONS[1:]:
        shown = dict(zip(("gyr_x", "gyr_y", "gyr_z"), matrix @ y, strict=True))
        undone = dict(shown)
        for target, source in fault_words.mapping("gyr", matrix).items():
            undone[target] = shown[source.lstrip("-")] * (-1.0 if source.startswith("-") else 1.0)
        np.testing.assert_allclose(list(undone.values()), y)
    assert np.array_equal(PERMUTATIONS[0], np.eye(3))
    assert len(PERMUTATIONS) == 48


def test_the_command_line_names_the_fault(tmp_path, capsys) -> None:
    path, page, json = (tmp_path / name for name in ("log.parquet", "page.html", "answer.json"))
    assert main(["simulate", "handheld", "--fault", "mount", "--duration", "12", "-o", str(path)]) == 0
    capsys.readouterr()
    assert main(["diagnose", str(path), "--json", str(json), "--html", str(page)]) == 0
    out = capsys.readouterr().out
    assert "UNKNOWN" in out
    assert "--map" in out
    assert '"fault": "mount"' in json.read_text()
    assert "Faults of the data" in page.read_text()
    assert main(["compare", str(path), "--json", "-"]) == 0
    assert '"fault": "mount"' in capsys.readouterr().out
    assert main(["reveal", str(path)]) == 0
    assert "mount" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("scenario", "effect"),
    [("handheld", "ref.alignment"), ("arm", "acc.delay"), ("poses", "mag.soft_iron"), ("tilt", "rig.periodic")],
)
def test_large_effects_are_no_faults(scenario: str, effect: str) -> None:
    log = simulate(scenario, {effect: None}, seed=2, duration=20.0, size=30.0, realistic=True).to_log()
    assert imufit.SensorModel().compare(log).data_faults == ()


@pytest.mark.parametrize(("fault", "seed"), [("stuck", 1), ("duplicate", 1), ("duplicate", 2)])
def test_rows_at_fault_are_left_out_and_the_rest_is_judged(fault: str, seed: int) -> None:
    sound = simulate("handheld", {"acc.bias": {"x": 0.05}}, seed=seed, duration=20.0)
    log = with_fault(sound, fault).to_log()
    found = diagnosed(log)
    (named,) = found.data_faults
    assert named.fault == fault
    assert named.left_out
    assert not named.spoils
    assert found.best == "acc.bias"
    assert str(named) in found.sentences()
    # What was changed lies within the rows named.
    rows = np.flatnonzero((log.t >= named.t_start) & (log.t <= named.t_end))
    changed = [
        np.flatnonzero(
            ~np.isclose(getattr(log, name), getattr(sound, name), rtol=0, atol=0).reshape(log.n, -1).all(axis=1)
        )
        for name in ("t", "acc", "gyr", "mag")
    ]
    rows_changed = np.unique(np.concatenate(changed))
    assert np.isin(rows_changed, rows).mean() > 0.97
    assert len(rows) < 1.1 * len(rows_changed) + 3


def test_a_backlog_is_left_out_where_the_body_moves() -> None:
    sound = simulate("handheld", {}, seed=1, duration=20.0)
    log = with_fault(sound, "backlog").to_log()
    (named,), left_out = row_faults(log)
    changed = np.flatnonzero(log.t != sound.t)
    assert named.fault == "backlog"
    assert abs(named.rows - len(changed)) <= 12
    assert named.left_out == bool(left_out)
    assert log.ref_q is not None
    still = replace(log, ref_q=np.tile(log.ref_q[:1], (log.n, 1)), ref_p=None)
    (harmless,), kept = row_faults(still)
    assert (harmless.fault, harmless.left_out, harmless.spoils, kept) == ("backlog", False, False, [])
    turning = Rotation.from_rotvec(np.outer(log.t - log.t[0], [0.0, 0.0, 1.0]))
    (moving,), blanked = row_faults(still.with_reference(turning))
    assert moving.left_out
    assert {sensor for sensor, _, _ in blanked} == {"acc", "gyr", "mag"}


def test_a_reading_that_is_clipped_most_of_the_time_is_not_stuck() -> None:
    log = simulate("tilt", {}, seed=3, duration=20.0).to_log()
    assert log.acc is not None
    pinned = np.minimum(log.acc, np.nanquantile(log.acc, 0.3, axis=0))
    found, left_out = row_faults(replace(log, acc=pinned))
    assert found == []
    assert left_out == []


def test_a_dead_channel_is_stuck() -> None:
    log = simulate("handheld", {}, seed=3, duration=20.0).to_log()
    assert log.gyr is not None
    (found,), _ = row_faults(replace(log, gyr=log.gyr * [1.0, 0.0, 1.0]))
    assert (found.fault, found.channel, found.rows) == ("stuck", "gyr_y", log.n)
    # Nothing is left out where too little would be left.
    assert found.spoils


def test_clipped_rows_are_counted_beside_the_effect() -> None:
    log = faulty("handheld", "clipped")
    found = diagnosed(log)
    assert {each.fault for each in found.data_faults} == {"clipped"}
    assert log.gyr is not None
    end = np.nanmax(np.abs(log.gyr))
    for each in found.data_faults:
        axis = "xyz".index(each.channel[-1])
        assert each.rows == np.count_nonzero(np.abs(log.gyr[:, axis]) >= end)


def coarse(log: Log) -> Log:
    """Round readings to steps larger than the noise, as at rest or in text files they often are."""
    assert log.acc is not None
    assert log.gyr is not None
    return replace(log, acc=np.round(log.acc / 0.1) * 0.1, gyr=np.round(log.gyr / 0.02) * 0.02, mag=None)


@pytest.mark.parametrize("scenario", ["poses", "tilt", "turntable"])
def test_coarse_steps_at_rest_are_neither_stuck_nor_copied(scenario: str) -> None:
    log = coarse(simulate(scenario, {}, seed=4, duration=30.0).to_log())
    assert SensorModel().compare(log).data_faults == ()


def test_a_slow_sensor_whose_value_is_held_is_not_stuck() -> None:
    log = simulate("handheld", {}, seed=4, duration=20.0).to_log()
    assert log.mag is not None
    held = log.mag[np.arange(log.n) // 10 * 10]
    assert not any(each.fault in ("stuck", "duplicate") for each in diagnosed(replace(log, mag=held)).data_faults)


def test_faults_are_the_same_in_a_log_read_in_pieces() -> None:
    log = with_fault(simulate("handheld", {}, seed=2, duration=20.0), "duplicate").to_log()
    whole, _ = row_faults(log)

    class Pieces:
        """The same log in small chunks."""

        n, metadata, columns, path, notes, origin = log.n, log.metadata, log.columns, None, (), log.origin

        def chunks(self, rows: int, margin: int = 0):
            return log.chunks(500, margin)

    pieces, left_out = row_faults(Pieces())
    assert [(f.fault, f.rows, f.t_start) for f in pieces] == [(f.fault, f.rows, f.t_start) for f in whole]
    assert {sensor for sensor, _, _ in left_out} == {"acc", "gyr", "mag"}


@pytest.mark.parametrize("scenario", ["handheld", "poses"])
def test_a_knock_is_placed_and_measured(scenario: str) -> None:
    sound = simulate(scenario, {"gyr.bias": None}, seed=5, duration=40.0)
    log = with_fault(sound, "knock").to_log()
    found = diagnosed(log)
    (named,) = found.data_faults
    assert (found.verdict, found.best, named.fault) == ("unknown", None, "knock")
    assert log.acc is not None
    changed = log.t[np.flatnonzero((log.acc != sound.acc).any(axis=1))[0]]
    assert named.t_start == pytest.approx(changed, abs=1.0)
    angle = float(named.evidence.partition("turned by ")[2].split()[0])
    assert 1.9 < angle < 4.1


def turning_slowly(log: Log) -> Log:
    """Let the mount give way steadily, by two degrees in all: no knock."""
    course = (log.t - log.t[0]) / (log.t[-1] - log.t[0])
    turn = Rotation.from_rotvec(np.radians(2.0) * course[:, None] * [[0.6, 0.0, 0.8]])
    return replace(log, acc=turn.apply(log.acc), gyr=turn.apply(log.gyr), mag=turn.apply(log.mag))


def test_a_mount_that_gives_way_steadily_is_no_knock() -> None:
    log = turning_slowly(simulate("handheld", {}, seed=3, duration=40.0).to_log())
    assert SensorModel().compare(log).data_faults == ()


@pytest.mark.parametrize(
    ("scenario", "effect"),
    [("arm", "ref.delay"), ("arm", "ref.skew"), ("handheld", "gyr.warmup"), ("poses", "acc.bias_drift")],
)
def test_effects_of_time_and_mount_are_no_faults(scenario: str, effect: str) -> None:
    log = simulate(scenario, {effect: None}, seed=6, duration=30.0, size=3.0, realistic=True).to_log()
    assert SensorModel().compare(log).data_faults == ()


def test_of_several_logs_the_faulty_one_is_named_and_the_answer_stands_without_it() -> None:
    sound = [simulate("handheld", {"gyr.scale": {"x": 0.01}}, seed=seed, duration=12.0).to_log() for seed in (2, 3)]
    turned = faulty("handheld", "mount")
    found = SensorModel().fit([sound[0], turned, sound[1]]).diagnose()
    assert (found.verdict, found.best) == ("unknown", None)
    assert [(each.fault, each.file) for each in found.data_faults if each.spoils] == [("mount", "log 2")]
    assert "The data of log 2 are at fault" in found.sentence
    (rest,) = found.without
    assert (rest.files, rest.verdict, rest.best) == (("log 2",), "missing", "gyr.scale")
    # Of one log there is no file to name.
    assert "file" not in diagnosed(turned).to_dict()["data_faults"][0]


def test_samples_left_out_of_one_of_several_logs_do_no_harm() -> None:
    stuck = with_fault(simulate("handheld", {"gyr.scale": {"x": 0.01}}, seed=2, duration=12.0), "stuck").to_log()
    sound = simulate("handheld", {"gyr.scale": {"x": 0.01}}, seed=3, duration=12.0).to_log()
    found = imufit.ladder([sound, stuck])
    assert found.model == ("gyr.scale",)
    assert found.verdict == "adequate"
    assert [(each.fault, each.file) for each in found.diagnosis.data_faults] == [("stuck", "log 2")]
    assert "log 2" in " ".join(found.sentences())


def test_a_knock_in_one_of_several_logs_is_named_with_its_log() -> None:
    logs = [simulate("handheld", {}, seed=5, duration=20.0).to_log()]
    logs.append(with_fault(simulate("handheld", {}, seed=7, duration=20.0), "knock").to_log())
    found = SensorModel().fit(logs).diagnose()
    assert [(each.fault, each.file, each.spoils) for each in found.data_faults] == [("knock", "log 2", True)]
    assert found.verdict == "unknown"
    assert [each.verdict for each in found.without] == ["adequate"]


def test_a_reference_in_packets_is_spread_and_named() -> None:
    log = simulate("handheld", {}, seed=3, duration=40.0).to_log()
    table = log.to_dataframe()
    reference = [name for name in table.columns if name.startswith("ref_")]
    poses = table[["t", *reference]].copy()
    packet = np.arange(len(poses)) // 6
    arrival = poses.groupby(packet)["t"].transform("mean")
    # The middle of six lies between two readings.
    poses["t"] = arrival + 1.5e-5 * (np.arange(len(poses)) % 6 - 2.5)
    both = pd.concat([table.drop(columns=reference), poses]).sort_values("t", ignore_index=True)
    found = diagnosed(Log.from_dataframe(both, log.metadata))
    (fault,) = found.data_faults
    assert (fault.fault, fault.sensor, fault.spoils) == ("packets", "ref", False)
    assert "packets of 6" in fault.evidence
    assert found.verdict == "adequate"
