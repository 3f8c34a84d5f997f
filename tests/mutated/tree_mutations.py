"""Mutations of TOML and JSON files as trees: a value, a key or a whole branch is replaced, left out or repeated."""

import json
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from random import Random
from typing import Any

import tomli_w

from mutated.hostile import FLOATS, NAMES, TEXTS

DEPTH = 100_000
"""Nested brackets: far more than a parser that calls itself can follow."""

PARSED = 20_000
"""Larger files are not parsed here, in bytes: dotted keys of 200 kB take a parser of TOML tens of gigabytes."""

VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    -1,
    10**18,
    10**400,
    "",
    "x",
    "\x1b[31m",
    "nul\x00",
    [],
    {},
    [[]],
    [1, 2],
    [1, 2, 3, 4],
    ["a", "b", "c"],
    [None, None, None],
    {"x": 1},
    {"x": {"value": "y"}},
    "NED",
    "w",
    "9.81",
    *FLOATS,
)


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every (container, key) of the tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in list(items):
        yield tree, key
        yield from places(value)


def changed(rng: Random, tree: Any) -> Any:
    """Return the tree with one to three places changed."""
    tree = deepcopy(tree)
    for _ in range(rng.choice((1, 1, 1, 3))):
        found = list(places(tree))
        if not found:
            return rng.choice(VALUES)
        holder, key = rng.choice(found)
        which = rng.random()
        if which < 0.6:
            holder[key] = deepcopy(rng.choice(VALUES)) if rng.random() < 0.85 else rng.choice((*NAMES, *TEXTS))
        elif which < 0.75:
            del holder[key]
        elif which < 0.9 and isinstance(holder, dict):
            holder[rng.choice(NAMES)] = holder.pop(key)
        elif isinstance(holder, dict):
            holder[rng.choice(NAMES)] = deepcopy(rng.choice(VALUES))
        else:
            holder.append(deepcopy(holder[key]))
    return tree


def json_tree(rng: Random, data: bytes) -> bytes:
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):  # a step before has broken it
        return data
    return json.dumps(changed(rng, tree)).encode("utf-8", "surrogatepass")


def json_deep(rng: Random, _data: bytes) -> bytes:
    opening, closing = rng.choice((("[", "]"), ('{"a":', "}"), ('[{"candidates":', "}]")))
    whole = rng.random() < 0.7
    return (opening * DEPTH + "1" + (closing * DEPTH if whole else "")).encode()


def json_odd(rng: Random, data: bytes) -> bytes:
    return rng.choice(
        (
            b"",
            b"null",
            b"[]",
            b"{}",
            b"1",
            b'"x"',
            b"NaN",
            b"{,}",
            b'{"a":1}{"a":2}',
            b"\xef\xbb\xbf" + data,
            data.replace(b"{", b'{"effect": 1, "effect": 2, ', 1),
            b"1" * 100_000,
            b'{"verdict": 1e999}',
            b'"\\ud800"',
            b"[" + b"1," * 100_000 + b"1]",
        )
    )


def toml_tree(rng: Random, data: bytes) -> bytes:
    if len(data) > PARSED:
        return data
    try:
        tree = changed(rng, tomllib.loads(data.decode()))
        return tomli_w.dumps(tree).encode("utf-8", "surrogatepass")
    except (ValueError, TypeError, AttributeError, RecursionError):  # TOML has neither null nor a bare value
        return data + b"\nx ="


def toml_odd(rng: Random, data: bytes) -> bytes:
    deep = rng.choice((1_000, DEPTH))
    return rng.choice(
        (
            b"",
            b"x",
            b"=",
            data + data,
            b"[[effects]]\n" * 3 + data,
            b"a = " + b"[" * deep + b"]" * deep,
            b"a = " + b"{b=" * deep + b"1" + b"}" * deep,
            b"a." * deep + b"b = 1",
            b"[" + b"a." * deep + b"b]",
            data.replace(b"=", b"= 1979-05-27T07:32:00Z #", 1),
            data.replace(b".", b"e", 1),
            data.replace(b"=", b"= inf #", rng.choice((1, 3, 9))),
            data.replace(b"=", b"= nan #", rng.choice((1, 3, 9))),
            data + b"\nx = 0x" + b"f" * 5000,
            data + b"\nx = 1" + b"0" * 5000,
            data + b'\n"\\u001b[31m" = 1\n',
            b'frame = "\\u001b[31m"\n' + data,
            b"\xff\xfe" + data,
        )
    )


JSON_MUTATIONS = (json_tree, json_tree, json_tree, json_tree, json_deep, json_odd)
TOML_MUTATIONS = (toml_tree, toml_tree, toml_tree, toml_tree, toml_odd)
