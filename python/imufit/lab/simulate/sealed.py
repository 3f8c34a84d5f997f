"""The truth of a simulated log, kept beside the log without being read by accident."""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from imufit.whole_file import write_text

HEADER = "imufit sealed truth, format 1: what was done to this log; `imufit reveal LOG` opens it"


@dataclass(frozen=True)
class Truth:
    """The content of a simulated log.

    Attributes
    ----------
    scenario, seed : the motion and its random seed.
    effects : each injected effect with its parameters, SI units; empty = the sensors are perfect but for noise.
    sizes : for each effect, its root mean square over the white noise of the sensor that it affects most.
    label : the name of the size that was requested, such as "large"; empty where the parameters were given.
    faults : faults of the data that were put in.
    """

    scenario: str
    seed: int
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)
    label: str = ""
    faults: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return a JSON object that `from_json` reads."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Truth:
        """Return the truth written by `to_json`.

        Parameters
        ----------
        data : mapping
            The JSON object.
        """
        return cls(
            scenario=str(data["scenario"]),
            seed=int(data["seed"]),
            effects={e: {n: float(v) for n, v in p.items()} for e, p in data["effects"].items()},
            sizes={e: float(v) for e, v in data["sizes"].items()},
            label=str(data["label"]),
            faults=tuple(str(fault) for fault in data.get("faults", ())),
        )


def sealed_path(log_path: str | Path) -> Path:
    """Return where the truth of a log is kept: beside it, with `.sealed` added to its name.

    Parameters
    ----------
    log_path : str or Path
        Where the log is.
    """
    path = Path(log_path)
    return path.with_name(path.name + ".sealed")


def seal(truth: Truth, log_path: str | Path) -> Path:
    """Write `truth` beside the log `log_path`, unreadable at a glance, and return the path of what was written.

    Parameters
    ----------
    truth : Truth
        What was done to the log.
    log_path : str or Path
        Where the log is.
    """
    packed = base64.b64encode(zlib.compress(json.dumps(truth.to_json()).encode(), 9)).decode()
    lines = [packed[i : i + 76] for i in range(0, len(packed), 76)]
    path = sealed_path(log_path)
    write_text(path, "\n".join([HEADER, *lines]) + "\n")
    return path


def unseal(log_path: str | Path) -> Truth:
    """Return the truth of the log `log_path`.

    Parameters
    ----------
    log_path : str or Path
        Where the log is.

    Raises
    ------
    FileNotFoundError
        If there is none beside the log.
    ValueError
        If the file beside the log is not one written by `seal`.
    """
    path = sealed_path(log_path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: the sealed truth beside this log is missing")
    try:
        header, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
        if not header.startswith("imufit sealed truth, format 1"):
            raise ValueError("header")
        return Truth.from_json(json.loads(zlib.decompress(base64.b64decode("".join(lines), validate=True))))
    except (ValueError, KeyError, TypeError, AttributeError, binascii.Error, zlib.error) as error:
        raise ValueError(f"{path}: not a sealed truth of format 1, or damaged") from error
