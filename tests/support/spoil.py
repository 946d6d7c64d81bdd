"""Corrupt trees and bytes at random, as people, programs and attackers do."""

from __future__ import annotations

import copy
import functools
import random
from collections.abc import Iterator
from typing import Any

ODD: tuple[Any, ...] = (
    None, True, -1, 0, 1e308, float("nan"), float("-inf"), 2**31, 2**64, 10**400, 1e-320, "", "nan", "[/]", "\x00",
    "a" * 5000, "../..", "/dev/zero", [], {}, [[]], [0, 0], [36.6, -84.38], [float("nan"), 1], [1] * 500,
    {"east_m": 1e9, "north_m": 0},
)  # fmt: skip


def places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The key path of every node in a tree of lists and dicts."""
    yield path
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in entries:
        yield from places(value, (*path, key))


def spoilt_tree(tree: Any, rng: random.Random) -> Any:
    """A copy of the tree with one to three nodes replaced by something odd, scaled, removed or repeated."""
    tree = copy.deepcopy(tree)
    for _ in range(rng.choice((1, 1, 2, 3))):
        spots = [p for p in places(tree) if p]
        if not spots:
            break  # nothing is left to spoil
        *way, last = rng.choice(spots)
        parent = functools.reduce(lambda t, k: t[k], way, tree)
        value = parent[last]
        kind = rng.random()
        if kind < 0.5:
            parent[last] = copy.deepcopy(rng.choice(ODD))
        elif kind < 0.7 and isinstance(value, float):
            parent[last] = value * rng.choice((-1.0, 0.999, 1.001, 2.0, 1e6))
        elif kind < 0.85:
            del parent[last]
        else:
            parent[last] = [copy.deepcopy(value)] * rng.choice((1, 2, 50))
    return tree


def spoilt_bytes(data: bytes, rng: random.Random, words: tuple[bytes, ...] = ()) -> bytes:
    """The data with a few bits flipped, pieces repeated or lost, and words inserted."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 2, 5))):
        i = rng.randrange(len(out) + 1)
        kind = rng.random()
        if kind < 0.35 and i < len(out):
            out[i] ^= 1 << rng.randrange(8)
        elif kind < 0.5:
            del out[i : i + rng.choice((1, 4, 40))]
        elif kind < 0.65:
            out[i:i] = out[: rng.choice((1, 4, 40))]
        elif kind < 0.7:
            del out[i:]
        else:
            word = rng.choice(words or (b"\x00", b"\xff"))
            out[i : i + rng.choice((0, len(word)))] = word
    return bytes(out)
