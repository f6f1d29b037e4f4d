"""A digest of the numbers and texts that a value consists of, whatever their origin."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np


def content_digest(*values: Any) -> str:
    """Return the SHA-256 of plain values, arrays, frozen records and their sequences and mappings.

    Raises:
        TypeError: a value of any other type.
    """
    digest = hashlib.sha256()
    for value in values:
        for piece in _pieces(value):
            digest.update(len(piece).to_bytes(8, "little"))
            digest.update(piece)
    return digest.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    """Yield the parts of the value in order, each preceded by its type, so that no two values give the same bytes."""
    if isinstance(value, Enum):
        value = value.value
    if value is None or isinstance(value, bool | int | float | str | np.generic | Path):
        plain = value.item() if isinstance(value, np.generic) else value
        yield f"{type(plain).__name__}:{plain!r}".encode()
    elif isinstance(value, np.ndarray):
        if value.dtype == object:
            raise TypeError("an array of objects has no digest")
        yield f"array:{value.dtype.str}:{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Mapping):
        yield f"mapping:{len(value)}".encode()
        for key in sorted(value, key=str):
            yield from _pieces(key)
            yield from _pieces(value[key])
    elif isinstance(value, list | tuple):
        yield f"sequence:{len(value)}".encode()
        for item in value:
            yield from _pieces(item)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield f"record:{type(value).__name__}".encode()
        for field in dataclasses.fields(value):
            yield from _pieces(field.name)
            yield from _pieces(getattr(value, field.name))
    else:
        raise TypeError(f"{type(value).__name__} has no digest")
