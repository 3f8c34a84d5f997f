"""The state of the studio: rows are shown before the evidence, and a bad log leaves what was there."""

import asyncio
import re
import threading
import time

import numpy as np
import pytest
from imufit.lab.simulate import simulate
from imufit.lab.simulated_log import save_simulation
from imufit.log import Log, read
from imufit.progress import silent
from imufit.studio.desk import Desk
from imufit.studio.log_file import LogFile, Way, option_words
from imufit.studio.session import Session
from imufit.studio.standstill import standstill


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("desk") / "walk.csv"
    save_simulation(simulate("handheld", {}, 1, duration=20.0, rate=50.0), path)
    return LogFile(path, path.name)


def written(path, names, rows):
    """A file of comma-separated rows."""
    path.write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")
    return LogFile(path, path.name)


@pytest.fixture
def spoilt(tmp_path):
    """A log that moves all the time, with neither a reference nor a rest."""
    rows = [f"{0.01 * k:.2f},{5 + k % 7},{k % 5},{9 - k % 3},{k % 4},{2 - k % 9},{k % 11}" for k in range(3000)]
    return written(tmp_path / "bare.csv", "t,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z", rows)


def test_rows_can_be_drawn_before_the_evidence_is_taken(log):
    desk, seen = Desk(), []
    desk.changed.subscribe(
        lambda: seen.append((desk.traces is not None and desk.traces.built, desk.session and desk.session.begun))
    )
    asyncio.run(desk.open([log]))
    assert (True, False) in seen
    assert seen[-1] == (True, True)


def test_a_log_that_cannot_be_judged_opens_and_says_why(log, spoilt):
    async def both() -> None:
        await desk.open([log])
        await desk.open([spoilt])

    desk = Desk()
    asyncio.run(both())
    assert desk.files == (spoilt,)
    assert desk.trouble == ""
    assert desk.session.refused
    assert "no reference attitude" in desk.session.refusal.problem
    assert "lying still" in str(desk.session.refusal.remedy)
    t, values = desk.traces.window(["acc_x"], *desk.traces.span, 100)["acc_x"].line()
    assert t.size == values.size > 100


def test_a_log_that_cannot_be_read_leaves_the_session_before_it(log, tmp_path):
    broken = tmp_path / "broken.csv"
    broken.write_text("t,acc_x,acc_y,acc_z\n0,0,0,9.8\n0.01,0,oops,9.8\n", encoding="utf-8")

    async def both() -> None:
        await desk.open([log])
        before.append((desk.session, desk.files, desk.traces, desk.models))
        await desk.open([LogFile(broken, broken.name)])

    desk, before = Desk(), []
    asyncio.run(both())
    assert broken.name in desk.trouble
    assert [(desk.session, desk.files, desk.traces, desk.models)] == before


def test_the_mean_rate_of_a_log_at_rest_is_that_of_its_gyroscope(tmp_path):
    noise = np.random.default_rng(1)
    t = np.arange(2000) * 0.01
    bias = np.radians([0.3, -0.2, 0.1])
    acc = noise.normal([0.1, 0.0, 9.81], 0.02, (2000, 3))
    rest = Log.from_arrays(t, acc=acc, gyr=bias + noise.normal(0.0, 0.002, (2000, 3)))
    said = standstill(rest)
    assert said.startswith("The log rests once")
    values = [float(text) for text in re.findall(r"[xyz] (-?[\d.]+) ±", said)]
    np.testing.assert_allclose(values, np.degrees(bias), atol=0.02)
    assert standstill(Log.from_arrays(t, acc=acc)).startswith("The log rests once")


def test_another_log_does_not_wait_for_the_work_on_the_one_before(log, tmp_path, monkeypatch):
    """Passes over a long log may take minutes, and nobody waits for their answer once another log is open."""
    other = tmp_path / "other.csv"
    save_simulation(simulate("handheld", {}, 2, duration=20.0, rate=50.0), other)
    judge, ended, begun = Session.diagnose, [], threading.Event()

    def endless(self, stack=None, progress=silent):
        if self.logs[0].path != log.path:
            return judge(self, stack, progress)
        try:
            while True:
                begun.set()
                progress(1, 10, "taking evidence")
                time.sleep(0.01)
        except BaseException:
            ended.append(True)
            raise

    async def both() -> None:
        first = asyncio.create_task(desk.open([log]))
        await asyncio.to_thread(begun.wait)
        await desk.open([LogFile(other, other.name)])
        await first

    monkeypatch.setattr(Session, "diagnose", endless)
    desk = Desk()
    asyncio.run(asyncio.wait_for(both(), 60.0))
    assert ended == [True]
    assert desk.session.logs[0].path == other
    assert desk.diagnosis is not None
    assert desk.trouble == ""


