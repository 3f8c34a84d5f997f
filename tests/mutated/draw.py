"""One input by a seed and an index: files and a command line, made by steps that can be left out one by one."""

import json
import random
import shlex
import tomllib
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from random import Random

import numpy as np
import tomli_w
from imufit.cli.app import imufit

from mutated import formats, options
from mutated.byte_mutations import BYTE_MUTATIONS
from mutated.column_mutations import COLUMN_MUTATIONS
from mutated.hostile import NAMES, TEXTS
from mutated.line_mutations import LINE_MUTATIONS
from mutated.seed_files import SeedFiles
from mutated.tree_mutations import JSON_MUTATIONS, TOML_MUTATIONS
from mutated.zip_mutations import ZIP_MUTATIONS

PYTHON = "python"
"""In place of a command: the function of the package that reads the file."""

READ_LOG = {
    "convert": 20,
    "compare": 13,
    "diagnose": 10,
    "fit": 10,
    "replay": 13,
    "calibrate": 8,
    "allan": 4,
    "tune": 2,
    "add": 3,
    "ladder": 2,
    "apply": 3,
    "info": 4,
    "plot": 1,
    "report": 2,
    "reveal": 1,
    PYTHON: 4,
}
"""Weights of the commands that are put to a log; those that the command line does not have are not drawn."""

READ_OTHER = {
    "model": 9,
    "settings": 3,
    "answer": 4,
    "sealed": 2,
    "part": 3,
    "sidecar": 4,
    "join": 2,
    "options": 6,
}
"""Weights of the inputs whose mutated file is no log (sidecar: the metadata beside one), beside all of READ_LOG."""

FORMATS = ("csv", "csv", "csv", "npz", "npz", "parquet", "parquet", "txt", "txt")

LEVELS = ("columns",) * 6 + ("format",) * 2 + ("bytes",)
"""Of a log's mutations most are such that a reader can pass them on to the computation."""

PLOT_SHARE, HTML_SHARE = 0.03, 0.05
"""Share of the inputs with a figure or a page, which take a second each."""


@dataclass
class Case:
    """An input.

    Attributes
    ----------
    arguments : list of str
        The command line without the program's name; paths are relative to the folder.
    files : dict
        Content of every file in the folder by its name.
    steps : list of str
        What was done to make the input one that nobody meant, in order.
    """

    arguments: list[str]
    files: dict[str, bytes]
    steps: list[str] = field(default_factory=list)

    def shell(self) -> str:
        """Write the command line as for a shell, cut where an argument is very long."""
        return " ".join(["imufit", *(shlex.quote(a if len(a) < 200 else a[:60] + "...") for a in self.arguments)])


class _Drawing:
    """Steps of one input: each has random numbers of its own, so that leaving one out does not change the others."""

    def __init__(self, seed: int, index: int, left_out: Collection[int]) -> None:
        self.key, self.left_out, self.count = f"{seed}/{index}", left_out, 0
        self.rng = Random(self.key)
        self.steps: list[str] = []

    def step(self, name: str, act: Callable[[Random], None]) -> None:
        number, self.count = self.count, self.count + 1
        if number not in self.left_out:
            act(Random(f"{self.key}/{number}"))
            self.steps.append(name)


def case(seeds: SeedFiles, seed: int, index: int, left_out: Collection[int] = ()) -> Case:
    """Draw an input, without the steps of the given numbers."""
    drawing = _Drawing(seed, index, left_out)
    weights = {name: weight for name, weight in READ_LOG.items() if name == PYTHON or name in imufit.commands}
    kinds = {**weights, **{name: w for name, w in READ_OTHER.items() if name != "join" or name in imufit.commands}}
    kind = drawing.rng.choices(list(kinds), list(kinds.values()))[0]
    made = _log_case(drawing, seeds, kind) if kind in weights else _other_case(drawing, seeds, kind)
    made.steps = drawing.steps
    return made


