"""An engine with hand-made results behind the command line, so that its tests are about the command line."""

import json
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
from imufit.cli import engine
from imufit.cli.app import main
from imufit.figures.style import new_figure
from imufit.lab.simulate import Grade, ParameterGrade
from imufit.log import Log, contents
from imufit.results import Table
from loop_results import BIAS, addition, card, comparison, diagnosis, ladder, rows


class Fit:
    """A fit that hands out the hand-made results."""

    parameters = BIAS
    ratio = 1.52
    by_log = ()

    def compare(self, log=None, progress=None):
        progress(1, 1, "compare")
        return comparison()

    def diagnose(self, log=None, progress=None):
        return diagnosis()

    def add(self, effect, log=None, progress=None):
        result = addition()
        object.__setattr__(result, "fit", self)
        return result

    def to_dict(self):
        return {"model": ["gyr.bias"]}

    def save(self, path):
        path.write_text("saved")


class Truth:
    """What was done to the log."""

    scenario, seed = "handheld", 3
    effects: ClassVar = {"gyr.g_sensitivity": {"xx": 3.6e-5}}
    sizes: ClassVar = {"gyr.g_sensitivity": 3.0}

    def to_json(self):
        return {"effects": self.effects}


class Study:
    """The blind protocol's result."""

    def to_dict(self):
        return {"correct": True}

    def tables(self):
        return (Table("Blind logs", ("set", ">named"), (("one", "2/3"),)),)

    def lines(self):
        return ["missed: --set one --seed 7 --logs 1: " + "a long story " * 20 + "ends here"]


class Replay:
    """A replay of one filter with errors and one without."""

    def comparison(self, band_deg):
        return None

    def to_dict(self, comparison):
        return {"n": 100, "skipped": {"gap": 2}, "filters": {"mahony": {"total_deg": 1.5}, "gyro": None}}

    def plot(self):
        return new_figure(2.0, 1.0)

    def to_log(self):
        return SimpleNamespace(columns=("t", "acc_x"))


def install(monkeypatch):
    """Put the stand-in behind the command line and return the list of calls it gets."""
    calls = []

    def note(name, result):
        def function(*args, **kwargs):
            calls.append((name, args, kwargs))
            return result

        monkeypatch.setattr(engine, name, function)

    ladder_result = ladder()
    object.__setattr__(ladder_result, "fit", Fit())
    found = ParameterGrade("gyr.g_sensitivity", "xx", 3.6e-5, 3.5e-5, 1e-6)
    mark = Grade("right", ("gyr.g_sensitivity",), ("gyr.g_sensitivity",), (found,))
    simulation = SimpleNamespace(t=np.arange(200) / 100.0, truth=Truth())
    model = SimpleNamespace(fit=lambda log, progress: Fit(), compare=Fit().compare)
    two_rows = Log.from_arrays([0.0, 0.5], acc=[[0.0, 0.0, 9.8], [0.0, 0.0, 9.9]])
    for name, result in (
        ("open_log", "opened"),
        ("read_log", two_rows),
        ("contents", contents(two_rows)),
        ("sensor_model", model),
        ("ladder", ladder_result),
        ("rows_of_fit", rows()),
        ("compare_with_rows", (comparison(), rows())),
        ("explain", card()),
        ("load_effects", None),
        ("replay", Replay()),
        ("scenarios", {"handheld": "By hand.", "turntable": "A table."}),
        ("injections", ["gyr.bias", "gyr.g_sensitivity"]),
        ("simulate", simulation),
        ("hidden", simulation),
        ("unseal", Truth()),
        ("grade_answer", mark),
        ("blind_sets", {"one": "One effect.", "nothing": "None."}),
        ("grade_blind", Study()),
    ):
        note(name, result)
    ids = ("gyr.g_sensitivity", "gyr.bias", "gyr.scale", "acc.bias", "mag.hard_iron")
    cards = [type(card())(**{**vars(card()), "id": each}) for each in ids]
    note("catalogue", cards)

    def write(value, path):
        path.write_text("log")
        return path.with_name(path.name + ".sealed")

    monkeypatch.setattr(engine, "save_simulation", write)
    monkeypatch.setattr(engine, "write_log", write)
    return calls


def run(capsys, *arguments):
    """Run a command; return exit code, standard output and the lines of standard error."""
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err.splitlines()


def strict_json(text):
    """Parse JSON that has neither NaN nor infinity."""

    def refuse(name):
        raise ValueError(name)

    return json.loads(text, parse_constant=refuse)
