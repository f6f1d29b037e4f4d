"""The joint law of a network of an energy, of one to three axes, defined and stable outside its box too.

`network_effort` is the same as one plain function that allocates nothing, for engines that compile it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from itertools import product

import numpy as np

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.neural.network import Network
from pliant_plugins.surrogates.records import arrays_of, law_record, shared_fields

# Parameters: number of units; coordinates, axes, then b, c and w of each unit.
# Each coordinate's block: box low, box high, reach. Each axis's: rest, stiffness below and above, guard below and
# above, gain below and above, then effort, gain and the row of the stiffness of the network's quadratic form.
COORDINATE = 3
AXIS = 9
# The network is seen this far outside the box, in half-widths; halved until it is stable there.
REACHES = (0.25, 0.125, 1 / 16, 1 / 32, 1 / 64)
# Of the least stiffness in the box, what must be left as far outside as the network is seen.
SHARE_LEFT = 0.5
# Where a border has no stiffness: of the effort's range over the box's half-width.
LEAST_STIFFNESS = 0.02
SAFETY = 1.2
LEVELS = {1: 41, 2: 13, 3: 7}


@dataclass(frozen=True, eq=False)
class NetworkContinuation:
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


def continue_(network: Network, box: Array) -> NetworkContinuation:
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
    return NetworkContinuation(box, reach, gain, rest, stiffness, guard, inner)


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


KIND = "neural"


@dataclass(frozen=True, eq=False)
class NeuralLaw(JointLaw):
    """τ = −∂Π/∂u of `Network` inside the box and of `NetworkContinuation` outside: nothing gains energy anywhere.

    ∂τ_i/∂u_j = ∂τ_j/∂u_i to the last bit but rounding. numpy is all that it needs.

    Attributes:
        network: the energy.
        domain: the box of the data.
        error: its error bar.
    """

    network: Network
    domain: Domain
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    actuation_name: str = "pressure_pa"
    error: ErrorBar | None = None
    outside: NetworkContinuation = field(init=False, repr=False)

    def __post_init__(self) -> None:
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        object.__setattr__(self, "outside", continue_(self.network, box))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """τ (n, k), ∂τ/∂p (n, k) and the symmetric ∂τ/∂u (n, k, k) for actuation (n,) and deformation (n, k)."""
        points = _points(actuation, deformation)
        how = self.outside
        bent, rate, excess = how.bend(points)
        tau, gain, slope = self.network.efforts(bent)
        if not excess.any():
            return Effort(tau, gain, slope)
        r, s, in_p = rate[:, 1:], rate[:, 1:, None] * rate[:, None, 1:], rate[:, :1]
        slope = slope * s
        at_border, border_gain = self._border(bent[:, 0], excess[:, 1:])
        stiffness, guard = self._sides(excess[:, 1:])
        reach, sign = how.reach[1:], np.sign(excess[:, 1:])
        t = np.tanh(np.abs(excess[:, 1:]) / reach)
        bending = -2 * t * r / reach
        diagonal = np.einsum("nii->ni", slope)
        diagonal += (tau - at_border) * sign * bending - stiffness * (1 - r * r) + guard * bending
        outer_gain = np.where(excess[:, :1] > 0, how.gain[1], how.gain[0])
        tau = tau * r + at_border * (1 - r) + (points[:, :1] - bent[:, :1]) * outer_gain
        tau -= stiffness * (excess[:, 1:] - sign * reach * (t - t**3 / 3)) + guard * sign * (1 - r)
        gain = in_p * (gain * r + border_gain * (1 - r)) + (1 - in_p) * outer_gain
        return Effort(tau, gain, slope)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(p, u) − Π(p, 0) in J, shape (n,), in closed form, continuation included."""
        u = np.asarray(deformation, float)
        return self._energy(_points(actuation, u)) - self._energy(_points(actuation, np.zeros_like(u)))

    def scalar(self) -> ScalarLaw:
        """The same law for compiled engines."""
        net, how = self.network, self.outside
        axes = [how.rest, how.stiffness, how.guard, how.gain.T, net.effort, net.gain, net.stiffness]
        blocks = ([how.box, how.reach], axes, [net.offsets, net.factors, net.weights])
        numbers = [np.column_stack(block).ravel() for block in blocks]
        parameters = np.concatenate([[float(len(net.offsets))], *numbers])
        return ScalarLaw(network_effort, parameters, partial(shared, axes=len(self.axes)))

    def record(self) -> LawRecord:
        """Network, domain and error bar; the continuation follows from them."""
        return law_record(KIND, self, self.network.arrays())

    @staticmethod
    def of_record(record: LawRecord) -> NeuralLaw:
        """The law of a record; both evaluate to the same bits."""
        return NeuralLaw(Network(**arrays_of(record, *Network.__dataclass_fields__)), **shared_fields(record))

    def _energy(self, points: Array) -> Array:
        """(n,) Π̃, see `NetworkContinuation`."""
        how = self.outside
        bent, _, excess = how.bend(points)
        energy = self.network.energy(bent)
        if not excess.any():
            return energy
        outer_gain = np.where(excess[:, :1] > 0, how.gain[1], how.gain[0])
        energy = energy - np.sum((points[:, :1] - bent[:, :1]) * outer_gain * points[:, 1:], axis=1)
        at_border, _ = self._border(bent[:, 0], excess[:, 1:])
        stiffness, guard = self._sides(excess[:, 1:])
        reach, r = how.reach[1:], np.abs(excess[:, 1:])
        x = r / reach
        t = np.tanh(x)
        log_cosh = x + np.log1p(np.exp(-2 * x)) - np.log(2.0)
        left = r - reach * t
        bowl = r * r / 2 - reach**2 * (2 / 3 * log_cosh + t * t / 6)
        beside = (guard - at_border * np.sign(excess[:, 1:])) * left + stiffness * bowl
        return energy + beside.sum(axis=1)

    def _border(self, p: Array, excess: Array) -> tuple[Array, Array]:
        """a_i and ∂a_i/∂p̃, (n, k) each; zero for axes inside their box."""
        tau, gain = np.zeros_like(excess), np.zeros_like(excess)
        for i in range(excess.shape[1]):
            for side, out in enumerate((excess[:, i] < 0, excess[:, i] > 0)):
                if out.any():
                    u = self.outside.rest.copy()
                    u[i] = self.outside.box[1 + i, side]
                    found = self.network.efforts(_points(p[out], np.tile(u, (int(out.sum()), 1))))
                    tau[out, i], gain[out, i] = found[0][:, i], found[1][:, i]
        return tau, gain

    def _sides(self, excess: Array) -> tuple[Array, Array]:
        """k_i and D_i of the side that each joint left, (n, k) each."""
        side = (excess > 0).astype(int)
        index = np.arange(excess.shape[1])
        return self.outside.stiffness[index, side], self.outside.guard[index, side]


