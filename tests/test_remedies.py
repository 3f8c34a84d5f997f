"""Remedies name what the reader can paste: Python's keywords in Python, options on the command line."""

from __future__ import annotations

import ast
import io
import pickle
import re
import shlex
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import imufit
import numpy as np
import pandas as pd
import pytest
from imufit.cli.app import imufit as group
from imufit.cli.app import main
from imufit.errors import InputError
from imufit.lab.simulate.sealed import HEADER
from imufit.log import parse_mapping
from imufit.remedy import Reader, Remedy, mapped, option, told_to
from join_pairs import repetitive
from mistakes.catalogue import CATALOGUE, Mistake, Need
from mistakes.catalogue import Remedy as Wanted
from mistakes.judge import write
from mistakes.sound import Sound, simulated
from pasted import call_of, python_mappings, shell_mappings

G = 9.80665
COMMANDS = sorted(group.list_commands(None))
OPTION = re.compile(rf"--[a-z]|\bimufit ({'|'.join(map(re.escape, COMMANDS))})\b")
"""What no message to a Python user holds: an option, or a command of the program."""
NOT_SAID = {"imufit emulate ", HEADER}
"""What a device without hardware is called, and the first line of a sealed truth: no user is told what to do."""
SOURCES = Path(imufit.__file__).parent


@cache
def sound() -> pd.DataFrame:
    """A log without a fault, its frame NED."""
    return imufit.simulate("handheld", {}, seed=11, duration=20.0).to_log().to_dataframe()


def fresh() -> pd.DataFrame:
    table = sound().copy()
    table.attrs = {}
    return table


def program(*arguments: str) -> tuple[int, str, str]:
    """Exit code, output and error of the program, run in this process."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main(list(arguments))
    return code, out.getvalue(), err.getvalue()


def scaled(columns: str, factor: float) -> pd.DataFrame:
    return fresh().assign(**{name: sound()[name] * factor for name in sound().columns if name.startswith(columns)})


def by_hand() -> pd.DataFrame:
    """Counts of accelerometer and gyroscope in a maker's order of names, their units unsaid."""
    table = fresh()
    return pd.DataFrame(
        {
            "Time (ms)": table["t"] * 1e3,
            **{f"Acc{axis.upper()}": np.round(table[f"acc_{axis}"] / G * 16384) for axis in "xyz"},
            **{f"Gyro{axis.upper()}": np.round(np.degrees(0.0 * table[f"gyr_{axis}"]) * 131) for axis in "xyz"},
        }
    )


def foreign(swapped: bool = True) -> pd.DataFrame:
    """A file of other names, in other units, whose gyroscope has two axes exchanged."""
    table = fresh()
    order = dict(zip("xyz", "yxz" if swapped else "xyz", strict=True))
    return pd.DataFrame(
        {
            "Time (s)": table["t"],
            **{f"Acc{axis.upper()} (g)": table[f"acc_{axis}"] / G for axis in "xyz"},
            **{f"Gyro{axis.upper()} (deg/s)": np.degrees(table[f"gyr_{order[axis]}"]) for axis in "xyz"},
            **{f"ref_q{part}": table[f"ref_q{part}"] for part in "wxyz"},
        }
    )


