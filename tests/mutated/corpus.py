"""Small inputs that once broke a rule of `mutated.judge`, each with the reason that it is kept for."""

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

import numpy as np

from mutated import formats
from mutated.column_mutations import Columns
from mutated.draw import PYTHON, Case
from mutated.seed_files import SeedFiles

Files = dict[str, bytes]


@dataclass(frozen=True)
class Kept:
    """An input: why it is kept, the command line, and how its files are made of whole ones."""

    reason: str
    arguments: tuple[str, ...]
    files: Callable[[SeedFiles], Files]

    def case(self, seeds: SeedFiles) -> Case:
        """Return it as an input."""
        return Case(list(self.arguments), self.files(seeds))


EMPTY_LOG = b"t,acc_x,acc_y,acc_z\n0,0,0,9.8\n"
MODEL = 'kind = "imufit sensor model"\nformat = 1\neffects = ["gyr.bias"]\n'
PARAMETERS = '[parameters."gyr.bias"]\n'
END = "[end]\ncomplete = true\n"
ZEROS = "x = 0.0\ny = 0.0\nz = 0.0\n"
EXPORT, REVEAL = ("export", "m.toml", "--to", "json"), ("reveal", "tilt.csv", "--answer", "a.json")
CONVERT, REPLAY = ("convert", "log.csv", "-o", "out.csv"), ("replay", "log.csv")
DEEP, DIGITS = 100_000, 5_001
"""Nested brackets that no parser can follow by calling itself; more digits than Python turns into a number."""


def nothing(_: SeedFiles) -> Files:
    return {}


def own(name: str, content: str | bytes) -> Callable[[SeedFiles], Files]:
    """Make one file that no whole one is needed for."""
    return lambda _: {name: content.encode() if isinstance(content, str) else content}


def beside_a_log(name: str, content: str) -> Callable[[SeedFiles], Files]:
    return lambda seeds: {name: content.encode(), "log.csv": seeds.files["handheld.csv"]}


def answer(content: str) -> Callable[[SeedFiles], Files]:
    """Make an answer to be graded, beside a log whose truth is sealed."""
    return lambda seeds: {"a.json": content.encode(), **{n: seeds.files[n] for n in ("tilt.csv", "tilt.csv.sealed")}}


def columns(
    log: str, rows: int | None = None, **changed: float | Callable[[np.ndarray], np.ndarray]
) -> Callable[[SeedFiles], Files]:
    """Write a log as CSV with columns that are constant or made of what they were."""

    def files(seeds: SeedFiles) -> Files:
        table: Columns = {name: values[:rows] for name, values in seeds.logs[log].items()}
        for name, change in changed.items():
            table[name] = change(table[name]) if callable(change) else np.full(len(table["t"]), change)
        return {"log.csv": formats.csv(table), "log.toml": seeds.files[f"{log}.toml"]}

    return files


def tiny(readings: np.ndarray) -> np.ndarray:
    return readings * 1e-100


def zip_flags(offset: int, value: int) -> Callable[[SeedFiles], Files]:
    """Write an NPZ whose first array claims something in its two headers: 6 = flags, 8 = method."""
    whole = formats.npz({"t": np.arange(3.0), "acc_x": np.zeros(3)})

    def files(_: SeedFiles) -> Files:
        data = bytearray(whole)
        for signature, further in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
            struct.pack_into("<H", data, data.find(signature) + offset + further, value)
        return {"log.npz": bytes(data)}

    return files


def required_column(seeds: SeedFiles) -> Files:
    """Make a Parquet file whose schema says of t that no value may miss; its statistics count those that may."""
    data = parquet(b"{}")(seeds)["log.parquet"]
    optional, required = (bytes.fromhex(f"150a25{kind}180174") for kind in ("02", "00"))
    assert optional in data
    return {"log.parquet": data.replace(optional, required)}


def parquet(metadata: bytes, name: str = "acc_x") -> Callable[[SeedFiles], Files]:
    table: Columns = {"t": np.arange(3.0), name: np.zeros(3)}
    return lambda _: {"log.parquet": formats.parquet(table, metadata, Random(1))}