def _points(actuation: Array, deformation: Array) -> Array:
    """(n, 1 + k)."""
    return np.column_stack([np.asarray(actuation, float), np.asarray(deformation, float)])


def network_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (k,), dtau_dp (k,) and dtau_du (k, k); `parameters` as `NeuralLaw.scalar` makes them."""
    k = len(tau)
    p, rate_p = _bent(actuation, parameters, 1)
    for i in range(k):
        tau[i] = 0.0
        dtau_dp[i] = 0.0
        for j in range(k):
            dtau_du[i, j] = 0.0
    first = 1 + COORDINATE * (1 + k) + (AXIS + k) * k
    for unit in range(int(parameters[0] + 0.5)):
        at = first + unit * (3 + k)
        z = parameters[at] + parameters[at + 2] * p
        for i in range(k):
            z += parameters[at + 3 + i] * _bent(deformation[i], parameters, 1 + COORDINATE * (1 + i))[0]
        bell = 1.0 / math.sqrt(1.0 + z * z)
        slope = parameters[at + 1] * z * bell
        curvature = parameters[at + 1] * bell * bell * bell
        for i in range(k):
            w = parameters[at + 3 + i]
            tau[i] -= slope * w
            dtau_dp[i] -= curvature * w * parameters[at + 2]
            for j in range(i, k):
                dtau_du[i, j] -= curvature * w * parameters[at + 3 + j]
    for i in range(k):
        axis = 1 + COORDINATE * (1 + k) + (AXIS + k) * i
        tau[i] += parameters[axis + 7] + p * parameters[axis + 8]
        dtau_dp[i] += parameters[axis + 8]
        for j in range(k):
            u = _bent(deformation[j], parameters, 1 + COORDINATE * (1 + j))[0]
            tau[i] -= parameters[axis + 9 + j] * u
            if j >= i:
                dtau_du[i, j] -= parameters[axis + 9 + j]
    for i in range(k):
        rate = _bent(deformation[i], parameters, 1 + COORDINATE * (1 + i))[1]
        for j in range(i, k):
            dtau_du[i, j] *= rate * _bent(deformation[j], parameters, 1 + COORDINATE * (1 + j))[1]
        _outside(i, k, p, deformation[i], parameters, tau, dtau_dp, dtau_du)
        axis = 1 + COORDINATE * (1 + k) + (AXIS + k) * i
        side = 1 if actuation > p else 0
        tau[i] += (actuation - p) * parameters[axis + 5 + side]
        dtau_dp[i] = rate_p * dtau_dp[i] + (1.0 - rate_p) * parameters[axis + 5 + side]
    for i in range(k):
        for j in range(i):
            dtau_du[i, j] = dtau_du[j, i]


def _bent(value: float, parameters: Array, at: int) -> tuple[float, float]:
    """x̃ and how fast it follows x."""
    low, high = parameters[at], parameters[at + 1]
    if low <= value <= high:
        return value, 1.0
    border = low if value < low else high
    bent = math.tanh((value - border) / parameters[at + 2])
    return border + parameters[at + 2] * bent, 1.0 - bent * bent


def _outside(
    i: int, k: int, p: float, u: float, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Add what axis i has outside its box to its effort and slopes."""
    at = 1 + COORDINATE * (1 + i)
    low, high, reach = parameters[at], parameters[at + 1], parameters[at + 2]
    if low <= u <= high:
        return
    side = 1 if u > high else 0
    border = high if u > high else low
    sign = 1.0 if u > high else -1.0
    axis = 1 + COORDINATE * (1 + k) + (AXIS + k) * i
    stiffness, guard = parameters[axis + 1 + side], parameters[axis + 3 + side]
    effort, gain = _border(i, k, p, border, parameters)
    excess = u - border
    t = math.tanh(abs(excess) / reach)
    rate = 1.0 - t * t
    bending = -2.0 * t * rate / reach
    dtau_du[i, i] += (tau[i] - effort) * sign * bending - stiffness * (1.0 - rate * rate) + guard * bending
    tau[i] = tau[i] * rate + effort * (1.0 - rate) - guard * sign * (1.0 - rate)
    tau[i] -= stiffness * (excess - sign * reach * (t - t * t * t / 3.0))
    dtau_dp[i] = dtau_dp[i] * rate + gain * (1.0 - rate)


