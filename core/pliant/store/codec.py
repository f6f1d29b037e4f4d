"""Records as JSON and arrays, without pickle: only the classes that a package registers can be read from a file.

A package registers them by the hook `pliant_records`; Pliant's own are listed in `pliant.manifest`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.registry.place import imported
from pliant.registry.stored_record import stored_records

Arrays = dict[str, np.ndarray]
RESERVED = {"__record__", "__array__", "__tuple__", "__items__"}


def encode(value: Any, arrays: Arrays) -> Any:
    """Return the JSON tree of a value; arrays are moved to `arrays` and referred to by name."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        name = type(value).__name__
        entry = stored_records().get(name)
        if entry is None or entry.place != f"{type(value).__module__}:{type(value).__qualname__}":
            raise TypeError(f"{name} is no storable record")
        fields = {f.name: encode(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
        return {"__record__": name, "fields": fields}
    if isinstance(value, np.ndarray):
        if value.dtype == object:
            raise TypeError("object arrays cannot be stored")
        name = f"a{len(arrays):04d}"
        arrays[name] = value
        return {"__array__": name}
    if isinstance(value, np.generic) and not isinstance(value.item(), np.generic):
        return encode(value.item(), arrays)
    if isinstance(value, Mapping):
        items = {str(key): encode(item, arrays) for key, item in value.items()}
        return {"__items__": list(items.items())} if RESERVED & items.keys() else items
    if isinstance(value, tuple):
        return {"__tuple__": [encode(item, arrays) for item in value]}
    if isinstance(value, list):
        return [encode(item, arrays) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"{type(value).__name__} cannot be stored")


def decode(tree: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Return the value of a JSON tree written by `encode`; raises `ValueError` for anything else."""
    if isinstance(tree, list):
        return [decode(item, arrays) for item in tree]
    if not isinstance(tree, dict):
        return tree
    if "__array__" in tree:
        return arrays[tree["__array__"]]
    if "__tuple__" in tree:
        return tuple(decode(item, arrays) for item in tree["__tuple__"])
    if "__items__" in tree:
        return {key: decode(item, arrays) for key, item in tree["__items__"]}
    if "__record__" in tree:
        entry = stored_records().get(tree["__record__"])
        if entry is None:
            raise ValueError(f"unknown record '{tree['__record__']}'")
        return imported(entry.place)(**{name: decode(item, arrays) for name, item in tree["fields"].items()})
    return {key: decode(item, arrays) for key, item in tree.items()}