def test_work_on_a_model_ends_once_another_one_is_asked_about(log, monkeypatch):
    judge, asked, begun = Session.diagnose, [], threading.Event()

    def endless(self, stack=None, progress=silent):
        asked.append((stack or self.stack).model)
        if len(asked) > 1:
            return judge(self, stack, progress)
        while True:
            begun.set()
            progress(1, 10, "taking evidence")
            time.sleep(0.01)

    async def both() -> None:
        first = asyncio.create_task(desk.open([log]))
        await asyncio.to_thread(begun.wait)
        await desk.attempt(lambda: desk.session.add("acc.bias"))
        await first

    monkeypatch.setattr(Session, "diagnose", endless)
    desk = Desk()
    asyncio.run(asyncio.wait_for(both(), 60.0))
    assert desk.diagnosis is not None
    assert desk.session.stack.model.effects == ("acc.bias",)


def test_a_problem_meanwhile_does_not_stop_the_work(log):
    """The second click of a double click comes while the first one's fit is under way."""

    async def twice() -> None:
        await desk.open([log])
        await asyncio.gather(desk.attempt(add), desk.attempt(add))

    def add() -> None:
        desk.session.add("acc.bias")

    desk = Desk()
    asyncio.run(twice())
    assert "in the model already" in desk.trouble
    assert desk.session.stack.effects == ("acc.bias",)
    assert desk.session.made().diagnosis is not None
    assert desk.busy == ""


@pytest.fixture
def reference(log, tmp_path):
    rows = read(log.path)
    path = tmp_path / "poses.csv"
    table = np.column_stack([rows.t, rows.ref_q])
    np.savetxt(path, table, delimiter=",", header="t,ref_qw,ref_qx,ref_qy,ref_qz", comments="")
    return LogFile(path, path.name)


@pytest.mark.parametrize("brought", [True, False], ids=["dropped", "named when the studio starts"])
def test_rows_of_a_first_log_without_evidence_are_drawn_and_a_reference_can_be_joined(spoilt, reference, brought):
    async def both() -> None:
        await (desk.bring([spoilt]) if brought else desk.open([spoilt]))
        await desk.bring([reference])

    desk = Desk()
    asyncio.run(both())
    assert desk.session is not None
    assert desk.session.refused
    assert desk.files == (spoilt,)
    t, values = desk.traces.window(["acc_x"], *desk.traces.span, 100)["acc_x"].line()
    assert t.size == values.size > 100
    assert [(offer.way, offer.files) for offer in desk.offers] == [(Way.JOIN, (spoilt.joined(reference),))]


def test_a_reference_is_joined_to_the_log_that_is_shown(log, spoilt, reference):
    async def both() -> None:
        await desk.open([log])
        await desk.bring([reference])

    desk = Desk()
    asyncio.run(both())
    assert desk.files == (log,)
    assert [offer.files for offer in desk.offers] == [(log.joined(reference),)]


def test_a_log_with_sensors_can_be_the_reference_of_one_that_cannot_be_judged(log, spoilt):
    async def both() -> None:
        await desk.open([spoilt])
        await desk.bring([log])

    desk = Desk()
    asyncio.run(both())
    assert desk.files == (spoilt,)
    assert [(offer.way, offer.files) for offer in desk.offers] == [
        (Way.JOIN, (spoilt.joined(log),)),
        (Way.OPEN, (log,)),
    ]


def test_another_log_awaits_a_choice_while_the_model_is_not_saved(log, tmp_path):
    other = tmp_path / "other.csv"
    save_simulation(simulate("handheld", {}, 2, duration=20.0, rate=50.0), other)
    brought = LogFile(other, other.name)

    async def steps() -> None:
        await desk.open([log])
        assert not desk.unsaved
        await desk.attempt(lambda: desk.session.add("gyr.bias"))
        assert desk.unsaved
        await desk.bring([brought])
        assert desk.files == (log,)
        assert [item.file for item in desk.arrivals] == [brought]
        desk.forget_arrivals()
        assert desk.files == (log,)
        assert not desk.arrivals
        desk.save()
        assert not desk.unsaved
        await desk.bring([brought])
        assert desk.files == (brought,)

    desk = Desk()
    asyncio.run(steps())


