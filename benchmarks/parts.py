"""Bytes of the arrays that objects hold."""

from collections.abc import Iterable, Iterator, Mapping
from types import MethodType
from typing import Any

import numpy as np
from scipy import sparse


def n_bytes(parts: Mapping[str, object]) -> dict[str, int]:
    """Return the bytes of the arrays of each part; an array that an earlier part holds does not count again."""
    seen: set[int] = set()
    return {name: sum(array.nbytes for array in _owners(part, seen)) for name, part in parts.items()}


def _owners(thing: Any, seen: set[int]) -> Iterator[np.ndarray]:
    """Yield the arrays that own the memory that an object refers to, each once over all calls with the same `seen`."""
    waiting = [thing]
    while waiting:
        one = waiting.pop()
        while isinstance(one, np.ndarray) and isinstance(one.base, np.ndarray):
            one = one.base
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            yield one
        else:
            waiting += _inside(one)


def _inside(one: Any) -> Iterable[Any]:
    """Return what an object refers to, as far as it may hold arrays."""
    if sparse.issparse(one):
        return [one.data, one.indices, one.indptr]
    if isinstance(one, Mapping):
        return one.values()
    if isinstance(one, list | tuple | set):
        return one
    if isinstance(one, MethodType):
        return [one.__self__]
    if not type(one).__module__.startswith("truespring"):
        return []
    slots = [getattr(one, name, None) for name in getattr(type(one), "__slots__", ())]
    return [*slots, *getattr(one, "__dict__", {}).values()]
