"""Training of a `RidgeFamily` on efforts and their slopes by L-BFGS, in double precision on one thread."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant_plugins.meta_models.network_training import descend, one_thread
from pliant_plugins.meta_models.neural.ridges import RidgeFamily
from pliant_plugins.meta_models.neural.states import ScaledStates

# As in the other laws: slopes of a network are steeper than its values.
SLOPE_WEIGHT = 0.2
# Start of the layer of ridges, and of what the design's layer adds to a common law.
SPREAD, SHARE = 1.0, 0.1


def fit_ridges(
    states: ScaledStates, mirror: Array, units: int, steps: int, decay: float, seed: int
) -> tuple[RidgeFamily, float]:
    """The network, and its root mean square of errors of efforts as a share of each axis' mean size."""
    d, k = states.places.shape[1], states.tau.shape[1]
    random = np.random.default_rng(seed)
    outputs = 2 * units + 2 * k + k * k
    start = {
        "inner": random.standard_normal((d, units)) / np.sqrt(d),
        "inner_bias": 0.5 * random.standard_normal(units),
        "outer": SHARE * random.standard_normal((units, outputs)) / np.sqrt(units),
        "outer_bias": np.concatenate(
            [
                random.standard_normal(units),
                random.standard_normal(units) / np.sqrt(units),
                np.zeros(outputs - 2 * units),
            ]
        ),
        "ridges": SPREAD * random.standard_normal((units, 1 + k)),
    }
    start["outer_bias"][2 * units + 2 * k :] = np.eye(k).ravel()
    with one_thread() as torch:
        leaves = {
            name: torch.tensor(value, dtype=torch.float64, requires_grad=True)
            for name, value in start.items()
        }
        misfit = _Misfit(torch, states, mirror)

        def loss() -> Any:
            held = sum((leaves[name] ** 2).sum() for name in ("inner", "outer", "ridges"))
            value, slopes = misfit(leaves)
            return value + SLOPE_WEIGHT**2 * slopes + decay * held / len(states.tau)

        descend(torch, list(leaves.values()), loss, True, steps)
        with torch.no_grad():
            missed = float(misfit(leaves)[0]) ** 0.5
        plain = {name: leaf.detach().numpy().copy() for name, leaf in leaves.items()}
    return RidgeFamily(**plain, mirror=mirror), missed


class _Misfit:
    """Mean squared errors of efforts and of slopes, each axis by its own mean size; unknown numbers do not count."""

    def __init__(self, torch: Any, states: ScaledStates, mirror: Array) -> None:
        self.torch = torch
        self.places = torch.tensor(states.places)
        self.design = torch.tensor(states.design)
        self.points = torch.tensor(states.points)
        self.mirror = torch.tensor(mirror)
        self.mirrored = bool(np.any(mirror < 0))
        size = np.sqrt(np.nanmean(states.tau**2, axis=0))
        weight = 1 / np.where(size > 0, size, 1.0)
        self.k = states.tau.shape[1]
        upper = [(i, j) for i in range(self.k) for j in range(i, self.k)]
        self.upper = upper
        self.wanted = [self._known(states.tau * weight), self._known(states.gain * weight)]
        across = np.stack([np.sqrt(weight[i] * weight[j]) * states.slope[:, i, j] for i, j in upper], axis=1)
        self.wanted.append(self._known(across))
        self.weight = torch.tensor(weight)
        self.across = torch.tensor(np.array([np.sqrt(weight[i] * weight[j]) for i, j in upper]))

    def _known(self, values: Array) -> tuple[Any, Any, int]:
        known = np.isfinite(values)
        plain = self.torch.tensor(np.where(known, values, 0.0))
        return plain, self.torch.tensor(known.astype(float)), max(int(known.sum()), 1)

    def __call__(self, leaves: dict[str, Any]) -> tuple[Any, Any]:
        torch, k = self.torch, self.k
        m = len(leaves["ridges"])
        hidden = torch.tanh(self.places @ leaves["inner"] + leaves["inner_bias"])
        values = (hidden @ leaves["outer"] + leaves["outer_bias"])[self.design]
        b, c = values[:, :m], values[:, m : 2 * m]
        t, g = values[:, 2 * m : 2 * m + k], values[:, 2 * m + k : 2 * m + 2 * k]
        matrix = values[:, 2 * m + 2 * k :].reshape(-1, k, k)
        s = (matrix + matrix.transpose(1, 2)) / 2
        w = leaves["ridges"]
        if self.mirrored:
            own = (1 + self.mirror) / 2
            t, g = t * own, g * own
            s = s * (1 + self.mirror[:, None] * self.mirror) / 2
            flip = torch.cat([torch.ones(1, dtype=w.dtype), self.mirror])
            w = torch.cat([w, w * flip])
            b, c = torch.cat([b, b], 1), torch.cat([c, c], 1) / 2
        z = self.points @ w.T + b
        bell = torch.rsqrt(1 + z * z)
        first, second = c * z * bell, c * bell**3
        x, v = self.points[:, :1], self.points[:, 1:]
        of_u = w[:, 1:]
        tau = t + x * g - torch.einsum("nij,nj->ni", s, v) - first @ of_u
        pairs = torch.stack([of_u[:, i] * of_u[:, j] for i, j in self.upper], dim=1)
        both = second @ torch.cat([of_u * w[:, :1], pairs], dim=1)
        gain = g - both[:, :k]
        slope = torch.stack([-s[:, i, j] for i, j in self.upper], dim=1) - both[:, k:]
        found = (tau * self.weight, gain * self.weight, slope * self.across)
        errors = [
            (((one - wanted) * known) ** 2).sum() / count
            for one, (wanted, known, count) in zip(found, self.wanted, strict=True)
        ]
        return errors[0], errors[1] + errors[2]
