"""Derivatives of a user's function by the library that it is written with, JAX or torch.

Readings are differentiated along directions of the parameters, by forward mode: `jax.linearize`, dual numbers of torch.
Neither library is a dependency of Pliant; a file that is written with one imports it itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pliant.records.design import Array

JAX, TORCH = "jax", "torch"
Numbers = Mapping[str, float]
# parameters by name → readings by output, in the library's arrays
Function = Callable[[Any], Mapping[str, Any]]


def is_jax(readings: Mapping[str, Any]) -> bool:
    """Return whether some of these readings are arrays of JAX."""
    return any(type(values).__module__.partition(".")[0] in ("jax", "jaxlib") for values in readings.values())


def in_library(library: str, values: Any) -> Any:
    """Return a number or an array as an array of the library; unchanged without a library."""
    if library == JAX:
        import jax.numpy as jnp

        return jnp.asarray(values, float)
    if library == TORCH:
        import torch

        return torch.as_tensor(np.asarray(values, float))
    return values


def as_array(values: Any) -> Array:
    """Return an array of any library as one of numpy, without a graph of derivatives."""
    return np.asarray(values.detach() if hasattr(values, "detach") else values, float)


def linearized(
    library: str, function: Function, at: Numbers, directions: Sequence[Numbers]
) -> tuple[dict[str, Any], tuple[dict[str, Any], ...]]:
    """Return the readings at these parameters, and their derivatives along each direction.

    Directions name the parameters that change, each with its change.
    """
    point = {name: in_library(library, value) for name, value in at.items()}
    along = [{name: in_library(library, direction.get(name, 0.0)) for name in at} for direction in directions]
    if library == JAX:
        import jax

        readings, push = jax.linearize(lambda values: dict(function(values)), point)
        return readings, tuple(push(one) for one in along)
    return _torch_linearized(function, point, along)


def _torch_linearized(
    function: Function, point: Mapping[str, Any], along: Sequence[Mapping[str, Any]]
) -> tuple[dict[str, Any], tuple[dict[str, Any], ...]]:
    """Return readings and derivatives by dual numbers, in one call per direction."""
    import torch
    from torch.autograd import forward_ad

    at, changes = {}, []
    for direction in along:
        with torch.no_grad(), forward_ad.dual_level():
            duals = {name: forward_ad.make_dual(value, direction[name]) for name, value in point.items()}
            pairs = {
                name: forward_ad.unpack_dual(torch.as_tensor(found))
                for name, found in function(duals).items()
            }
        at = {name: pair.primal for name, pair in pairs.items()}
        changes.append(
            {
                name: torch.zeros_like(pair.primal) if pair.tangent is None else pair.tangent
                for name, pair in pairs.items()
            }
        )
    return at, tuple(changes)
