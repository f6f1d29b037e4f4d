"""What equations of hidden effects share: their numbers, and shapes of curves over size and time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = Mapping[str, float]
# Of the size in units of its largest (or typical) one, the time and the form's numbers: about 1.
Shape = Callable[[Array, Any, Numbers], Array]
TINY = 1e-12


def evenly(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 + x["a"] * r


def square(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 + x["a"] * r * r


def soon(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 - x["a"] * np.tanh(3.0 * r)


def power(r: Array, t: Any, x: Numbers) -> Array:
    return np.asarray((r + 0.02) ** (x["p"] - 1.0))


def thinning(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 / (1.0 + x["a"] * r)


def warming(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 - x["a"] * np.exp(-np.maximum(t, 0.0) / x["T"]) + 0.0 * r


def softplus(e: Array, w: Array) -> Array:
    return np.asarray(w * np.logaddexp(0.0, e / w))


def root(e: Array, w: Array) -> Array:
    return np.asarray(0.5 * (e + np.sqrt(e * e + w * w)))


def tanh(r: Array) -> Array:
    return np.asarray(np.tanh(r))


def rooted(r: Array) -> Array:
    return np.asarray(r / np.sqrt(1.0 + r * r))


def exponential(r: Array) -> Array:
    return np.asarray(np.exp(-r))


def lorentz(r: Array) -> Array:
    return np.asarray(1.0 / (1.0 + r * r))
