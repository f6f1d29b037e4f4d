"""Networks with hidden layers, trained by torch, evaluated by numpy; the answer is the mean of several starts.

Training is in double precision on one thread: the same data give the same bits. Smooth networks are trained by L-BFGS
(Liu and Nocedal, Math. Program. 45, 1989) with a decay of the weights, those of ReLU, which have no curvature, by Adam
(Kingma and Ba, arXiv:1412.6980) with a rate that rises and falls, on all data at once. Stopping early on designs left
out was tried and is worse: it takes designs from a fit that has few."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from pliant.records.design import Array
from pliant_plugins.native import load_torch

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
        """Return (s, n, o) outputs of each start at inputs (n, i)."""
        hidden = np.broadcast_to(inputs, (len(self.weights[0]), *inputs.shape))
        last = len(self.weights) - 1
        for number, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = hidden @ weight + bias
            if number < last:
                hidden = np.tanh(hidden) if self.activation == "tanh" else np.maximum(hidden, 0.0)
        return self.centre + self.scale * hidden

    def __call__(self, inputs: Array) -> Array:
        """Return (n, o) mean outputs."""
        return self.each(inputs).mean(axis=0)

    def record(self) -> tuple[dict[str, Any], dict[str, Array]]:
        """Return values and arrays from which `from_record` makes the same network."""
        arrays = {"net_centre": self.centre, "net_scale": self.scale}
        for number, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays |= {f"net_weight_{number}": weight, f"net_bias_{number}": bias}
        return {"activation": self.activation, "layers": len(self.weights)}, arrays

    @staticmethod
    def from_record(values: Mapping[str, Any], arrays: Mapping[str, Array]) -> Layers:
        """Return the network of a record."""

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


ADAM_STEPS = 2000
ADAM_RATE = 5e-3
BFGS_STEPS = 300
HISTORY = 30


@contextmanager
def one_thread() -> Iterator[Any]:
    """Run torch on one thread inside the block; sums over threads would depend on their number."""
    torch = load_torch("a meta-model of networks needs torch to be fitted")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield torch
    finally:
        torch.set_num_threads(before)


def descend(torch: Any, parameters: list[Any], loss: Callable[[], Any], smooth: bool, steps: int) -> None:
    """Minimise a loss in place: L-BFGS where it is smooth, else Adam."""
    if not smooth:
        adam = torch.optim.Adam(parameters, lr=ADAM_RATE)
        rate = torch.optim.lr_scheduler.OneCycleLR(adam, ADAM_RATE, total_steps=steps)
        for _ in range(steps):
            adam.zero_grad()
            loss().backward()
            adam.step()
            rate.step()
        return
    bfgs = torch.optim.LBFGS(
        parameters,
        max_iter=steps,
        max_eval=2 * steps,
        history_size=HISTORY,
        line_search_fn="strong_wolfe",
        tolerance_change=0.0,
        tolerance_grad=1e-12,
    )

    def closure() -> Any:
        bfgs.zero_grad()
        value = loss()
        value.backward()
        return value

    bfgs.step(closure)


def fit_layers(
    inputs: Array,
    targets: Array,
    hidden: Sequence[int],
    activation: Activation,
    starts: int,
    decay: float,
    scale: Array,
    seed: int = 0,
) -> Layers:
    """Fit networks from inputs (n, i) to targets (n, o) by the mean squared error of targets / scale.

    Args:
        hidden: units of the hidden layers.
        starts: random starts, trained side by side.
        decay: of the squared weights, per sample.
        scale: (o,) of the targets.
    """
    centre = targets.mean(axis=0)
    sizes = [inputs.shape[1], *hidden, targets.shape[1]]
    with one_thread() as torch:
        random = np.random.default_rng(seed)
        spread = 2.0 if activation == "relu" else 1.0
        weights = [
            _leaf(torch, random.standard_normal((starts, a, b)) * np.sqrt(spread / a))
            for a, b in pairwise(sizes)
        ]
        biases = [_leaf(torch, 0.1 * random.standard_normal((starts, 1, b))) for b in sizes[1:]]
        x = torch.tensor(np.tile(inputs, (starts, 1, 1)))
        y = torch.tensor((targets - centre) / scale)[None]
        act = torch.tanh if activation == "tanh" else torch.relu

        def loss() -> Any:
            layer = x
            for number, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
                layer = torch.baddbmm(bias, layer, weight)
                layer = act(layer) if number < len(weights) - 1 else layer
            held = sum((weight**2).sum() for weight in weights)
            return ((layer - y) ** 2).mean(dim=(1, 2)).sum() + decay * held / len(inputs)

        steps = BFGS_STEPS if activation == "tanh" else ADAM_STEPS
        descend(torch, [*weights, *biases], loss, activation == "tanh", steps)
        plain = [[one.detach().numpy().copy() for one in group] for group in (weights, biases)]
    return Layers(activation, tuple(plain[0]), tuple(plain[1]), centre, np.asarray(scale, float))


def _leaf(torch: Any, values: Array) -> Any:
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)
