"""How a neural law goes on outside the box of its data: bent coordinates, lines and bowls."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from pliant.records.design import Array
from pliant_plugins.surrogates.neural.network import Network

# The network is seen this far outside the box, in half-widths; halved until it is stable there.
REACHES = (0.25, 0.125, 1 / 16, 1 / 32, 1 / 64)
# Of the least stiffness in the box, what must be left as far outside as the network is seen.
SHARE_LEFT = 0.5
# Where a border has no stiffness: of the effort's range over the box's half-width.
LEAST_STIFFNESS = 0.02
SAFETY = 1.2
LEVELS = {1: 41, 2: 13, 3: 7}


@dataclass(frozen=True, eq=False)
class Continuation:
    """Π̃(p, u) = N(p̃, ũ) − (p − p̃) G·u + Σ_i B_i(δ_i), N being the network's energy.

    δ is how far outside the box a coordinate lies, and x̃ = x̂ + L tanh(δ/L) bends it so that the network is seen no
    further than L outside. Beside it stand, for each axis outside its box, with r = |δ| and t = tanh(r/L),

        B_i = −a_i(p̃) sign(δ_i) (r − L t) + k_i [r²/2 − L² (⅔ ln cosh(r/L) + t²/6)] + D_i (r − L t)

    where a_i is τ_i on the border, the other axes at rest, so that τ goes on as a line of the stiffness k_i. All
    terms and their first two derivatives vanish on the border: τ is C¹. Where the network is stable up to L outside
    the box, so is the law everywhere: k_i [1 − (1 − t²)²] and D_i ≥ |τ_i − a_i| keep what bending takes away.
    Pressure beyond p̃ pushes with the constant gain G of the border at rest, which leaves the stiffness alone.

    Attributes:
        box: (1 + k, 2).
        reach: (1 + k,) L.
        gain: (2, k) G below and above.
        rest: (k,) the deformation of the box nearest to zero.
        stiffness: (k, 2) k_i below and above.
        guard: (k, 2) D_i.
        largest_slope: largest eigenvalue of ∂τ/∂u in the box, on a grid, N·m/rad.
    """

    box: Array
    reach: Array
    gain: Array
    rest: Array
    stiffness: Array
    guard: Array
    largest_slope: float

    def bend(self, points: Array) -> tuple[Array, Array, Array]:
        """x̃, how fast it follows x (1 inside, 1 − t² outside), and δ; all (n, 1 + k)."""
        inside = np.clip(points, self.box[:, 0], self.box[:, 1])
        excess = points - inside
        bent = np.tanh(excess / self.reach)
        return inside + self.reach * bent, 1 - bent * bent, excess


def continue_(network: Network, box: Array) -> Continuation:
    """The continuation of a network outside box (1 + k, 2), with the largest reach that keeps it stable."""
    half = np.ptp(box, axis=1) / 2
    levels = LEVELS[network.n_axes]
    inner = _largest_slope(network, _grid(box, levels))
    reach = half * REACHES[-1]
    for share in REACHES:
        wide = box + share * half[:, None] * [-1, 1]
        if _largest_slope(network, _grid(wide, levels)) <= SHARE_LEFT * inner < 0:
            reach = share * half
            break
    rest = np.clip(np.zeros(network.n_axes), box[1:, 0], box[1:, 1])
    gain = np.array([network.efforts(np.array([[p, *rest]]))[1][0] for p in box[0]])
    stiffness, guard = _borders(network, box, reach, rest)
    return Continuation(box, reach, gain, rest, stiffness, guard, inner)


def _borders(network: Network, box: Array, reach: Array, rest: Array) -> tuple[Array, Array]:
    """k_i and D_i, (k, 2) each: mean stiffness on a border, farthest that τ_i is from its value at rest near it."""
    k = network.n_axes
    stiffness, guard = np.zeros((k, 2)), np.zeros((k, 2))
    wide = box + reach[:, None] * [-1, 1]
    tau = network.efforts(_grid(box, LEVELS[k]))[0]
    for i, side in product(range(k), (0, 1)):
        slab = wide.copy()
        slab[1 + i] = sorted((box[1 + i, side], wide[1 + i, side]))
        points = _grid(slab, LEVELS[k])
        on_border = points.copy()
        on_border[:, 1 + i] = box[1 + i, side]
        at_rest = on_border.copy()
        at_rest[:, 1:] = np.where(np.arange(k) == i, on_border[:, 1:], rest)
        least = LEAST_STIFFNESS * np.ptp(tau[:, i]) / (np.ptp(box[1 + i]) / 2)
        stiffness[i, side] = max(-network.efforts(on_border)[2][:, i, i].mean(), least)
        away = network.efforts(points)[0][:, i] - network.efforts(at_rest)[0][:, i]
        guard[i, side] = SAFETY * np.abs(away).max()
    return stiffness, guard


def _largest_slope(network: Network, points: Array) -> float:
    return float(np.linalg.eigvalsh(network.efforts(points)[2]).max())


def _grid(box: Array, levels: int) -> Array:
    axes = np.meshgrid(*[np.linspace(low, high, levels) for low, high in box], indexing="ij")
    return np.stack([axis.ravel() for axis in axes], axis=1)
