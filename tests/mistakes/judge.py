"""The judge: writes a spoilt log, asks `imufit diagnose`, and says whether the mistake was named."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from mistakes.catalogue import Mistake, Remedy
from mistakes.shell import imufit
from mistakes.sound import Sound
from mistakes.spoils import READINGS, Log, as_csv

NEAR = 1e-3
"""Largest difference between restored and sound readings, RMS, as a part of the RMS of the sound ones."""
MAP = re.compile(r"--map\s+(?:'([^']*)'|\"([^\"]*)\"|(\S+))")
"""A mapping in an answer, as a shell takes it."""


class Kind(StrEnum):
    """What came of a spoilt log, the most harmful first."""

    WRONG_MISSING = "wrong missing"
    UNNOTICED = "unnoticed"
    MISLED = "another mistake named"
    CRASHED = "crashed"
    INVENTED = "named though harmless"
    WRONG_REMEDY = "named, but the mapping does not restore"
    NO_REMEDY = "named, but without a mapping"
    REFUSED_OTHERWISE = "refused for another reason"
    UNKNOWN_ONLY = "unknown, not named"
    NAMED = "named"
    READ_RIGHT = "read right"
    UNTOUCHED = "harmless, not named"


RIGHT = (Kind.NAMED, Kind.READ_RIGHT, Kind.UNTOUCHED)
"""Outcomes that do the user no harm."""


@dataclass(frozen=True)
class Answer:
    """What `imufit diagnose` said: exit status, standard error, and the JSON where there is one."""

    code: int
    stderr: str
    json: dict[str, Any] | None

    @property
    def faults(self) -> dict[tuple[str, ...], str]:
        """Text of every fault, by kind, sensor and channel."""
        found: dict[tuple[str, ...], str] = {}
        for fault in (self.json or {}).get("data_faults", []):
            key = (str(fault["fault"]), str(fault["sensor"]), str(fault["channel"]))
            text = f"{' '.join(key)} {fault['evidence']} {fault['remedy']}"
            found[key] = f"{found.get(key, '')} {text}"
        return found

    @property
    def notes(self) -> list[str]:
        """Lines of standard error and notes of the answer."""
        noise = (self.json or {}).get("noise", [])
        large = [f"noise of {part['channel']}: {part['component']}" for part in noise if (part["share"] or 0) > 0.5]
        return [*self.stderr.splitlines(), *map(str, (self.json or {}).get("notes", [])), *large]

    @property
    def verdict(self) -> str:
        """Verdict, or `refused`."""
        return str(self.json["verdict"]) if self.json else "refused"

    @property
    def blamed(self) -> frozenset[str]:
        """Effects said to be missing."""
        if self.json is None or self.verdict not in ("missing", "ambiguous"):
            return frozenset()
        return frozenset(x for x in (self.json["best"], *self.json["ambiguous_with"]) if x)

    @property
    def shown(self) -> frozenset[str]:
        """Effects said to be there: those blamed, and those that the sentence of a missing one names as well."""
        seen = self.json["candidates"] if self.json is not None and self.verdict == "missing" else []
        return self.blamed | {item["effect"] for item in seen if item["status"] == "significant"}

    @property
    def short(self) -> str:
        """The answer in a line."""
        if self.json is None:
            return self.stderr.strip()
        faults = "; ".join(self.faults.values())
        return f"{self.verdict} {' '.join(sorted(self.blamed))}: {faults or self.json['sentence']}"


@dataclass(frozen=True)
class Judgement:
    """What came of one mistake in one log."""

    mistake: str
    log: str
    real: bool
    kind: Kind
    message: str
    command: str
    blamed: frozenset[str]

    @property
    def right(self) -> bool:
        """Whether the user was told, or needed not to be."""
        return self.kind in RIGHT


def ask(path: Path) -> Answer:
    """Ask `imufit diagnose`."""
    done = imufit("diagnose", str(path), "--json", "-")
    try:
        return Answer(done.returncode, done.stderr, json.loads(done.stdout))
    except ValueError:
        return Answer(done.returncode, done.stderr, None)


def write(log: Log, path: Path) -> Path:
    """Write a log as a user does: Parquet with its metadata inside, or text with a TOML file beside."""
    if log.text is None and path.suffix == ".parquet":
        table = pa.table(log.table)
        pq.write_table(table.replace_schema_metadata({"imufit": json.dumps(log.metadata)}), path)
        return path
    path = path.with_suffix(".csv")
    path.write_bytes(as_csv(log).encode() if log.text is None else log.text)
    path.with_suffix(".toml").write_text(tomli_w.dumps(log.metadata), encoding="utf-8")
    return path


def judge(mistake: Mistake, sound: Sound, baseline: Answer, directory: Path, seed: int) -> Judgement | None:
    """Put a mistake into a sound log and judge the answer; None where the mistake cannot be noticed there.

    `baseline` is the answer on the sound log: what was said there names nothing.
    """
    if not mistake.needs <= sound.has:
        return None
    rng = np.random.default_rng([seed, *mistake.id.encode()])
    spoilt = mistake.spoil(sound.log, rng)
    if spoilt is None:
        return None
    name = re.sub(r"\W+", "_", f"{mistake.id} {sound.name}")
    path = write(spoilt, directory / f"{name}{rng.choice(['.csv', '.parquet'])}")
    answer = ask(path)
    kind = kind_of(mistake, sound, spoilt, baseline, answer, path)
    command = shlex.join(["imufit", "diagnose", str(path)])
    return Judgement(mistake.id, sound.name, sound.real, kind, answer.short, command, answer.blamed - baseline.blamed)


def kind_of(mistake: Mistake, sound: Sound, spoilt: Log, baseline: Answer, answer: Answer, path: Path) -> Kind:
    """Judge an answer."""
    if answer.code not in (0, 2) or "Traceback" in answer.stderr or (answer.code == 0 and answer.json is None):
        return Kind.CRASHED
    fresh = [text for key, text in answer.faults.items() if key not in baseline.faults]
    if mistake.harmless:
        return Kind.INVENTED if fresh or answer.verdict != baseline.verdict else Kind.UNTOUCHED
    # A note of the sound log names its file: what differs by that alone is no new note.
    known = {note.split(": ", 1)[-1] for note in baseline.notes}
    texts = fresh + [note for note in answer.notes if note.split(": ", 1)[-1] not in known]
    told = " ".join(texts).replace(path.stem, "")
    if names(told, mistake) or (answer.blamed | (answer.shown - baseline.shown)) & set(mistake.effects):
        return remedy_of(mistake, sound.log, told, path)
    if MAP.search(told) or (fresh and answer.verdict == "unknown"):
        # The user would follow a remedy for something else, and spoil the log once more.
        return Kind.MISLED
    return unnamed(mistake, sound, spoilt, baseline, answer, path)


def unnamed(mistake: Mistake, sound: Sound, spoilt: Log, baseline: Answer, answer: Answer, path: Path) -> Kind:
    """Judge an answer that does not name the mistake."""
    if answer.code == 2:
        return Kind.REFUSED_OTHERWISE
    if answer.blamed and not answer.blamed <= baseline.blamed:
        return Kind.WRONG_MISSING
    # Names and text may be read as they are meant: nothing is wrong then.
    rewritten = spoilt.text is not None or set(spoilt.table) != set(sound.log.table)
    if rewritten and mistake.remedy is Remedy.MAPPING and restores(path, None, sound.log, mistake.step):
        return Kind.READ_RIGHT
    return Kind.UNKNOWN_ONLY if answer.verdict == "unknown" else Kind.UNNOTICED


def names(told: str, mistake: Mistake) -> bool:
    """Whether a text has one of the words, and one of the places."""
    return any(stands(word, told) for word in mistake.words) and (
        not mistake.where or any(stands(word, told) for word in mistake.where)
    )


def stands(word: str, text: str) -> bool:
    """Whether a word stands in a text, whatever its case and blanks; a star at its end leaves the word's end open."""
    stem = word[:-1] if word.endswith("*") else word
    pattern = r"\s*".join(re.escape(part) for part in stem.split())
    before = r"(?<![A-Za-z0-9.])" if stem[0].isalnum() else ""
    after = r"(?![A-Za-z0-9])" if stem[-1].isalnum() and stem == word else ""
    return re.search(f"{before}{pattern}{after}", text, re.IGNORECASE) is not None


