"""The network of an energy over designs: one hidden layer of the design, one of actuation and deformation.

    Π(p, u; s) / E(s) = Σ_j c_j √(1 + z_j²) − (t + x g)·v + ½ vᵀ S v,  z_j = w_j·(x, v) + b_j
    (b, c, t, g, S)(s) = W₂ tanh(W₁ s + a₁) + a₂

with x = p / p_max, v_k = u_k / u_k(s) and the reaches u_k(s) and energy E(s) of the common form. Of m actuations each
has its x, and g is (k, m). For one design it is a `Network` of the neural surrogate, whose offsets and factors hold
the design.

It is trained on trusted states in the common form's scales, efforts and slopes, by L-BFGS in double precision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.actuation import Levels
from pliant.records.design import Array
from pliant_designs.meta_models.common_form import CommonForm
from pliant_designs.meta_models.common_form_scales import fitted
from pliant_designs.meta_models.networks import descend, one_thread
from pliant_designs.records import SolvedDesigns
from pliant_plugins.surrogates.neural.network import Network


@dataclass(frozen=True, eq=False)
class ScaledStates:
    """n states of k axes of designs with d parameters.

    Attributes:
        places: (designs, d) scaled parameters.
        design: (n,) the design of each state.
        points: (n, m + k) x = p / p_max and v = u / reach.
        tau: (n, k) efforts times reach over energy; gain: (n, k, m) ∂/∂x; slope: (n, k, k) ∂/∂v. NaN: unknown.
    """

    places: Array
    design: NDArray[np.int64]
    points: Array
    tau: Array
    gain: Array
    slope: Array

    @staticmethod
    def from_designs(designs: SolvedDesigns, form: CommonForm) -> ScaledStates:
        """Select states of role "fit" whose status is trusted."""
        reaches, energies = form.reach(designs.values), form.energy(designs.values)
        top = form.largest_actuation
        parts: list[tuple[Array, ...]] = []
        for number, data in enumerate(designs.data):
            keep = fitted(data)
            reach, energy = reaches[number], energies[number]
            x, v = data.actuation[keep] / top, data.deformation[keep] / reach
            parts.append(
                (
                    np.full(len(x), number),
                    np.column_stack([x, v]),
                    data.tau[keep] * reach / energy,
                    data.dtau_dp[keep].reshape(len(x), len(reach), -1) * reach[:, None] * top / energy,
                    data.dtau_du[keep] * reach[:, None] * reach / energy,
                )
            )
        design, points, tau, gain, slope = (np.concatenate(column) for column in zip(*parts, strict=True))
        return ScaledStates(form.parameters(designs.values), design, points, tau, gain, slope)


@dataclass(frozen=True, eq=False)
class RidgeFamily:
    """The weights of the network.

    Attributes:
        inner: (d, h) W₁; inner_bias: (h,) a₁.
        outer: (h, q) W₂; outer_bias: (q,) a₂, in the order b (r), c (r), t (k), g (k, m), S (k, k).
        ridges: (r, m + k) w.
        mirror: (k,) −1 for axes whose joint change of sign does not change the energy; all 1 without such a symmetry.
    """

    inner: Array
    inner_bias: Array
    outer: Array
    outer_bias: Array
    ridges: Array
    mirror: Array

    def network(self, place: Array, energy: float, top: Levels, reach: Array) -> Network:
        """Return the network of a design with scaled parameters (d,), in SI; `top` is (m,) of several actuations."""
        r, k = len(self.ridges), len(reach)
        m = self.ridges.shape[1] - k
        hidden = np.tanh(place @ self.inner + self.inner_bias)
        values = hidden @ self.outer + self.outer_bias
        offsets, factors, effort, gain, matrix = np.split(values, np.cumsum([r, r, k, k * m]))
        gain = gain.reshape(k, m)
        stiffness = symmetric(matrix.reshape(k, k))
        tops = np.reshape(top, -1)
        weights = self.ridges / np.concatenate([tops, reach])
        if np.any(self.mirror < 0):
            own = (1 + self.mirror) / 2
            effort, gain = effort * own, gain * own[:, None]
            stiffness = (stiffness + stiffness * np.outer(self.mirror, self.mirror)) / 2
            weights = np.concatenate([weights, weights * np.concatenate([np.ones(m), self.mirror])])
            offsets, factors = np.tile(offsets, 2), np.tile(factors, 2) / 2
        gain = energy * gain / np.outer(reach, tops)
        return Network(
            weights,
            offsets,
            energy * factors,
            energy * effort / reach,
            gain[:, 0] if m == 1 else gain,
            energy * stiffness / np.outer(reach, reach),
        )

    def arrays(self) -> dict[str, Array]:
        """Return the weights by name."""
        return {f"ridge_{name}": getattr(self, name) for name in self.__dataclass_fields__}

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> RidgeFamily:
        """Return the weights that `arrays` gave."""
        return RidgeFamily(
            **{name: np.asarray(arrays[f"ridge_{name}"], float) for name in RidgeFamily.__dataclass_fields__}
        )


def symmetric(matrix: Array) -> Array:
    """Return a symmetric matrix (k, k) from any."""
    return (matrix + matrix.T) / 2


# As in the other laws: slopes of a network are steeper than its values.
SLOPE_WEIGHT = 0.2
# Start of the layer of ridges, and of what the design's layer adds to a common law.
SPREAD, SHARE = 1.0, 0.1


def fit_ridges(
    states: ScaledStates, mirror: Array, units: int, steps: int, decay: float, seed: int
) -> tuple[RidgeFamily, float]:
    """Fit the network; return it and its RMS error of efforts as a share of each axis' mean size."""
    d, k = states.places.shape[1], states.tau.shape[1]
    m = states.points.shape[1] - k
    random = np.random.default_rng(seed)
    outputs = 2 * units + k + k * m + k * k
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
        "ridges": SPREAD * random.standard_normal((units, m + k)),
    }
    start["outer_bias"][2 * units + k + k * m :] = np.eye(k).ravel()
    with one_thread() as torch:
        leaves = {
            name: torch.tensor(value, dtype=torch.float64, requires_grad=True)
            for name, value in start.items()
        }
        misfit = _RidgeMisfit(torch, states, mirror)

        def loss() -> Any:
            held = sum((leaves[name] ** 2).sum() for name in ("inner", "outer", "ridges"))
            value, slopes = misfit(leaves)
            return value + SLOPE_WEIGHT**2 * slopes + decay * held / len(states.tau)

        descend(torch, list(leaves.values()), loss, True, steps)
        with torch.no_grad():
            missed = float(misfit(leaves)[0]) ** 0.5
        plain = {name: leaf.detach().numpy().copy() for name, leaf in leaves.items()}
    return RidgeFamily(**plain, mirror=mirror), missed


