"""The stack of effects that a person builds: which are switched on, and which parameters stay at a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from imufit.studio.names import effect_name, parameter_name


@dataclass(frozen=True)
class Entry:
    """One effect of the stack.

    Attributes
    ----------
    effect : str
        Its id.
    on : bool
        Whether the model has it now.
    held : tuple of (str, float)
        Parameters that stay at a value, SI units, in alphabetical order.
    """

    effect: str
    on: bool = True
    held: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Stack:
    """Effects in the order in which they were added, those that are switched off among them.

    Attributes
    ----------
    entries : tuple of Entry
        Each effect once.
    """

    entries: tuple[Entry, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of all effects."""
        return tuple(entry.effect for entry in self.entries)

    @property
    def model(self) -> Stack:
        """The stack of what is switched on: two stacks with the same one are the same model."""
        return Stack(tuple(entry for entry in self.entries if entry.on))

    @property
    def holds(self) -> bool:
        """Whether a parameter of the model stays at a value."""
        return any(entry.held for entry in self.entries if entry.on)

    def entry(self, effect: str) -> Entry:
        """Return the entry of one effect.

        Parameters
        ----------
        effect : str
            Its id.

        Raises
        ------
        KeyError
            The stack does not have it.
        """
        for entry in self.entries:
            if entry.effect == effect:
                return entry
        raise KeyError(effect)

    def with_effect(self, effect: str) -> Stack:
        """Return the stack with one more effect, or with one that was switched off on again.

        Parameters
        ----------
        effect : str
            Its id.
        """
        if effect in self.effects:
            return self.switched(effect, True)
        return Stack((*self.entries, Entry(effect)))

    def without_effect(self, effect: str) -> Stack:
        """Return the stack with one effect less.

        Parameters
        ----------
        effect : str
            Its id.
        """
        return Stack(tuple(entry for entry in self.entries if entry.effect != effect))

    def switched(self, effect: str, on: bool) -> Stack:
        """Return the stack with one effect switched on or off.

        Parameters
        ----------
        effect : str
            Its id.
        on : bool
            Whether the model has it.
        """
        return self._with(replace(self.entry(effect), on=on))

    def held(self, effect: str, values: Mapping[str, float]) -> Stack:
        """Return the stack with other values at which parameters of one effect stay.

        Parameters
        ----------
        effect : str
            Its id.
        values : mapping of str to float
            By parameter, SI units; all others are fitted.
        """
        return self._with(replace(self.entry(effect), held=tuple(sorted(values.items()))))

    def _with(self, changed: Entry) -> Stack:
        return Stack(tuple(changed if entry.effect == changed.effect else entry for entry in self.entries))


class Action(Enum):
    """Kinds of steps that lead from one model to the next."""

    START = "start"
    ADD = "add"
    REMOVE = "remove"
    ON = "on"
    OFF = "off"
    HOLD = "hold"
    FREE = "free"


SAID: Final = {
    Action.ADD: "+ {}",
    Action.REMOVE: "− {}",
    Action.ON: "{} on",
    Action.OFF: "{} off",
    Action.HOLD: "{} fixed",
    Action.FREE: "{} estimated",
}
"""Kinds of steps in words, with the name of what they concern."""


@dataclass(frozen=True)
class Step:
    """One step of the history.

    Attributes
    ----------
    action : Action
        The action.
    effect : str
        To which effect; empty at the start.
    stack : Stack
        The stack after it.
    expected : float or None
        Held-out error over the noise floor that the evidence predicted, where an effect was added.
    parameter : str
        Which parameter of the effect was fixed or freed; empty for other actions.
    """

    action: Action
    effect: str
    stack: Stack
    expected: float | None = None
    parameter: str = ""

    @property
    def key(self) -> str:
        """Id of the effect or parameter that the step concerns; empty at the start."""
        return f"{self.effect}.{self.parameter}" if self.parameter else self.effect

    @property
    def label(self) -> str:
        """The step in few words."""
        if self.action is Action.START:
            return "ideal sensor"
        name = parameter_name(self.effect, self.parameter) if self.parameter else effect_name(self.effect)
        return SAID[self.action].format(name)