KEPT: dict[str, Kept] = {
    "csv_note_twice": Kept(
        "a table with two columns of the same name has no column of that name",
        CONVERT,
        own("log.csv", b"t,acc_x,acc_y,acc_z,note,note\n0,0,0,9.8,True,True\n1,0,0,9.8,True,\n"),
    ),
    "npz_encrypted": Kept("zipfile raises a RuntimeError", ("convert", "log.npz", "-o", "out.csv"), zip_flags(6, 1)),
    "npz_method": Kept("zipfile raises NotImplementedError", ("convert", "log.npz", "-o", "out.csv"), zip_flags(8, 99)),
    "npz_open_bracket": Kept(
        "numpy takes the header of an array apart as Python, and the end does not come",
        ("convert", "log.npz", "-o", "out.csv"),
        lambda _: {"log.npz": formats.npz({"t": np.arange(9000.0)}).replace(b"(9000,), }", b"(9000,(, }")},
    ),
    "parquet_statistics": Kept(
        "pyarrow ends the process where a column's statistics do not fit its kind",
        ("convert", "log.parquet", "-o", "out.csv"),
        required_column,
    ),
    "parquet_deep_metadata": Kept(
        "the JSON parser's depth", ("convert", "log.parquet", "-o", "out.csv"), parquet(b"[" * DEEP)
    ),
    "sidecar_deep": Kept("the TOML parser's depth", REPLAY, beside_a_log("log.toml", f"a = {'[' * DEEP}{']' * DEEP}")),
    "sidecar_digits": Kept("Python's limit of digits", REPLAY, beside_a_log("log.toml", f"gravity = {'1' * DIGITS}")),
    "model_deep": Kept("the TOML parser's depth", EXPORT, own("m.toml", "a=" + "[" * DEEP)),
    "model_deep_python": Kept("the same in Python", (PYTHON, "load_model", "m.toml"), own("m.toml", "a=" + "[" * DEEP)),
    "model_digits": Kept("Python's limit of digits", EXPORT, own("m.toml", f"a = {'1' * DIGITS}")),
    "model_dotted": Kept(
        "a dotted key of 100,000 parts takes the TOML parser gigabytes",
        EXPORT,
        own("m.toml", "a." * DEEP + "b = 1"),
    ),
    "model_effects_number": Kept(
        "effects that are no list", EXPORT, own("m.toml", MODEL.replace('["gyr.bias"]', "1.5"))
    ),
    "model_id_number": Kept("an effect that is no text", EXPORT, own("m.toml", MODEL.replace('"gyr.bias"', "1.5"))),
    "model_constants_text": Kept("constants that are no table", EXPORT, own("m.toml", MODEL + 'constants = "x"\n')),
    "model_parameters_number": Kept("parameters that are no table", EXPORT, own("m.toml", MODEL + "parameters = 1\n")),
    "model_values_number": Kept(
        "parameters of an effect that are no table", EXPORT, own("m.toml", f'{MODEL}[parameters]\n"gyr.bias" = 1\n')
    ),
    "model_value_too_large": Kept(
        "a whole number that no float holds", EXPORT, own("m.toml", f"{MODEL}{PARAMETERS}x = 1{'0' * 400}\n")
    ),
    "model_long_name": Kept(
        "a name of 20,000 characters was repeated whole",
        EXPORT,
        own("m.toml", f"{MODEL}{PARAMETERS}{'x' * 20_000} = 1\n"),
    ),
    "model_escape_code": Kept(
        "an escape code in a name reached the terminal",
        EXPORT,
        own("m.toml", f'{MODEL}{PARAMETERS}"\\u001b[31m" = 1\n'),
    ),
    "model_infinite_error": Kept(
        "a standard error that JSON has no word for",
        EXPORT,
        own(
            "m.toml",
            f'last = "[end]"\n{MODEL}{PARAMETERS}{ZEROS}[standard_errors."gyr.bias"]\nx = -inf\n{END}',
        ),
    ),
    "answer_deep": Kept("the JSON parser's depth", REVEAL, answer('{"a":' * DEEP)),
    "answer_digits": Kept("Python's limit of digits", REVEAL, answer("1" * DIGITS)),
    "answer_candidates_text": Kept(
        "candidates that are no list",
        REVEAL,
        answer(json.dumps({"verdict": "missing", "best": "gyr.bias", "ambiguous_with": [], "candidates": "x"})),
    ),
    "answer_parameter_text": Kept(
        "a standard error that is text",
        REVEAL,
        answer(
            json.dumps(
                {
                    "verdict": "missing",
                    "best": "gyr.bias",
                    "candidates": [
                        {"effect": "gyr.bias", "parameters": {"x": {"value": 0.1, "standard_error": "NED"}}}
                    ],
                }
            )
        ),
    ),
    "nul_in_output": Kept("a path with NUL", ("convert", "log.csv", "-o", "nul\0.csv"), own("log.csv", EMPTY_LOG)),
    "nul_in_json": Kept(
        "a path with NUL", ("convert", "log.csv", "-o", "out.csv", "--json", "nul\0.json"), own("log.csv", EMPTY_LOG)
    ),
    "nul_in_effects": Kept("a path with NUL", ("explain", "--effects-from", "nul\0.py"), nothing),
    "escape_code_in_output": Kept(
        "an escape code in a path reached the terminal",
        ("convert", "log.csv", "-o", "\x1b[31mred.csv"),
        own("log.csv", EMPTY_LOG),
    ),
    "escape_code_in_mapping": Kept(
        "an escape code in a mapping reached the terminal",
        ("convert", "log.csv", "-o", "out.csv", "--map", "temp=\x1b[31mred[K]"),
        own("log.csv", EMPTY_LOG),
    ),
    "escape_code_in_header": Kept(
        "an escape code in a column's name reached the terminal",
        CONVERT,
        own("log.csv", EMPTY_LOG.replace(b"t,", b"\x1b[31mtime,")),
    ),
    "long_path": Kept("a path of 20,000 characters was repeated whole", ("compare", "x" * 20_000), nothing),
    "long_option": Kept(
        "a value of 20,000 characters was repeated whole", ("simulate", "tilt", "--seed", "x" * 20_000), nothing
    ),
    "steps_of_months": Kept(
        "rows 231 days apart took for ever", REPLAY, columns("handheld", rows=3, t=lambda t: np.arange(len(t)) * 2e7)
    ),
    "steps_too_small": Kept(
        "steps of 5e-324 s make an infinite rate",
        REPLAY,
        columns("tilt", t=lambda t: np.arange(len(t)) * 5e-324),
    ),
    "temperature_1e308": Kept(
        "a sum of temperatures overflows: panic", ("diagnose", "log.csv"), columns("walk", temp=1e308)
    ),
    "temperature_1e300_calibrate": Kept(
        "a bias by such temperatures is a singular matrix",
        ("calibrate", "log.csv"),
        columns("sides", temp=lambda temp: temp + 1e300),
    ),
    "covariate_1e300": Kept(
        "the square of a covariate overflows", ("compare", "log.csv"), columns("table", vbat=1e300)
    ),
    "reading_1e_100": Kept(
        "the square of a variance is less than any number",
        ("allan", "log.csv"),
        columns("poses", acc_x=tiny, acc_y=tiny),
    ),
    "field_1e_308": Kept(
        "the square of a field is zero",
        ("compare", "log.csv"),
        columns("poses", mag_x=1e-308, mag_y=1e-308, mag_z=1e-308),
    ),
    "noise_1e_308": Kept(
        "the square of an error over the stated noise overflows",
        ("compare", "log.csv"),
        lambda seeds: {
            "log.csv": seeds.files["handheld.csv"],
            "log.toml": seeds.files["handheld.toml"].split(b"[noise]")[0] + b"[noise]\nacc = 1e-308\n",
        },
    ),
    "settings_deep": Kept(
        "the TOML parser's depth",
        ("replay", "log.csv", "--settings", "s.toml"),
        beside_a_log("s.toml", f"a = {'[' * DEEP}{']' * DEEP}"),
    ),
    "reading_1e308": Kept(
        "the median of readings overflows to infinity, which is no JSON",
        ("convert", "log.csv", "-o", "out.csv", "--json", "-"),
        columns("poses", mag_y=-1e308),
    ),
}
"""The inputs by their names."""
