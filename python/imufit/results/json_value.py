"""Results as strict JSON: plain numbers and lists, null where a number is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np


def json_value(value: Any) -> Any:
    """Turn arrays, numpy scalars, tuples and mappings into what JSON knows.

    Parameters
    ----------
    value : Any
        Any nesting of mappings, sequences, arrays, numbers, text, truth values and None.

    Returns
    -------
    Any
        The same nesting of dict, list, float, int, bool, str and None; NaN and infinity are None.
    """
    if isinstance(value, Mapping):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return json_value(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [json_value(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def json_fields(item: Any) -> dict[str, Any]:
    """Turn a dataclass into JSON, every field under its name.

    Parameters
    ----------
    item : Any
        An instance of a dataclass.
    """
    return {field.name: json_value(getattr(item, field.name)) for field in fields(item)}
