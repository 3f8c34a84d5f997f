"""``imufit explain``: an effect's card, or the whole catalogue."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import effects_from_option, json_option
from imufit.cli.names import check_effects, complete_effect
from imufit.cli.output import Output


@click.command()
@click.argument("effect", metavar="[EFFECT|PART]", required=False, shell_complete=complete_effect)
@effects_from_option
@json_option
def explain(effect: str | None, *, json_file: Path | None) -> None:
    """Explain EFFECT: physics, formula, typical size, signature, similar effects, confirming experiment.

    Part of an id, such as acc or delay, lists the effects whose ids begin with that part, else those that hold it.
    """
    from imufit.results import Table  # noqa: PLC0415

    out = Output(json_file)
    every = engine.catalogue()
    known = {card.id for card in every}
    part = "" if effect is None else effect.lower()
    cards = [card for card in every if card.id.startswith(part)] or [card for card in every if part in card.id]
    if effect is None or (effect not in known and cards):
        rows = tuple((card.id, card.name, card.formula, card.physics) for card in cards)
        out.table(Table("", ("effect", "name", "adds to the ideal reading", "physics"), rows))
        out.json([card.to_dict() for card in cards])
        return
    check_effects([effect])
    card = engine.explain(effect)
    out.say(f"{card.id}: {card.name}", bold=True)
    out.table(Table("", ("", ""), card.lines()))
    out.json(card.to_dict())
