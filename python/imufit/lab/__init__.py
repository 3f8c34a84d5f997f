"""Logs whose truth is known: simulated sensors with effects hidden in them, and how well they are found.

Nothing in the library's core uses this package.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from imufit.lab import grade as grade
    from imufit.lab import simulate as simulate
else:
    from importlib import import_module

    def __getattr__(name: str) -> object:
        """Load a subpackage on first use (PEP 562)."""
        if name in ("grade", "simulate"):
            return import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["grade", "simulate"]
