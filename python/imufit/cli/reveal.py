"""``imufit reveal``: what was done to a simulated log."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import EXISTING, json_option
from imufit.cli.output import Output

if TYPE_CHECKING:
    from imufit.lab.simulate import Grade, Truth


def parameter_units(effects: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return the SI unit of each parameter of each of some effects; what no catalogue holds has none."""
    from imufit.errors import InputError  # noqa: PLC0415

    units = {}
    for key in effects:
        with suppress(InputError):
            units[key] = {name: unit for name, unit, _ in engine.explain(key).parameters}
    return units


def grade_rows(mark: Grade) -> tuple[tuple[str, str, str, str], ...]:
    """Return effect, name, truth and answer of each parameter that there is to find."""
    from imufit.figures import quantity  # noqa: PLC0415

    units = parameter_units(item.effect for item in mark.parameters)

    def shown(effect: str, name: str, value: float | None, error: float | None = None) -> str:
        unit = units.get(effect, {}).get(name)
        if unit is None or value is None:
            return quantity.number(value)
        return quantity.with_error(value, error or 0.0, unit)

    return tuple(
        (
            item.effect,
            item.name,
            shown(item.effect, item.name, item.truth),
            shown(item.effect, item.name, item.estimate, item.standard_error),
        )
        for item in mark.parameters
        if item.estimate is not None
    )


def truth_rows(truth: Truth) -> tuple[tuple[str, str, str], ...]:
    """Return effect, parameters and size of all that was injected, in the shown units."""
    from imufit.figures import quantity  # noqa: PLC0415

    units = parameter_units(truth.effects)
    rows = []
    for effect, parameters in truth.effects.items():
        known = units.get(effect, {})
        words = (
            f"{name} {quantity.quantity(value, known[name]) if name in known else quantity.number(value)}"
            for name, value in parameters.items()
        )
        rows.append((effect, ", ".join(words), f"{quantity.number(truth.sizes.get(effect), 2)} x noise"))
    return tuple(rows)


_AS_WRITTEN = "Give the JSON as imufit wrote it."


def read_answer(path: Path) -> dict[str, Any]:
    """Read the JSON of `diagnose` or `ladder`.

    Raises
    ------
    InputError
        The file is not such a JSON.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.log.documents import table_from_json_file  # noqa: PLC0415

    answer = table_from_json_file(path)
    if "verdict" not in answer:
        raise InputError("this is not the JSON of `imufit diagnose` or `imufit ladder`: it has no verdict", file=path)
    for key in ("candidates", "steps"):
        entries = answer.get(key, [])
        if not (isinstance(entries, list) and all(isinstance(entry, dict) and "effect" in entry for entry in entries)):
            raise InputError("this is not a list of effects", file=path, column=key, remedy=_AS_WRITTEN)
    entries = [*answer.get("candidates", []), *answer.get("steps", [])]
    by_effect = answer.get("parameters") or {}
    tables = [by_effect, *(by_effect.values() if isinstance(by_effect, dict) else ())]
    tables += [entry.get("parameters") or {} for entry in entries]
    if not all(isinstance(table, dict) for table in tables):
        raise InputError("this is not a table of parameters", file=path, column="parameters", remedy=_AS_WRITTEN)
    for table in tables[1:]:
        for name, value in table.items():
            parts = [value.get("value"), value.get("standard_error")] if isinstance(value, dict) else [value]
            if not all(part is None or isinstance(part, int | float) for part in parts):
                raise InputError("the parameter is not a number", file=path, column=name, remedy=_AS_WRITTEN)
    if not isinstance(answer.get("ambiguous_with") or [], list):
        raise InputError("this is not a list of effects", file=path, column="ambiguous_with", remedy=_AS_WRITTEN)
    return answer


@click.command()
@click.argument("log", metavar="LOG", type=EXISTING)
@click.option("--answer", type=EXISTING, metavar="JSON", help="Grade this JSON of `diagnose` or `ladder`.")
@json_option
def reveal(log: Path, *, answer: Path | None, json_file: Path | None) -> None:
    """Show the truth of the simulated LOG, and whether an answer was right."""
    from imufit.results import Table  # noqa: PLC0415
    from imufit.results.json_value import json_value  # noqa: PLC0415

    out = Output(json_file)
    read = read_answer(answer) if answer is not None else None
    truth = engine.unseal(log)
    value = {"truth": json_value(truth.to_json())}
    if truth.effects:
        out.say(f"Put into this log: {', '.join(truth.effects)}.", bold=True)
    else:
        out.say("Nothing was put into this log: only noise.", bold=True)
    if getattr(truth, "faults", ()):
        out.say(f"Faults of the data: {', '.join(truth.faults)}.")
    out.table(Table("", ("effect", "parameters", ">size"), truth_rows(truth)))
    if read is not None:
        mark = engine.grade_answer(truth, read)
        value["grade"] = json_value(asdict(mark))
        out.say(f"The answer names {', '.join(mark.answer) or 'no effect'}: {mark.mark}.", bold=True)
        out.table(Table("Truth and answer", ("effect", "parameter", ">truth", ">answer"), grade_rows(mark)))
    out.json(value)
