"""Networks with hidden layers, evaluated by numpy: several starts side by side, whose mean is the answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pliant.records.design import Array

Activation = Literal["tanh", "relu"]


@dataclass(frozen=True, eq=False)
class Layers:
    """y = centre + scale · mean over starts of W_L a(… a(W_1 x + b_1) …) + b_L.

    Attributes:
        activation: a.
        weights: by layer (s, i, o) for s starts, i inputs and o outputs.
        biases: by layer (s, 1, o).
        centre, scale: (o,) of the outputs.
    """

    activation: Activation
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    centre: Array
    scale: Array

    def each(self, inputs: Array) -> Array:
        """(s, n, o) what each start says of inputs (n, i)."""
        hidden = np.broadcast_to(inputs, (len(self.weights[0]), *inputs.shape))
        last = len(self.weights) - 1
        for number, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = hidden @ weight + bias
            if number < last:
                hidden = np.tanh(hidden) if self.activation == "tanh" else np.maximum(hidden, 0.0)
        found: Array = self.centre + self.scale * hidden
        return found

    def __call__(self, inputs: Array) -> Array:
        """(n, o) their mean."""
        mean: Array = self.each(inputs).mean(axis=0)
        return mean

    def record(self) -> tuple[dict[str, Any], dict[str, Array]]:
        """Values and arrays from which `of_record` makes the same network."""
        arrays = {"net_centre": self.centre, "net_scale": self.scale}
        for number, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays |= {f"net_weight_{number}": weight, f"net_bias_{number}": bias}
        return {"activation": self.activation, "layers": len(self.weights)}, arrays

    @staticmethod
    def of_record(values: Mapping[str, Any], arrays: Mapping[str, Array]) -> Layers:
        """The network of a record."""

        def read(name: str) -> Array:
            return np.asarray(arrays[f"net_{name}"], float)

        numbers = range(int(values["layers"]))
        return Layers(
            values["activation"],
            tuple(read(f"weight_{number}") for number in numbers),
            tuple(read(f"bias_{number}") for number in numbers),
            read("centre"),
            read("scale"),
        )