def _mutated(drawing: _Drawing, data: bytes, mutations: Collection[Callable[[Random, bytes], bytes]], n: int) -> bytes:
    held = [data]
    for _ in range(n):
        act = drawing.rng.choice(tuple(mutations))

        def change(rng: Random, act: Callable[[Random, bytes], bytes] = act) -> None:
            held[0] = act(rng, held[0])

        drawing.step(act.__name__, change)
    return held[0]


def _log_case(drawing: _Drawing, seeds: SeedFiles, command: str) -> Case:
    rng = drawing.rng
    log = rng.choice(("poses", "poses", "sides", "handheld") if command == "calibrate" else tuple(seeds.logs))
    format_ = rng.choice(FORMATS)
    files = _log_files(drawing, seeds, log, format_, "log")
    name = next(iter(files))
    arguments = _line(rng, command, name)
    if b" -> acc" in files[name][:300] and command != PYTHON:
        arguments += ["--map", "t=clock"]
    files.update(_needed(seeds, arguments))
    _options(drawing, command, arguments, rng.choice((0, 0, 0, 0, 1)))
    return Case(arguments, files)


def _log_files(drawing: _Drawing, seeds: SeedFiles, log: str, format_: str, stem: str) -> dict[str, bytes]:
    """Write a log with one to three mutations on the level of columns, lines, containers or bytes."""
    rng = drawing.rng
    columns = dict(seeds.logs[log])
    levels = [rng.choice(LEVELS) for _ in range(rng.choice((1, 1, 2, 3)))]
    for _ in range(levels.count("columns")):
        act = rng.choice(COLUMN_MUTATIONS)

        def change(own: Random, act: Callable[..., None] = act) -> None:
            if all(np.size(values) for values in columns.values()):
                act(own, columns)

        drawing.step(act.__name__, change)
    metadata = tomllib.loads(seeds.files[f"{log}.toml"].decode())
    writing = Random(f"{drawing.key}/writing")
    held = {"metadata": json.dumps(metadata).encode()}
    if format_ == "parquet" and rng.random() < 0.2:
        held["metadata"] = _mutated(drawing, held["metadata"], JSON_MUTATIONS, 1)
    if format_ == "csv":
        data = formats.csv(columns)
    elif format_ == "npz":
        data = formats.npz(columns, metadata if rng.random() < 0.5 else None, rng.random() < 0.3)
    elif format_ == "parquet":
        data = formats.parquet(columns, held["metadata"], writing)
    else:
        data = formats.transcript(columns, writing)
    own = {"csv": LINE_MUTATIONS, "npz": ZIP_MUTATIONS, "parquet": BYTE_MUTATIONS, "txt": LINE_MUTATIONS}[format_]
    data = _mutated(drawing, data, own, levels.count("format"))
    data = _mutated(drawing, data, BYTE_MUTATIONS, levels.count("bytes"))
    suffix = format_ if rng.random() < 0.97 else rng.choice(("csv", "npz", "parquet", "txt", "log", "toml"))
    files = {f"{stem}.{suffix}": data}
    if format_ in ("csv", "npz") and rng.random() < 0.7:
        files[f"{stem}.toml"] = seeds.files[f"{log}.toml"]
    return files


def _line(rng: Random, command: str, name: str) -> list[str]:
    """Write a command line that is meant, for a log of that name."""
    known = options.options(command)
    arguments = {
        "add": ["add", rng.choice(options.EFFECTS), name],
        "apply": ["apply", rng.choice(options.MEANT["model"]), name],
        "fit": ["fit", name, "--effects", rng.choice(options.MEANT["effects"])],
        "tune": ["tune", name, "--filter", rng.choice(("complementary", "mahony", "kalman"))],
        PYTHON: [PYTHON, rng.choice(("read", "open_log")), name],
    }.get(command, [command, name])
    if command == "fit" and "model" in known and rng.random() < 0.3:
        arguments = ["fit", name]
    if "model" in known and rng.random() < 0.15:
        arguments += ["--model", rng.choice(options.MEANT["model"])]
    if command in ("convert", "apply") or ("output" in known and rng.random() < 0.2):
        model = {"fit", "add", "ladder", "calibrate", "tune"}
        arguments += ["-o", "out.toml" if command in model else f"out.{rng.choice(('csv', 'npz', 'parquet'))}"]
    if "json" in known and rng.random() < 0.7:
        arguments += ["--json", rng.choice(("out.json", "-"))]
    if "plot" in known and rng.random() < PLOT_SHARE:
        arguments += ["--plot", "out.png"]
    if "html" in known and rng.random() < HTML_SHARE:
        arguments += ["--html", "out.html"]
    return arguments


