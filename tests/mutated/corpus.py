"""Small inputs that once broke a rule, each with the reason that it is kept for."""

from dataclasses import dataclass

from mutated.draw import Case
from mutated.seed_files import SeedFiles


@dataclass(frozen=True)
class Kept:
    """An input of a few lines: the command line, and its files."""

    reason: str
    arguments: tuple[str, ...]
    files: dict[str, bytes]

    def case(self, _seeds: SeedFiles) -> Case:
        """Return it as an input."""
        return Case(list(self.arguments), self.files)


KEPT: dict[str, Kept] = {}
"""The inputs by their names."""