class _RidgeMisfit:
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
        self.m = states.points.shape[1] - self.k
        upper = [(i, j) for i in range(self.k) for j in range(i, self.k)]
        self.upper = upper
        self.wanted = [self._known(states.tau * weight), self._known(states.gain * weight[:, None])]
        across = np.stack([np.sqrt(weight[i] * weight[j]) * states.slope[:, i, j] for i, j in upper], axis=1)
        self.wanted.append(self._known(across))
        self.weight = torch.tensor(weight)
        self.across = torch.tensor(np.array([np.sqrt(weight[i] * weight[j]) for i, j in upper]))

    def _known(self, values: Array) -> tuple[Any, Any, int]:
        known = np.isfinite(values)
        plain = self.torch.tensor(np.where(known, values, 0.0))
        return plain, self.torch.tensor(known.astype(float)), max(int(known.sum()), 1)

    def __call__(self, leaves: dict[str, Any]) -> tuple[Any, Any]:
        torch, k, m = self.torch, self.k, self.m
        r = len(leaves["ridges"])
        hidden = torch.tanh(self.places @ leaves["inner"] + leaves["inner_bias"])
        values = (hidden @ leaves["outer"] + leaves["outer_bias"])[self.design]
        b, c, t, g, matrix = torch.split(values, [r, r, k, k * m, k * k], dim=1)
        g, matrix = g.reshape(-1, k, m), matrix.reshape(-1, k, k)
        s = (matrix + matrix.transpose(1, 2)) / 2
        w = leaves["ridges"]
        if self.mirrored:
            own = (1 + self.mirror) / 2
            t, g = t * own, g * own[:, None]
            s = s * (1 + self.mirror[:, None] * self.mirror) / 2
            flip = torch.cat([torch.ones(m, dtype=w.dtype), self.mirror])
            w = torch.cat([w, w * flip])
            b, c = torch.cat([b, b], 1), torch.cat([c, c], 1) / 2
        z = self.points @ w.T + b
        bell = torch.rsqrt(1 + z * z)
        first, second = c * z * bell, c * bell**3
        x, v = self.points[:, :m], self.points[:, m:]
        of_u = w[:, m:]
        tau = t + torch.einsum("nkm,nm->nk", g, x) - torch.einsum("nij,nj->ni", s, v) - first @ of_u
        pairs = torch.stack([of_u[:, i] * of_u[:, j] for i, j in self.upper], dim=1)
        across = (of_u[:, :, None] * w[:, None, :m]).reshape(-1, k * m)
        both = second @ torch.cat([across, pairs], dim=1)
        gain = g - both[:, : k * m].reshape(-1, k, m)
        slope = torch.stack([-s[:, i, j] for i, j in self.upper], dim=1) - both[:, k * m :]
        found = (tau * self.weight, gain * self.weight[:, None], slope * self.across)
        errors = [
            (((one - wanted) * known) ** 2).sum() / count
            for one, (wanted, known, count) in zip(found, self.wanted, strict=True)
        ]
        return errors[0], errors[1] + errors[2]
