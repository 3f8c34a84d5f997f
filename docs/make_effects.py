"""Write docs/effects.md from the cards that the effects carry themselves.

python docs/make_effects.py
"""

from pathlib import Path

import imufit

PAGE = Path(__file__).parent / "effects.md"
SENSORS = {
    "acc": "Accelerometer",
    "gyr": "Gyroscope",
    "mag": "Magnetometer",
    "ref": "Reference",
    "rig": "Rig that moves the sensor",
}
HEAD = """# Effects

`python docs/make_effects.py` writes this page from the effects' cards: do not edit. `imufit explain EFFECT`
prints the same.

`f` is the specific force, `omega` the angular rate, `m` the magnetic flux density, all in the body frame; `temp` is the
sensor's temperature. Typical sizes are those of low-cost sensors, in SI units, and are the prior of an effect's size.
An effect more than 21 times as large is rejected as implausible, unless it explains the whole residual.
"""


def anchor(effect_id: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    return "".join(c for c in effect_id.lower() if c.isalnum() or c in "_-")


def parameters(card: imufit.EffectCard) -> str:
    """Names with units and typical sizes, names of the same size together."""
    groups: dict[tuple[str, float | None], list[str]] = {}
    for name, unit, typical in card.parameters:
        groups.setdefault((unit, typical), []).append(name)
    parts = []
    for (unit, typical), names in groups.items():
        size = "" if typical is None else f", typically {typical:g}"
        kind = "without unit" if unit == "1" else f"in {unit}"
        parts.append(f"{' '.join(f'`{name}`' for name in names)} {kind}{size}")
    return "; ".join(parts)


def section(card: imufit.EffectCard) -> str:
    """One effect."""
    lines = [
        f"### {card.id}",
        "",
        f"**{card.name[:1].upper()}{card.name[1:]}.** {card.physics[:1].upper()}{card.physics[1:]}.",
        "",
        f"- adds to the ideal reading: `{card.formula}`",
        f"- parameters: {parameters(card)}",
        f"- signature: {card.signature}",
        f"- mistaken for: {card.mistaken_for}",
        f"- confirmed by: {card.confirm}",
    ]
    return "\n".join(lines)


def page() -> str:
    """Return the whole page."""
    cards = [*imufit.catalogue(), *(imufit.explain(f"{sensor}.column:NAME") for sensor in ("acc", "gyr", "mag"))]
    prefixes = dict.fromkeys([*SENSORS, *(card.id.split(".")[0] for card in cards)])
    parts = [HEAD]
    for prefix in prefixes:
        own = [card for card in cards if card.id.split(".")[0] == prefix]
        if own:
            parts.append(f"- {SENSORS[prefix]}: " + ", ".join(f"[{card.id}](#{anchor(card.id)})" for card in own))
    parts.append("")
    for prefix in prefixes:
        own = [card for card in cards if card.id.split(".")[0] == prefix]
        if own:
            parts += [f"## {SENSORS[prefix]}", "", *(section(card) + "\n" for card in own)]
    return "\n".join(parts).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
