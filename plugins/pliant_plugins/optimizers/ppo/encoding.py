"""Arrays in JSON: their bytes, little-endian, as base64. Exact, and no pickle."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def packed(array: NDArray[Any]) -> dict[str, Any]:
    """A float array of any shape as JSON values."""
    little = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False)
    return {
        "type": f"f{array.dtype.itemsize}",
        "shape": list(array.shape),
        "bytes": base64.b64encode(little.tobytes()).decode("ascii"),
    }


def unpacked(packet: Mapping[str, Any]) -> NDArray[Any]:
    """The array again, writable."""
    raw = np.frombuffer(base64.b64decode(packet["bytes"]), f"<{packet['type']}")
    return raw.astype(packet["type"]).reshape(packet["shape"])
