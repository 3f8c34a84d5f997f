"""The studio's session without a browser: its numbers are those of the command line, and what it copies makes them.

The time of an answer is that of the processor, which other work on the machine does not lengthen.
"""

import json
import subprocess
import sys
import time

import imufit
import numpy as np
import pytest
from cli_stand_in import strict_json
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from imufit.log import Reading
from imufit.results import Parameter
from imufit.studio.log_file import LogFile, Way, arrived, offers, option_words, remedies
from imufit.studio.mystery import Mystery
from imufit.studio.recipe import as_python, as_shell
from imufit.studio.session import Session, worst_channel
from imufit.studio.session_file import Kept, LogsWantedError, as_toml, read_session
from imufit.studio.stack import Action, Stack
from imufit.studio.view_model import unusual

EFFECTS = {"acc.bias": None, "gyr.scale": None}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("studio")
    simulate("handheld", EFFECTS, duration=40.0, rate=50.0, seed=4).to_log().write(path / "walk.parquet")
    return path


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """A log in which one axis of the accelerometer is late: no effect of the catalogue is."""
    log = simulate("handheld", {}, duration=60.0, rate=50.0, seed=4).to_log()
    acc = log.acc.copy()
    acc[:, 0] = np.interp(log.t - 0.004, log.t, acc[:, 0])
    path = tmp_path_factory.mktemp("late") / "late.parquet"
    log.with_fields(acc=acc).write(path)
    return path


@pytest.fixture(scope="module")
def begun(folder):
    session = Session([imufit.open_log(folder / "walk.parquet")])
    session.begin()
    return session


@pytest.fixture
def session(begun):
    """The session back at its start; fits that were made stay."""
    begun.steps, begun.position, begun.second = begun.steps[:1], 0, None
    return begun