def test_a_session_awaits_a_choice_while_the_model_is_not_saved(log):
    kept = log.path.with_name("walk-session.toml")

    async def steps() -> None:
        await desk.open([log])
        await desk.attempt(lambda: desk.session.add("gyr.bias"))
        kept.write_text(desk.save(), encoding="utf-8")
        await desk.attempt(lambda: desk.session.add("acc.bias"))
        assert desk.unsaved
        await desk.bring([LogFile(kept, kept.name)])
        assert desk.kept_session == kept
        assert len(desk.session.steps) == 3
        desk.forget_arrivals()
        assert desk.kept_session is None
        await desk.bring([LogFile(kept, kept.name)])
        await desk.reopen(desk.kept_session)
        assert desk.kept_session is None
        assert len(desk.session.steps) == 2

    desk = Desk()
    asyncio.run(steps())


def test_a_session_that_is_reopened_knows_the_error_of_undone_steps(log):
    async def steps() -> None:
        await first.open([log])
        await first.attempt(lambda: first.session.add("gyr.bias"))
        await first.attempt(first.session.undo)
        kept.write_text(first.save(), encoding="utf-8")
        await second.reopen(kept)

    first, second, kept = Desk(), Desk(), log.path.with_name("walk-session.toml")
    asyncio.run(steps())
    assert second.session.position == 0
    ratios = [[desk.session.made(step.stack).numbers.ratio for step in desk.session.steps] for desk in (first, second)]
    assert ratios[0] == ratios[1]
    assert not second.unsaved


def test_the_page_says_what_is_waited_for_and_how_far_it_is():
    desk, said = Desk(), []
    assert desk.waiting_for == ""

    def work() -> None:
        for done in (0, 25, 100, 40, 100, 10):
            desk.progress(done, 100, "taking evidence")
            said.append(desk.waiting_for)

    asyncio.run(desk._in_thread("fitting the model to the log", work))
    assert said == [
        "Fitting the model to the log: 0 % of the rows are read.",
        "Fitting the model to the log: 25 % of the rows are read.",
        "Fitting the model to the log: all rows were read once.",
        "Fitting the model to the log: all rows were read once, and 40 % again.",
        "Fitting the model to the log: all rows were read 2 times.",
        "Fitting the model to the log: all rows were read 2 times, and 10 % again.",
    ]
    assert desk.waiting_for == ""


@pytest.fixture
def undeclared(tmp_path):
    """A log that never turns, so that nothing shows the unit of its gyroscope."""
    rows = [f"{0.01 * k:.2f},0,0,{9.8 + 0.01 * (k % 3)},{0.1 * (k % 4)},0.2,{0.1 * (k % 5)}" for k in range(400)]
    return written(tmp_path / "mystery.csv", "time,ax,ay,az,gx,gy,gz", rows)


def test_an_open_unit_has_one_answer_for_each_unit_that_names_its_columns(undeclared):
    desk = Desk()
    asyncio.run(desk.bring([undeclared]))
    words = [f"Read the gyroscope from gx gy gz in {unit}" for unit in ("rad/s", "deg/s")]
    assert [option_words(option) for option in desk.cures] == words
    asyncio.run(desk.mend(desk.cures[1]))
    assert desk.files[0].reading.mapping == {f"gyr_{axis}": f"g{axis}[deg/s]" for axis in "xyz"}


@pytest.mark.parametrize("typed", ["deg/s", "gyr_x=gx[furlong],gyr_y=gy,gyr_z=gz"])
def test_a_mapping_that_does_not_read_the_file_leaves_the_question_and_what_was_typed(undeclared, typed):
    async def both() -> None:
        await desk.bring([undeclared])
        asked.append((desk.trouble, desk.cures, desk.unmapped))
        await desk.remap(undeclared, typed)

    desk, asked = Desk(), []
    asyncio.run(both())
    assert [(desk.trouble, desk.cures, desk.unmapped)] == asked
    assert desk.typed == typed
    assert desk.mistyped.startswith("In mystery.csv: ")


def faulty(path, effects):
    """A simulated log with effects."""
    save_simulation(simulate("handheld", effects, 3, duration=20.0, rate=50.0), path)
    return LogFile(path, path.name)


def test_a_step_shows_where_the_error_falls_though_a_healthy_channel_was_chosen(tmp_path):
    async def look_at(channel: str) -> str | None:
        desk = Desk()
        await desk.open([log])
        desk.channel = channel
        await desk.attempt(lambda: desk.session.add("gyr.bias"))
        return desk.channel

    log = faulty(tmp_path / "bias.csv", {"gyr.bias": {"x": 0.05, "y": 0.0, "z": 0.0}})
    assert asyncio.run(look_at("acc_x")) is None
    assert asyncio.run(look_at("gyr_x")) == "gyr_x"