def _options(drawing: _Drawing, command: str, arguments: list[str], n: int) -> None:
    """Add options, most of them with a value that nobody means."""
    known = options.options(command)
    for _ in range(n):
        names = options.drawable(command)
        if not names:
            return
        name = drawing.rng.choice(names)
        write = options.unmeant if drawing.rng.random() < 0.75 else options.meant

        def add(own: Random, name: str = name, write: Callable[..., list[str]] = write) -> None:
            arguments.extend(write(own, name, known[name]))

        drawing.step(f"--{name}", add)


def _needed(seeds: SeedFiles, arguments: list[str]) -> dict[str, bytes]:
    return {name: seeds.files[name] for name in arguments if name in seeds.files}


def _other_case(drawing: _Drawing, seeds: SeedFiles, kind: str) -> Case:
    return {
        "model": _model_case,
        "settings": _settings_case,
        "answer": _answer_case,
        "sealed": _sealed_case,
        "part": _part_case,
        "sidecar": _sidecar_case,
        "join": _join_case,
        "options": _options_case,
    }[kind](drawing, seeds)


def _tree_or_bytes(drawing: _Drawing, data: bytes, trees: Collection[Callable[[Random, bytes], bytes]]) -> bytes:
    data = _mutated(drawing, data, trees, drawing.rng.choice((1, 1, 2)))
    return _mutated(drawing, data, BYTE_MUTATIONS, drawing.rng.choice((0, 0, 0, 1)))


def _model_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    rng = drawing.rng
    data = _tree_or_bytes(drawing, seeds.files[rng.choice(options.MEANT["model"])], TOML_MUTATIONS)
    log = "handheld.csv"
    lines = [
        ["compare", log, "--model", "m.toml"],
        ["replay", log, "--filter", "mahony,mekf", "--model", "m.toml"],
        ["diagnose", log, "--model", "m.toml"],
        ["add", "gyr.bias", log, "--model", "m.toml"],
        ["apply", "m.toml", log, "-o", rng.choice(("out.csv", "out.parquet"))],
        ["export", "m.toml", "--to", rng.choice(options.MEANT["to"])],
        ["export", "m.toml", "--to", "json", "-o", "out.json"],
        [PYTHON, "load_model", "m.toml"],
    ]
    if "model" in options.options("fit"):
        lines.append(["fit", log, "--model", "m.toml"])
    arguments = rng.choice(lines)
    if arguments[0] != PYTHON and "-o" not in arguments and rng.random() < 0.5:
        arguments += ["--json", "out.json"]
    files = {"m.toml": data, log: seeds.files[log], "handheld.toml": seeds.files["handheld.toml"]}
    return Case(arguments, files)


def _settings_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    data = _tree_or_bytes(drawing, seeds.files["settings.toml"], TOML_MUTATIONS)
    arguments = ["replay", "handheld.csv", "--filter", "complementary", "--settings", "s.toml"]
    if drawing.rng.random() < 0.5:
        arguments += ["--json", "-"]
    return Case(arguments, {"s.toml": data, "handheld.csv": seeds.files["handheld.csv"]})


def _answer_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    data = _tree_or_bytes(drawing, seeds.files[drawing.rng.choice(options.MEANT["answer"])], JSON_MUTATIONS)
    files = {"a.json": data, **{name: seeds.files[name] for name in ("handheld.csv", "handheld.csv.sealed")}}
    arguments = ["reveal", "handheld.csv", "--answer", "a.json"]
    if "report" in imufit.commands and drawing.rng.random() < 0.3:
        arguments = ["report", "a.json"]
    return Case(arguments + drawing.rng.choice(([], ["--json", "out.json"])), files)


