"""Write docs/api_filters.md: every filter with the settings that the compiled module describes.

python docs/make_filters.py
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from imufit import filters

PAGE = Path(__file__).parent / "api_filters.md"
HEAD = """# Filters

Written by `python docs/make_filters.py` from what the filters say about themselves: do not edit.

Attitude filters on bare arrays. Rows are samples: angular rate in rad/s, specific force in m/s², magnetic flux density
in µT, in the axes of the body. Attitudes are unit quaternions, scalar first, which turn body vectors into the reference
frame. `imufit.replay` runs filters by name over a log.

```python
import imufit
import numpy as np

log = imufit.simulate("handheld", seed=1, duration=20.0).to_log()
q = imufit.filters.Mahony(k_p=1.0).run(log.gyr, log.acc, log.mag, 0.01)  # all rows at once
running = imufit.filters.Mahony(k_p=1.0)  # or row by row
for gyr, acc, mag in zip(log.gyr, log.acc, log.mag, strict=True):
    now = running.update(gyr, acc, mag, dt=0.01)
print(q.shape, np.array_equal(now, q[-1]))
```
```text
(2000, 4) True
```

::: imufit.filters.AttitudeFilter
"""


def table(settings: Mapping[str, Any]) -> list[str]:
    """Return settings as rows of a table."""
    rows = [
        f"| `{name}` | {entry['default']:g} | {unit(entry['unit'])} | {entry['meaning']} |"
        for name, entry in settings.items()
    ]
    return ["| setting | default | unit | meaning |", "|---|---|---|---|", *rows] if rows else ["It has no settings."]


def unit(text: str) -> str:
    """Return a unit as it is shown."""
    return "" if text in ("", "1") else text


def page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for kind in (*filters.AttitudeFilter.__subclasses__(), filters.Smoother):
        parts += [f"::: imufit.filters.{kind.__name__}", ""]
        if kind is filters.Smoother:  # its signature says only **options
            parts[-1:] = [
                "    options: {docstring_options: {warn_unknown_params: false, warn_missing_types: false}}",
                "",
            ]
            parts += ["Its settings are those of `Mekf`.", ""]
        else:
            parts += [f"Needs {' and '.join(f'`{name}`' for name in kind.needs)}.", "", *table(kind.settings), ""]
    place = "[rules](conventions.md#rules-of-a-replay)"
    rules = f"Every filter takes them besides its own: gaps, free fall, ends of the ranges ({place})."
    parts += ["## Rules around every filter", "", rules, "", *table(filters.RULES)]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