MAPPED = [row for row in CATALOGUE if row.remedy is Wanted.MAPPING and not row.needs & {Need.STILL, Need.ANGLE}]
"""Mistakes of a moving sensor that a mapping undoes."""
FILES: dict[str, Callable[[], pd.DataFrame]] = {
    "accelerometer in g": lambda: scaled("acc_", 1 / G),
    "accelerometer in counts": lambda: scaled("acc_", 16384 / G),
    "gyroscope in deg/s": lambda: scaled("gyr_", 180.0 / np.pi),
    "one axis in deg/s": lambda: scaled("gyr_y", 180.0 / np.pi),
    "field in gauss": lambda: scaled("mag_", 0.01),
    "two sensors in other units": lambda: scaled("acc_", 1 / G).assign(
        **{f"gyr_{axis}": np.degrees(sound()[f"gyr_{axis}"]) for axis in "xyz"}
    ),
    "time in ms": lambda: fresh().assign(t=sound()["t"] * 1e3),
    "time in us": lambda: fresh().assign(t=np.round(sound()["t"] * 1e6)),
    "a slip in a name": lambda: fresh().rename(columns={"acc_x": "accel_x"}),
    "no time": lambda: fresh().drop(columns="t"),
    "units that nothing shows": by_hand,
    "no names": lambda: pd.DataFrame(np.column_stack([sound()[[f"{s}_{a}" for s in ("acc", "gyr") for a in "xyz"]]])),
    "sensors exchanged": lambda: fresh().rename(
        columns={f"{one}_{a}": f"{other}_{a}" for one, other in (("acc", "gyr"), ("gyr", "acc")) for a in "xyz"}
    ),
}
"""Tables that are refused, and whose message has the mapping with which they are read."""


def written(table: pd.DataFrame, path: Path) -> Path:
    table.to_csv(path, index=False, header=not all(isinstance(name, int) for name in table.columns))
    return path


