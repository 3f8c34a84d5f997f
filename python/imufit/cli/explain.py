"""``imufit explain``: an effect's card, or the whole catalogue."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import effects_from_option, json_option
from imufit.cli.names import check_effects
from imufit.cli.output import Output


@click.command()
@click.argument("effect", metavar="[EFFECT]", required=False)
@effects_from_option
@json_option
def explain(effect: str | None, *, json_file: Path | None) -> None:
    """Explain EFFECT: physics, formula, typical size, signature, what it is mistaken for, what confirms it."""
    from imufit.results import Table  # noqa: PLC0415

    out = Output(json_file)
    if effect is None:
        cards = engine.catalogue()
        rows = tuple((card.id, card.name, card.formula, card.physics) for card in cards)
        out.table(Table("", ("effect", "name", "adds to the ideal reading", "physics"), rows))
        out.json([card.to_dict() for card in cards])
        return
    check_effects([effect])
    card = engine.explain(effect)
    out.say(f"{card.id}: {card.name}", bold=True)
    out.table(Table("", ("", ""), card.lines()))
    out.json(card.to_dict())
