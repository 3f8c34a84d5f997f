"""Sensors on a line: their formats, the recorder, filters on live rows, and a device without hardware.

Nothing in the library's core uses this package.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from imufit.devices import calibrate_live as calibrate_live
    from imufit.devices import chips as chips
    from imufit.devices import emulate as emulate
    from imufit.devices import monitor as monitor
    from imufit.devices import record as record
else:
    from importlib import import_module

    def __getattr__(name: str) -> object:
        """Load a subpackage on first use (PEP 562)."""
        if name in __all__:
            return import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["calibrate_live", "chips", "emulate", "monitor", "record"]