def remedy_of(mistake: Mistake, sound: Log, told: str, path: Path) -> Kind:
    """Judge the mapping of an answer that names the mistake, where one is asked for."""
    if mistake.remedy is not Remedy.MAPPING:
        return Kind.NAMED
    # The full stop of the sentence is no part of a mapping that stands without quotation marks.
    maps = [single or double or bare.rstrip(".,;:)") for single, double, bare in MAP.findall(told)]
    if not maps:
        return Kind.READ_RIGHT if restores(path, None, sound, mistake.step) else Kind.NO_REMEDY
    # One mapping may be for one sensor, or one of two that the log cannot tell apart.
    offered = dict.fromkeys([",".join(maps), *maps])
    return Kind.NAMED if any(restores(path, one, sound, mistake.step) for one in offered) else Kind.WRONG_REMEDY


def restores(path: Path, mapping: str | None, sound: Log, step: float) -> bool:
    """Whether `imufit convert` with a mapping makes the sound readings of a file."""
    out = path.with_name(f"{path.stem}_restored.parquet")
    done = imufit("convert", str(path), "-o", str(out), *(("--map", mapping) if mapping else ()))
    if done.returncode:
        return False
    table = pq.read_table(out)
    for name, truth in sound.table.items():
        if name not in table.column_names:
            if name in (*READINGS, "t"):
                return False
            continue
        got = table.column(name).to_numpy(zero_copy_only=False).astype(float)
        # Without the field told, the negative of the field and of the readings fits as well.
        either = name.startswith("ref_q") or (name.startswith("mag") and "mag_reference" not in sound.metadata)
        if got.shape != truth.shape or not near(got, truth, step, either=either, origin=name == "t"):
            return False
    return True


def near(got: np.ndarray[Any, Any], truth: np.ndarray[Any, Any], step: float, *, either: bool, origin: bool) -> bool:
    """Whether a column is the sound one, of either sign or from another origin where that is as good."""
    if origin:
        got, truth = got - got[0], truth - truth[0]
    rms = float(np.sqrt(np.nanmean(truth**2)))
    errors = [float(np.sqrt(np.nanmean((sign * got - truth) ** 2))) for sign in ((1, -1) if either else (1,))]
    return min(errors) <= NEAR * rms + step