def _border(i: int, k: int, p: float, border: float, parameters: Array) -> tuple[float, float]:
    """The network's τ_i and ∂τ_i/∂p where axis i is at its border and the others at rest."""
    axes = 1 + COORDINATE * (1 + k)
    own = axes + (AXIS + k) * i
    effort, gain = parameters[own + 7] + p * parameters[own + 8], parameters[own + 8]
    for j in range(k):
        u = border if j == i else parameters[axes + (AXIS + k) * j]
        effort -= parameters[own + 9 + j] * u
    first = axes + (AXIS + k) * k
    for unit in range(int(parameters[0] + 0.5)):
        at = first + unit * (3 + k)
        z = parameters[at] + parameters[at + 2] * p
        for j in range(k):
            u = border if j == i else parameters[axes + (AXIS + k) * j]
            z += parameters[at + 3 + j] * u
        bell = 1.0 / math.sqrt(1.0 + z * z)
        pull = parameters[at + 1] * parameters[at + 3 + i] * bell
        effort -= pull * z
        gain -= pull * bell * bell * parameters[at + 2]
    return effort, gain


def shared(parameters: Array, share: float, axes: int) -> Array:
    """Parameters of the law of so many axes whose actuation is `share` times what it is told."""
    told = np.array(parameters, float)
    told[1 : 1 + COORDINATE] /= share
    first = 1 + COORDINATE * (1 + axes)
    by_axis = told[first : first + (AXIS + axes) * axes].reshape(axes, AXIS + axes)
    by_axis[:, [5, 6, 8]] *= share
    told[first + (AXIS + axes) * axes :].reshape(-1, 3 + axes)[:, 2] *= share
    return told