def command(folder, *arguments):
    """Run the program and return its standard output."""
    done = subprocess.run(
        [sys.executable, "-m", "imufit", *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout


def sorted_like(panels, others):
    """The panels in the order of others."""
    by_key = {(panel.channel, panel.covariate): panel for panel in panels}
    return [by_key[panel.channel, panel.covariate] for panel in others]


def climb(session):
    """Add what is best until nothing is missing; return the effects."""
    added = []
    while (best := session.diagnose().best) is not None:
        session.add(best)
        session.fit()
        added.append(best)
    return added


def test_the_numbers_are_those_of_ladder_and_diagnose(session, folder):
    first = json.loads(command(folder, "diagnose", "walk.parquet", "--json", "-"))
    assert strict_json(json.dumps(session.diagnose().to_dict())) == first
    assert set(climb(session)) == set(EFFECTS)
    ladder = json.loads(command(folder, "ladder", "walk.parquet", "--json", "-"))
    steps = session.steps[1:]
    assert [step.effect for step in steps] == [step["effect"] for step in ladder["steps"]]
    for step, of_ladder in zip(steps, ladder["steps"], strict=True):
        assert session.numbers(step.stack).ratio == of_ladder["after"]
        assert step.expected == of_ladder["expected"]
    for parameter in session.numbers().parameters:
        there = ladder["parameters"][parameter.effect][parameter.name]
        assert (parameter.value, parameter.standard_error) == (there["value"], there["standard_error"])


def test_an_effect_that_explained_the_log_as_well_is_not_forgotten(tmp_path):
    game = Mystery.hidden(3, 0, tmp_path)
    session = Session([LogFile(game.log, game.log.name).open()])
    session.begin()
    first = session.diagnose()
    best, *rivals = first.named
    assert rivals
    assert session.as_likely() == {}
    session.add(best)
    assert session.as_likely() == {best: tuple(rivals)}
    for rival in rivals:
        session.add(rival)
    assert session.as_likely() == {}
    session.position = 0
    assert session.as_likely() == {}


def test_a_switch_needs_no_pass_and_is_quick(session):
    climb(session)
    for effect in session.stack.effects:
        session.switch(effect, False)
        begin = time.process_time()
        numbers = session.numbers()
        assert time.process_time() - begin < 0.1
        drawn = session.panels_at_once()
        assert time.process_time() - begin < 0.1
        fitted = session.fit().numbers
        for quick, exact in zip(drawn, sorted_like(session.compare().panels, drawn), strict=True):
            assert np.abs(quick.mean - exact.mean).max() < 0.05 * quick.noise_floor
        assert numbers.ratio == pytest.approx(fitted.ratio, rel=1e-3)
        for quick, exact in zip(numbers.parameters, fitted.parameters, strict=True):
            assert abs(quick.value - exact.value) < 0.2 * exact.standard_error
        session.undo()
    assert session.numbers().fitted


def test_an_effect_that_is_not_linear_takes_a_pass(session):
    session.add("gyr.lowpass")
    assert session.needs_pass(session.stack)
    assert session.numbers() is None
    assert session.fit().numbers.fitted


def test_undo_redo_and_a_step_after_undo(session):
    session.add("acc.bias")
    session.add("gyr.scale")
    session.undo()
    assert session.stack.effects == ("acc.bias",)
    assert session.can_redo
    session.redo()
    assert session.stack.effects == ("acc.bias", "gyr.scale")
    session.undo()
    session.switch("acc.bias", False)
    assert not session.can_redo
    assert [step.action for step in session.steps] == [Action.START, Action.ADD, Action.OFF]
    assert session.stack.model == Stack()
    assert session.stack.effects == ("acc.bias",)


def test_a_step_that_cannot_be_fitted_is_given_up(session):
    session.add("acc.bias")
    session.add("gyr.scale")
    session.give_up()
    assert session.stack.effects == ("acc.bias",)
    assert not session.can_redo
    session.give_up()
    session.give_up()
    assert [step.action for step in session.steps] == [Action.START]


def test_a_fixed_value_stays_and_is_fitted_again(session):
    session.add("acc.bias")
    fitted = session.fit().numbers
    session.hold("acc.bias", "x", 0.5)
    held = session.fit().numbers
    x = held.parameters[0]
    assert (x.value, x.fixed, x.standard_error) == (0.5, True, 0.0)
    assert x.shown == "0.5 m/s² (fixed)"
    assert held.ratio > 2.0 * fitted.ratio
    found = session.diagnose()
    assert found.sentence.startswith("acc.bias.x is fixed at 0.500 m/s², but the data give ")
    assert found.sentence.endswith(": estimate the parameter, or correct its value.")
    assert found.unexplained == ()
    assert (session.step.label, session.step.key) == ("accelerometer bias x fixed", "acc.bias.x")
    session.free("acc.bias", "x")
    assert session.step.label == "accelerometer bias x estimated"
    assert session.fit().numbers == fitted
    session.hold("acc.bias", "x", fitted.parameters[0].value)
    assert session.fit().numbers.parameters[0].shown == f"{fitted.parameters[0].value:.6g} m/s² (fixed)"
    with pytest.raises(InputError, match="has no parameter q"):
        session.hold("acc.bias", "q", 0.5)


def test_a_value_is_held_apart_where_the_log_gave_another_one(session):
    session.add("acc.bias")
    x = session.fit().numbers.parameters[0]
    assert not session.held_apart()
    for value, apart in ((x.value, False), (x.value + 2.0 * x.standard_error, False), (0.5, True)):
        session.hold("acc.bias", "x", value)
        session.fit()
        assert session.held_apart() is apart


def test_the_values_of_an_effect_stand_while_a_pass_is_under_way(session):
    session.add("acc.bias")
    before = session.fit().numbers.parameters
    session.hold("acc.bias", "y", 0.0625)
    assert session.numbers() is None
    x, y, z = session.latest_parameters(session.stack.entry("acc.bias"))
    assert (x, z) == (before[0], before[2])
    assert (y.value, y.fixed) == (0.0625, True)
    session.fit()
    assert session.latest_parameters(session.stack.entry("acc.bias")) == session.numbers().parameters


def test_a_value_far_above_those_of_such_sensors_is_doubted():
    parameter = Parameter("gyr.scale", "x", 0.02, 0.001, "1", 0.02)
    assert unusual(parameter, 2.0) == unusual(parameter, -19.0) == unusual(parameter, None) == ""
    assert unusual(parameter, -1e9) == (
        "This is more than 10 times the typical size, 2.00 %. Check the number and its unit."
    )


def test_an_effect_is_refused_with_the_reason(session):
    with pytest.raises(InputError, match=r"mag\.current cannot be added"):
        session.add("mag.current")
    session.add("acc.bias")
    with pytest.raises(InputError, match="in the model already"):
        session.add("acc.bias")
    assert session.position == 1


def test_what_a_candidate_would_explain_needs_no_pass(session):
    before = {(p.channel, p.covariate): p for p in session.compare().panels}
    begin = time.process_time()
    after = session.explained("acc.bias")
    assert time.process_time() - begin < 0.1
    worst = worst_channel(session.compare())
    mean = {key: float(abs(panel.mean).mean()) for key, panel in before.items()}
    left = {(p.channel, p.covariate): float(abs(p.mean).mean()) for p in after}
    assert left.keys() == mean.keys()
    assert left[worst, "temp"] < 0.3 * mean[worst, "temp"]


def test_the_residual_stands_against_every_cause_that_a_finding_names(late):
    session = Session([imufit.open_log(late)])
    session.begin()
    found = session.diagnose().unexplained
    named = {(item.channel, item.covariate) for item in found}
    assert ("acc_x", "df/dt") in named
    panels = session.compare().panels
    shown = {(panel.channel, panel.covariate) for panel in panels}
    assert all(key in shown or key[1] in session.causes(key[0]) for key in named)
    panel, after, second = session.against_cause("acc_x", "df/dt", "acc.bias")
    # One axis alone is late: its changes explain what is left, which rises as their part does.
    assert np.polyfit(panel.centre, panel.mean, 1)[0] == pytest.approx(1.0, abs=0.05)
    assert panel.share > max(item.share for item in panels if item.channel == "acc_x")
    assert after is not None
    assert second is None
    assert session.against_cause("acc_x", "dm/dt") == (None, None, None)


def test_a_log_without_a_reference_shows_where_its_rests_fail():
    log = simulate("six_sides", {"acc.scale": {"x": 0.02, "y": -0.01, "z": 0.03}}, 4, duration=90.0, rate=50.0).to_log()
    bare = imufit.Log(log.t, acc=log.acc, gyr=log.gyr, mag=log.mag)
    session = Session([bare])
    session.begin()
    found = session.compare()
    assert not session.has_reference
    levels = {item.channel: (item.ratio, item.unit) for item in found.channels}
    assert {"acc_norm", "gyr_x", "mag_norm"} <= set(levels)
    assert levels["acc_norm"][1] == "m/s^2"
    assert worst_channel(found) == "acc_norm"
    assert {panel.covariate for panel in found.panels if panel.channel == "acc_norm"} >= {"f_x", "f_y", "f_z"}
    # z reads 3 % too much: the length at rest rises with |f_z|, by as much as the sensor's scale says.
    along_z = next(panel for panel in found.panels if (panel.channel, panel.covariate) == ("acc_norm", "f_z"))
    assert max(along_z.mean) == pytest.approx(0.03 * 9.81, rel=0.2)
    explained = session.explained("acc.scale")
    after = next(panel for panel in explained if (panel.channel, panel.covariate) == ("acc_norm", "f_z"))
    assert np.nanmax(np.abs(after.mean)) < 0.1 * max(along_z.mean)
    assert session.causes("acc_norm") == ()
    assert session.weigh_causes() == {name: {} for name, (ratio, _) in levels.items() if ratio > 1.05}


def test_few_fits_keep_their_evidence(session):
    for effect in ("acc.bias", "gyr.bias", "mag.hard_iron", "acc.scale", "gyr.scale"):
        session.add(effect)
        session.fit()
    full = [made for made in session._made.values() if made.fit.has_evidence]
    assert len(full) <= 4
    old = session.steps[1].stack
    ratio = session.numbers(old).ratio
    assert session.diagnose(old).model == ("acc.bias",)
    assert session.numbers(old).ratio == ratio


def test_python_and_shell_make_the_same_model(session, folder, tmp_path):
    climb(session)
    for held in (False, True):
        if held:
            session.hold("acc.bias", "y", 0.25)
        made = session.fit()
        (tmp_path / "walk.parquet").write_bytes((folder / "walk.parquet").read_bytes())
        files = (LogFile(folder / "walk.parquet", "walk.parquet"),)
        program = as_python(files, made.way) + "import json\nprint(json.dumps(fit.to_dict()))\n"
        done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert json.loads(done.stdout.splitlines()[-1]) == strict_json(json.dumps(made.fit.to_dict()))
        text = f'imufit() {{ {sys.executable} -m imufit "$@"; }}\n' + as_shell(files, made.way)
        subprocess.run(["sh", "-ec", text], cwd=tmp_path, capture_output=True, text=True, check=True)
        model = imufit.SensorModel.load(tmp_path / "model.toml")
        assert model.effects == made.fit.model.effects
        for there, here in zip(model.listed(), made.numbers.parameters, strict=True):
            # A value that is held is fitted with all effects at once; both ways stop within a hundredth of an error.
            slack = 0.01 * here.standard_error if held else 0.0
            assert there.value == pytest.approx(here.value, abs=slack, rel=0.0)
            assert there.fixed == here.fixed


def test_a_session_comes_back_from_its_file(session, folder):
    climb(session)
    session.hold("acc.bias", "y", 0.25)
    session.undo()
    session.second = session.steps[1].stack
    files = (LogFile(folder / "walk.parquet", "walk.parquet", Reading(frame="NED", noise={"acc": 0.02})),)
    kept = Kept(files, tuple(session.steps), session.position, session.second)
    path = folder / "work.toml"
    text = as_toml(kept)
    path.write_text(text)
    assert read_session(path) == kept
    for cut in range(0, len(text), 7):
        path.write_text(text[:cut])
        with pytest.raises(InputError):
            read_session(path)
    path.write_text(text.replace("walk.parquet", "gone.parquet"))
    with pytest.raises(LogsWantedError, match="not there") as wanted:
        read_session(path)
    assert wanted.value.names == ("gone.parquet",)
    path.write_text(text.replace('"acc.bias"', '"acc.nothing"'))
    with pytest.raises(InputError, match="unknown"):
        read_session(path)


def test_a_sensor_model_is_no_session(tmp_path):
    imufit.SensorModel(["gyr.bias"]).save(tmp_path / "model.toml")
    with pytest.raises(InputError, match="a sensor model or a calibration, not a session"):
        read_session(tmp_path / "model.toml")


def test_two_files_are_offered_to_be_joined(tmp_path):
    log = simulate("handheld", {"gyr.bias": None}, duration=40.0, rate=50.0, seed=5).to_log()
    log.with_fields(ref_q=None, ref_p=None).write(tmp_path / "sensor.csv")
    imufit.Log.from_arrays(log.t + 0.5, ref_q=log.ref_q).write(tmp_path / "mocap.csv")
    arrivals = [arrived(LogFile(tmp_path / name, name)) for name in ("mocap.csv", "sensor.csv")]
    assert [item.sensors for item in arrivals] == [(), ("acc", "gyr", "mag")]
    first, *others = offers(arrivals)
    assert first.way is Way.JOIN
    assert first.files[0].open().ref_q is not None
    assert [offer.way for offer in others] == [Way.OPEN]
    shell = as_shell(first.files, (Stack(),))
    assert shell.splitlines()[0] == "imufit join sensor.csv mocap.csv -o joined.parquet"
    with pytest.raises(InputError):
        arrived(LogFile(tmp_path / "none.csv", "none.csv"))


def test_a_fault_is_mended_by_the_options_of_its_remedy(tmp_path):
    log = simulate("handheld", {}, duration=60.0, rate=50.0, seed=6, frame="ENU").to_log()
    log.write(tmp_path / "walk.csv")
    file = LogFile(tmp_path / "walk.csv", "walk.csv", Reading(frame="NED"))
    session = Session([file.open()])
    session.begin()
    faults = session.diagnose().data_faults
    options = [option for fault in faults for option in remedies(fault.advice)]
    assert ("frame", "ENU") in options
    assert option_words(("frame", "ENU")) == "Read in frame ENU"
    mended = Session([file.mended(("frame", "ENU")).open()])
    mended.begin()
    assert mended.start.ratio < 1.1 < session.start.ratio


def test_two_models_are_weighed_as_compare_weighs_them(session, folder):
    assert session.weigh() is None
    session.second = Stack()
    session.add("acc.bias")
    log = imufit.read(folder / "walk.parquet")
    one, none = (imufit.fit(log, effects) for effects in (["acc.bias"], []))
    expected = imufit.compare(log, none, one).ln_bayes_factor
    assert expected > 5.0
    assert session.weighed() is None
    assert session.weigh() == pytest.approx(expected, rel=1e-3)
    assert session.weighed() == session.weigh()