def refused(given: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        imufit.diagnose(given)
    assert not OPTION.search(str(caught.value)), str(caught.value)
    return caught.value


@pytest.mark.parametrize("name", FILES)
def test_the_call_that_python_is_told_reads_the_file(name: str, tmp_path: Path) -> None:
    path = written(FILES[name](), tmp_path / "a b's.csv")
    error = refused(path)
    log = eval(call_of(str(error), "imufit.read"), {"imufit": imufit})
    assert log.n == len(sound())
    # a table in memory is told of its own function, and that runs with the table
    if name != "no names":
        df = FILES[name]()
        same = eval(call_of(str(refused(df)), "imufit.Log.from_dataframe"), {"imufit": imufit, "df": df})
        assert same.n == log.n


@pytest.mark.parametrize("name", FILES)
def test_the_option_that_the_command_line_is_told_reads_the_file(name: str, tmp_path: Path) -> None:
    path = written(FILES[name](), tmp_path / "a b's.csv")
    code, _, err = program("convert", str(path), "-o", str(tmp_path / "no.parquet"))
    assert code == 2
    assert "mapping=" not in err
    assert "imufit.read" not in err
    assert err == f"imufit: {' '.join(told(refused(path)).split())}\n"
    mapping = shell_mappings(err)[0]
    assert program("convert", str(path), "-o", str(tmp_path / "b.parquet"), "--map", mapping)[0] == 0
    assert imufit.read(tmp_path / "b.parquet").n == len(sound())


def told(error: InputError) -> str:
    """The message as the command line has it."""
    with told_to(Reader.SHELL):
        return str(error)


@pytest.mark.parametrize("kind", ["polars", "arrow", "columns", "groups", "log"])
def test_whatever_holds_the_table_can_be_read_again_with_a_mapping(kind: str) -> None:
    table, log = fresh(), imufit.Log.from_dataframe(fresh())
    assert log.gyr is not None
    df = {
        "polars": log.to_polars,
        "arrow": log.to_arrow,
        "columns": lambda: {name: table[name].to_numpy() for name in table.columns},
        "groups": lambda: {"t": log.t, "acc": log.acc, "gyr": log.gyr},
        "log": lambda: log,
    }[kind]()
    turned = imufit.Log.from_dataframe(df, mapping={"gyr_x": "-gyr_y", "gyr_y": "gyr_x"}, frame="ENU")
    np.testing.assert_allclose(turned.gyr, log.gyr[:, [1, 0, 2]] * [-1.0, 1.0, 1.0])
    assert turned.metadata.frame == "ENU"


@dataclass(frozen=True)
class Finding:
    """A fault that is found in a log, and what is made of the log with it."""

    spoil: Callable[[], pd.DataFrame]
    fault: str


FINDINGS = {
    "axes": Finding(lambda: fresh().assign(gyr_x=sound()["gyr_y"], gyr_y=-sound()["gyr_x"]), "axes"),
    "conjugated": Finding(lambda: fresh().assign(**{f"ref_q{a}": -sound()[f"ref_q{a}"] for a in "xyz"}), "quaternion"),
    "exchange": Finding(lambda: fresh().assign(acc_x=sound()["mag_x"], mag_x=sound()["acc_x"]), "columns"),
    "clock": Finding(lambda: fresh().assign(t=sound()["t"] * 2.0), "clock"),
    "other names": Finding(foreign, "axes"),
}


@pytest.mark.parametrize("name", FINDINGS)
def test_a_fault_of_the_data_has_both_remedies_and_both_cure(name: str, tmp_path: Path) -> None:
    path = written(FINDINGS[name].spoil(), tmp_path / "a.csv")
    found = imufit.diagnose(path)
    assert found.data_faults, "nothing was found"
    for text in (str(found), found.sentence, repr(found), *(fault.remedy for fault in found.data_faults)):
        assert not OPTION.search(text), text
    (mapping,) = python_mappings(found.data_faults[0].remedy)
    assert imufit.diagnose(imufit.read(path, mapping=mapping)).data_faults == ()
    code, out, _ = program("diagnose", str(path))
    assert code == 0
    assert "mapping=" not in out
    # the terminal breaks lines where it likes
    (shell,) = shell_mappings(found.data_faults[0].shell_remedy)
    assert re.sub(r"\s", "", f"--map '{shell}'") in re.sub(r"\s", "", out)
    json = tmp_path / "a.json"
    assert program("diagnose", str(path), "--map", shell, "--json", str(json))[0] == 0
    assert '"data_faults": []' in json.read_text()


NAMED = {
    "t": "Time (s)",
    **{f"acc_{axis}": f"Acc{axis.upper()} (g)" for axis in "xyz"},
    **{f"gyr_{axis}": f"Gyro{axis.upper()} (deg/s)" for axis in "xyz"},
}
"""What the columns of `foreign` are."""
NAMELESS = {name: f"c {k}" for k, name in enumerate(NAMED.values())}
"""Other names for them, which say nothing."""


@pytest.mark.parametrize("stated", [{}, {target: NAMELESS[name] for target, name in NAMED.items()}])
def test_turned_axes_are_put_right_by_the_names_of_the_file(stated: dict[str, str], tmp_path: Path) -> None:
    table = foreign()
    if stated:
        table = table.rename(columns=NAMELESS)
        stated = {
            target: source + {"acc": "[g]", "gyr": "[deg/s]"}.get(target[:3], "") for target, source in stated.items()
        }
    path = written(table, tmp_path / "a.csv")
    found = {}
    for kind in (True, False):
        (fault,) = imufit.diagnose(imufit.open_log(path, mapping=stated or None, stream=kind)).data_faults
        (found[kind],) = python_mappings(fault.remedy)
    mapping = found[True]
    assert found[False] == mapping
    assert not any(target in source for source in mapping.values() for target in NAMED if target != "t")
    assert all(source.rpartition("[")[0] in table.columns for source in mapping.values() if source.endswith("]"))
    right = imufit.read(path, mapping=mapping)
    for sensor in ("acc", "gyr"):
        wanted = imufit.Log.from_dataframe(fresh()).sensors()[sensor]
        np.testing.assert_allclose(right.sensors()[sensor], wanted, rtol=1e-6, atol=1e-9)
    assert imufit.diagnose(right).data_faults == ()


@pytest.mark.parametrize("mistake", MAPPED, ids=lambda row: row.id)
def test_no_mistake_is_answered_with_an_option_in_python(mistake: Mistake, motion: Sound, tmp_path: Path) -> None:
    spoilt = mistake.spoil(motion.log.rows(slice(0, 1200)), np.random.default_rng(7))
    assert spoilt is not None
    said = answered(write(spoilt, tmp_path / "log.csv"))
    assert not OPTION.search(said), said
    for mapping in python_mappings(said):
        # whether it restores the readings is judged elsewhere: here it is one that can be read
        assert parse_mapping(*(f"{target}={source}" for target, source in mapping.items())) == mapping


def answered(path: Path) -> str:
    """What Python is told about a log: a result as it is printed, or a refusal."""
    try:
        return str(imufit.compare(path))
    except InputError as error:
        return str(error)


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    return simulated("arm", 2, tmp_path_factory.mktemp("motion"))


def test_a_frame_is_named_as_keyword_and_as_option(tmp_path: Path) -> None:
    path = written(fresh(), tmp_path / "a.csv")
    (fault,) = imufit.diagnose(imufit.read(path, frame="ENU")).data_faults
    assert "frame='NED' in imufit.read" in fault.remedy
    assert "--frame NED" in fault.shell_remedy
    assert imufit.diagnose(imufit.read(path, frame="NED")).data_faults == ()
    assert imufit.diagnose(imufit.Log.from_dataframe(fresh(), frame="NED")).data_faults == ()


def test_a_late_reference_is_moved_by_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    table = sound()
    names = [name for name in table.columns if name.startswith("ref_")]
    shift = round(1.5 / float(np.median(np.diff(table["t"]))))
    late = fresh().assign(**table[names].shift(shift))
    written(late.iloc[shift:], Path("late.csv"))
    (fault,) = imufit.diagnose("late.csv").data_faults
    assert fault.fault == "late"
    joined = eval(call_of(fault.remedy, "imufit.join") + ".log", {"imufit": imufit})
    assert imufit.diagnose(joined).data_faults == ()
    command = shlex.split(fault.shell_remedy.partition(": ")[2])
    assert command[:2] == ["imufit", "join"]
    assert program(*command[1:])[0] == 0
    assert imufit.diagnose("joined.parquet").data_faults == ()


TURNS = [{"acc_x": "acc_y", "acc_y": "acc_x"}, {"acc_x": "acc_y", "acc_y": "acc_z", "acc_z": "acc_x"}]


@pytest.mark.parametrize("turn", TURNS)
def test_swapped_axes_of_a_calibration(tmp_path: Path, turn: dict[str, str]) -> None:
    recorded = imufit.simulate("six_sides", {}, seed=5).to_log()
    assert imufit.calibrate(recorded, sensors=["acc"]).sensors["acc"]
    turned = imufit.Log.from_dataframe(recorded, mapping=turn)
    with pytest.raises(InputError, match="the labels name other axes") as caught:
        imufit.calibrate(turned, sensors=["acc"])
    assert not OPTION.search(str(caught.value))
    (mapping,) = python_mappings(str(caught.value))
    # As the user reads the recording, with this mapping in the place of the own one.
    restored = imufit.Log.from_dataframe(recorded, mapping=mapping)
    np.testing.assert_array_equal(restored.acc, recorded.acc)
    turned.write(tmp_path / "a.parquet")
    code, _, err = program("calibrate", str(tmp_path / "a.parquet"), "--sensor", "acc")
    assert code == 2
    (shell,) = shell_mappings(err)
    assert program("calibrate", str(tmp_path / "a.parquet"), "--sensor", "acc", "--map", shell)[0] == 0


def test_a_calibration_names_the_columns_of_the_file(tmp_path: Path) -> None:
    recorded = imufit.simulate("six_sides", {}, seed=5).to_log()
    path = tmp_path / "bench.csv"
    names = {f"acc_{axis}": f"Accel{axis.upper()}" for axis in "xyz"}
    recorded.to_pandas().rename(columns=names).to_csv(path, index=False)
    swapped = {"acc_x": "AccelY", "acc_y": "AccelX", "acc_z": "AccelZ"}
    with pytest.raises(InputError, match="the labels name other axes") as caught:
        imufit.calibrate(imufit.read(path, mapping=swapped), sensors=["acc"])
    (mapping,) = python_mappings(str(caught.value))
    assert set(mapping.values()) == set(names.values())
    assert imufit.calibrate(imufit.read(path, mapping=mapping), sensors=["acc"]).sensors["acc"]


def test_a_refused_join_names_lag_and_attitude_in_both(tmp_path: Path) -> None:
    log = imufit.Log.from_dataframe(fresh())
    assert log.ref_q is not None
    bare = log.with_fields(ref_q=None)
    columns = {name: log.ref_q[:, k] for k, name in enumerate("abcd")}
    nameless = imufit.Log.of_fields(t=log.t + 3.0, covariates=columns)
    with pytest.raises(InputError, match="no columns have the names of an attitude") as caught:
        imufit.join(bare, nameless)
    assert "attitude=KIND:COLUMNS" in str(caught.value)
    assert not OPTION.search(str(caught.value))
    assert "--attitude KIND:COLUMNS" in str(caught.value.shell_remedy)
    assert imufit.join(bare, nameless, attitude="quaternion:a,b,c,d").lag == pytest.approx(3.0, abs=2e-3)
    with pytest.raises(InputError, match="names no columns"):
        imufit.join(bare, nameless, attitude="quaternion")
    with pytest.raises(InputError, match="no gyroscope") as caught:
        imufit.join(bare.with_fields(gyr=None), log)
    assert "mapping={'gyr_x': 'COLUMN[UNIT]', ...}" in str(caught.value)
    assert "--map gyr_x=COLUMN[UNIT],..." in str(caught.value.shell_remedy)


@pytest.mark.parametrize("seed", [3101, 3102])
def test_an_ambiguous_lag_is_given_as_python_and_as_the_command_line_are_told(seed: int, tmp_path: Path) -> None:
    one = repetitive(seed)
    log = imufit.Log(t=one.t, acc=one.acc, gyr=one.gyr)
    reference = imufit.Log(t=one.ref_t, ref_q=one.ref_q, frame="ENU")
    with pytest.raises(InputError, match="the lag is ambiguous") as caught:
        imufit.join(log, reference)
    assert not OPTION.search(str(caught.value))
    for lag in re.findall(r"lag=(-?[\d.]+\d)", str(caught.value)):
        assert imufit.join(log, reference, lag=float(lag)).lag == float(lag)
    files = [str(tmp_path / "a.parquet"), str(tmp_path / "b.parquet")]
    log.write(files[0])
    reference.write(files[1])
    out = str(tmp_path / "c.parquet")
    code, _, err = program("join", *files, "-o", out)
    assert code == 2
    lags = re.findall(r"--lag (-?[\d.]+\d)", err)
    assert len(lags) == 2
    for lag in lags:
        assert program("join", *files, "-o", out, "--lag", lag)[0] == 0


def test_notes_name_the_option_to_the_command_line_alone(tmp_path: Path) -> None:
    path = written(fresh().assign(temp=sound()["temp"] + 273.15), tmp_path / "a.csv")
    (note,) = [note for note in imufit.read(path).notes if "kelvin" in note]
    assert not OPTION.search(note)
    (mapping,) = python_mappings(note)
    assert np.nanmedian(imufit.read(path, mapping=mapping).temp) < 100.0
    code, out, _ = program("convert", str(path), "-o", str(tmp_path / "b.parquet"))
    assert code == 0
    assert shell_mappings(" ".join(out.split())) == ["temp=temp[K]"]


def test_an_error_survives_its_way_from_a_worker_with_both_remedies() -> None:
    remedy = "Use " + mapped({"acc_x": "a[g]"}) + " or " + option("lag", -0.5)
    error = InputError("no", file="a.csv", row=1, remedy=remedy)
    back = pickle.loads(pickle.dumps(error))
    for each in (error, back):
        assert str(each) == "a.csv: row 1: no. Use mapping={'acc_x': 'a[g]'} or lag=-0.5"
        assert each.remedy == "Use mapping={'acc_x': 'a[g]'} or lag=-0.5"
        assert each.shell_remedy == "Use --map 'acc_x=a[g]' or --lag -0.5"
        assert told(each) == "a.csv: row 1: no. Use --map 'acc_x=a[g]' or --lag -0.5"
    assert InputError("no", remedy="Do.").shell_remedy == InputError("no", remedy="Do.").remedy == "Do."
    assert InputError("no").shell_remedy is None


def test_the_program_leaves_the_words_of_python_behind() -> None:
    assert program("replay", "there is none.csv")[0] == 2
    assert str(Remedy("python", "shell")) == "python"


@pytest.mark.parametrize(
    ("ask", "near"),
    [
        (lambda log: imufit.Log.from_arrays(log.t, accel=log.acc), "Did you mean acc?"),
        (lambda log: imufit.Log.from_arrays(log.t, acc=log.acc, refrence=log.ref_q), "Did you mean reference?"),
        (
            lambda log: imufit.Log.from_arrays(log.t, acc=log.acc, magref=[2.0, 0.0, 4.0]),
            "Did you mean mag_reference?",
        ),
        (lambda log: imufit.Log.from_arrays(log.t, acc=log.acc, covariats={"vbat": log.t}), "Did you mean covariates?"),
        (lambda log: imufit.Log.from_arrays(log.t, acc=log.acc, gravty=9.8), "Did you mean gravity?"),
        (lambda log: imufit.Log.from_dataframe(log.to_pandas(), {"fram": "ENU"}), "Did you mean frame?"),
        (lambda log: imufit.diagnose(log, "gyr.bais"), "Did you mean gyr.bias?"),
        (lambda log: imufit.explain("acc.bais"), "Did you mean acc.bias?"),
        (lambda log: imufit.replay(log, "mahoney"), "Did you mean mahony?"),
        (lambda log: imufit.tune(log, "mahoni"), "Did you mean mahony?"),
        (lambda log: imufit.replay(log, "mahony", {"mahony": {"kp": 1.0}}), "Did you mean k_p?"),
        (lambda log: imufit.filters.Mahony(kp=1.0), "Did you mean k_p?"),
        (lambda _: imufit.simulate("handhled"), "Did you mean handheld?"),
        (lambda log: imufit.plot(log, columns=["tmep"]), "Did you mean temp?"),
        (lambda log: imufit.plot(log, show="readngs"), "Did you mean readings?"),
    ],
)
def test_a_name_that_is_not_known_gets_the_nearest(ask: Callable[[imufit.Log], Any], near: str) -> None:
    with pytest.raises(InputError) as caught:
        ask(imufit.Log.from_dataframe(fresh()))
    assert near in str(caught.value)


def test_options_of_the_command_line_stand_in_remedies_alone() -> None:
    """Outside the command line no text of the package holds an option, but what makes a remedy or a command."""
    found = [
        f"{path.relative_to(SOURCES)}:{text.lineno}: {text.value}"
        for path in sorted(SOURCES.rglob("*.py"))
        if path.relative_to(SOURCES).parts[0] not in ("cli", "remedy.py")
        and path.relative_to(SOURCES).as_posix() != "studio/recipe.py"
        for text in _texts(ast.parse(path.read_text()))
        if OPTION.search(str(text.value)) and text.value not in NOT_SAID
    ]
    assert not found, "\n".join(found)


def _texts(tree: ast.AST) -> list[ast.Constant]:
    """Constants of text that are neither docstrings nor within a call that makes a remedy."""
    makers = ("Remedy", "mapped", "option", "keyword", "template", "recovering", "command")
    out: list[ast.Constant] = []

    def walk(node: ast.AST) -> None:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in makers:
            return
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            out.append(node)
        for child in ast.iter_child_nodes(node):
            walk(child)

    walk(tree)
    return out