def _sealed_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    data = _tree_or_bytes(drawing, seeds.files["handheld.csv.sealed"], JSON_MUTATIONS)
    files = {"handheld.csv.sealed": data, **{name: seeds.files[name] for name in ("handheld.csv", "answer.json")}}
    return Case(["reveal", "handheld.csv", *drawing.rng.choice(([], ["--answer", "answer.json"]))], files)


def _part_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    name = "taken.parquet.part"
    data = _mutated(drawing, seeds.files[name], BYTE_MUTATIONS, drawing.rng.choice((1, 1, 2, 3)))
    out = drawing.rng.choice(([], ["-o", "out.csv"], ["--force"], ["--json", "-"], ["--keep"]))
    return Case(["recover", name, *out], {name: data})


def _sidecar_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    rng = drawing.rng
    log = rng.choice(tuple(seeds.logs))
    files = {"log.csv": seeds.files[f"{log}.csv"]}
    sidecar = _tree_or_bytes(drawing, seeds.files[f"{log}.toml"], TOML_MUTATIONS)
    if rng.random() < 0.3:
        values = {"frame": "NED", "gravity": 9.81, "rig_axis": "y", "acc_range": 20.0, "sensor": rng.choice(NAMES[:20])}
        sidecar = _tree_or_bytes(drawing, tomli_w.dumps(values).encode(), TOML_MUTATIONS)
    files["log.toml"] = sidecar
    command = rng.choice([name for name in READ_LOG if name in imufit.commands and name not in ("ladder", "reveal")])
    arguments = _line(rng, command, "log.csv")
    return Case(arguments, {**files, **_needed(seeds, arguments)})


def _join_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    rng = drawing.rng
    files = _log_files(drawing, seeds, "handheld", rng.choice(FORMATS), "sensor")
    name = next(iter(files))
    pair = [name, "walk.csv"] if rng.random() < 0.5 else ["walk.csv", name]
    return Case(["join", *pair, "-o", "out.csv"], {**files, "walk.csv": seeds.files["walk.csv"]})


def _options_case(drawing: _Drawing, seeds: SeedFiles) -> Case:
    """A whole log, and options that nobody means."""
    rng = drawing.rng
    name = "handheld.csv"
    which = rng.random()
    files = {each: seeds.files[each] for each in (name, "handheld.toml")}
    if which < 0.12:
        made = Case(["explain"], {})
        drawing.step("effect", lambda own: made.arguments.append(own.choice((*NAMES, *TEXTS, *options.EFFECTS))))
        return made
    if which < 0.3:
        arguments = ["simulate", rng.choice(("handheld", "six_sides", "tilt")), "--duration", "5", "--rate", "20"]
        made = Case([*arguments, "-o", "out.csv"], {})
        _simulated(drawing, made.arguments)
        return made
    if which < 0.35:
        made = Case([rng.choice(("compare", "replay", "convert"))], files)
        drawing.step("path", lambda own: made.arguments.append(own.choice((*options.FOLDERS, *NAMES, *TEXTS))))
        return made
    command = rng.choice([each for each in READ_LOG if each in imufit.commands and each != "reveal"])
    arguments = _line(rng, command, name)
    made = Case(arguments, {**files, **_needed(seeds, arguments), "settings.toml": seeds.files["settings.toml"]})
    _options(drawing, command, made.arguments, rng.choice((1, 1, 2, 3)))
    made.files.update(_needed(seeds, made.arguments))
    return made


def _simulated(drawing: _Drawing, arguments: list[str]) -> None:
    """Add hostile options to `simulate`; lengths that are allowed and take for ever are not asked for."""
    known = options.options("simulate")
    for _ in range(drawing.rng.choice((1, 2))):
        name = drawing.rng.choice([each for each in options.drawable("simulate") if each not in ("duration", "rate")])

        def add(own: random.Random, name: str = name) -> None:
            arguments.extend(options.unmeant(own, name, known[name]))

        drawing.step(f"--{name}", add)
