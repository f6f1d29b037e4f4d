"""The joint law of a network of an energy, of any actuations and axes, defined and stable outside its box too."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from itertools import product

import numpy as np

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.neural.network import Network, network_effort, several_network_effort, shared
from pliant_plugins.surrogates.records import float_arrays, law_record, shared_fields

# The network is evaluated this far outside the box, in half-widths; halved until it is stable there.
REACHES = (0.25, 0.125, 1 / 16, 1 / 32, 1 / 64)
# Share of the least stiffness in the box that must remain as far outside as the network is evaluated.
SHARE_LEFT = 0.5
# Where a border has no stiffness: of the effort's range over the box's half-width.
LEAST_STIFFNESS = 0.02
SAFETY = 1.2
LEVELS, FEWEST = {2: 41, 3: 13, 4: 7, 5: 5, 6: 4}, 3  # of a grid, by the number of coordinates


@dataclass(frozen=True, eq=False)
class NetworkContinuation:
    """Π̃(p, u) = N(p̃, ũ) − (p − p̃) G·u + Σ_i B_i(δ_i), N being the network's energy.

    δ is the distance of a coordinate outside the box, and x̃ = x̂ + L tanh(δ/L) bounds it so that the network is
    evaluated at most L outside. Each axis outside its box adds, with r = |δ| and t = tanh(r/L),

        B_i = −a_i(p̃) sign(δ_i) (r − L t) + k_i [r²/2 − L² (⅔ ln cosh(r/L) + t²/6)] + D_i (r − L t)

    where a_i is τ_i on the border, the other axes at rest, so that τ continues as a line of the stiffness k_i. All
    terms and their first two derivatives vanish on the border: τ is C¹. If the network is stable up to L outside the
    box, the law is stable everywhere: k_i [1 − (1 − t²)²] and D_i ≥ |τ_i − a_i| compensate the stiffness lost by
    bounding x̃. Pressure beyond p̃ acts with the constant gain G of the border at rest, which does not change the
    stiffness. Of several actuations each has its own G, the others at rest.

    Attributes:
        box: (m + k, 2).
        reach: (m + k,) L.
        gain: (m, 2, k) G of each actuation below and above.
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
        """Return x̃, its derivative by x (1 inside, 1 − t² outside), and δ; all (n, m + k)."""
        inside = np.clip(points, self.box[:, 0], self.box[:, 1])
        excess = points - inside
        bent = np.tanh(excess / self.reach)
        return inside + self.reach * bent, 1 - bent * bent, excess


def continue_(network: Network, box: Array) -> NetworkContinuation:
    """Return the continuation of a network outside box (m + k, 2), with the largest reach that keeps it stable."""
    half = np.ptp(box, axis=1) / 2
    m = network.n_inputs
    levels = LEVELS.get(len(box), FEWEST)
    inner = _largest_slope(network, _grid(box, levels))
    reach = half * REACHES[-1]
    for share in REACHES:
        wide = box + share * half[:, None] * [-1, 1]
        if _largest_slope(network, _grid(wide, levels)) <= SHARE_LEFT * inner < 0:
            reach = share * half
            break
    at_rest = np.clip(np.zeros(len(box)), box[:, 0], box[:, 1])
    gain, rest = np.empty((m, 2, network.n_axes)), at_rest[m:]
    for j, side in product(range(m), (0, 1)):
        at = at_rest.copy()
        at[j] = box[j, side]
        gain[j, side] = network.efforts(at[None])[1][0, :, j]
    stiffness, guard = _borders(network, box, reach, rest)
    return NetworkContinuation(box, reach, gain, rest, stiffness, guard, inner)


def _borders(network: Network, box: Array, reach: Array, rest: Array) -> tuple[Array, Array]:
    """Return k_i and D_i, (k, 2) each: mean stiffness on a border, largest deviation of τ_i from rest near it."""
    k, m = network.n_axes, network.n_inputs
    levels = LEVELS.get(len(box), FEWEST)
    stiffness, guard = np.zeros((k, 2)), np.zeros((k, 2))
    wide = box + reach[:, None] * [-1, 1]
    tau = network.efforts(_grid(box, levels))[0]
    for i, side in product(range(k), (0, 1)):
        slab = wide.copy()
        slab[m + i] = sorted((box[m + i, side], wide[m + i, side]))
        points = _grid(slab, levels)
        on_border = points.copy()
        on_border[:, m + i] = box[m + i, side]
        at_rest = on_border.copy()
        at_rest[:, m:] = np.where(np.arange(k) == i, on_border[:, m:], rest)
        least = LEAST_STIFFNESS * np.ptp(tau[:, i]) / (np.ptp(box[m + i]) / 2)
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
    """τ = −∂Π/∂u of `Network` inside the box and of `NetworkContinuation` outside: conservative everywhere.

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
        object.__setattr__(self, "outside", continue_(self.network, self.domain.box))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ (n, k), ∂τ/∂p (n, k) and the symmetric ∂τ/∂u (n, k, k) for actuation (n,) and deformation (n, k).

        Of m > 1 actuations they are (n, m), ∂τ/∂p is (n, k, m).
        """
        points, m = _points(actuation, deformation), self.network.n_inputs
        how = self.outside
        bent, rate, excess = how.bend(points)
        tau, gain, slope = self.network.efforts(bent)
        if not excess.any():
            return Effort(tau, _narrow(gain), slope)
        in_p, r = rate[:, None, :m], rate[:, m:]
        s = r[:, :, None] * r[:, None, :]
        slope = slope * s
        beyond = excess[:, m:]
        at_border, border_gain = self._border(bent[:, :m], beyond)
        stiffness, guard = self._sides(beyond)
        reach, sign = how.reach[m:], np.sign(beyond)
        t = np.tanh(np.abs(beyond) / reach)
        bending = -2 * t * r / reach
        diagonal = np.einsum("nii->ni", slope)
        diagonal += (tau - at_border) * sign * bending - stiffness * (1 - r * r) + guard * bending
        outer_gain = self._outer_gain(excess[:, :m])
        tau = tau * r + at_border * (1 - r)
        tau += np.sum((points - bent)[:, None, :m] * outer_gain, axis=2)
        tau -= stiffness * (beyond - sign * reach * (t - t**3 / 3)) + guard * sign * (1 - r)
        gain = in_p * (gain * r[:, :, None] + border_gain * (1 - r)[:, :, None]) + (1 - in_p) * outer_gain
        return Effort(tau, _narrow(gain), slope)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) in J, shape (n,), in closed form, continuation included."""
        u = np.asarray(deformation, float)
        return self._energy(_points(actuation, u)) - self._energy(_points(actuation, np.zeros_like(u)))

    def scalar(self) -> ScalarLaw:
        """Return the law as a scalar function for compiled engines."""
        net, how = self.network, self.outside
        outer_gain = how.gain.transpose(2, 0, 1).reshape(net.n_axes, -1)
        axes = [how.rest, how.stiffness, how.guard, outer_gain, net.effort, net.gains, net.stiffness]
        blocks = ([how.box, how.reach], axes, [net.offsets, net.factors, net.weights])
        numbers = [np.column_stack(block).ravel() for block in blocks]
        parameters = np.concatenate([[float(len(net.offsets)), float(net.n_inputs)], *numbers])
        if net.n_inputs > 1:
            return ScalarLaw(several_network_effort, parameters)
        return ScalarLaw(network_effort, parameters, partial(shared, axes=len(self.axes)))

    def record(self) -> LawRecord:
        """Return network, domain and error bar; the continuation follows from them."""
        return law_record(KIND, self, self.network.arrays())

    @staticmethod
    def from_record(record: LawRecord) -> NeuralLaw:
        """Return the law of a record, identical bit for bit."""
        return NeuralLaw(
            Network(**float_arrays(record, *Network.__dataclass_fields__)), **shared_fields(record)
        )

    def _energy(self, points: Array) -> Array:
        """Return (n,) Π̃, see `NetworkContinuation`."""
        how = self.outside
        bent, _, excess = how.bend(points)
        energy = self.network.energy(bent)
        if not excess.any():
            return energy
        m = self.network.n_inputs
        beyond, pushed = excess[:, m:], (points - bent)[:, None, :m] * self._outer_gain(excess[:, :m])
        energy = energy - np.sum(pushed * points[:, m:, None], axis=(1, 2))
        at_border, _ = self._border(bent[:, :m], beyond)
        stiffness, guard = self._sides(beyond)
        reach, r = how.reach[m:], np.abs(beyond)
        x = r / reach
        t = np.tanh(x)
        log_cosh = x + np.log1p(np.exp(-2 * x)) - np.log(2.0)
        left = r - reach * t
        bowl = r * r / 2 - reach**2 * (2 / 3 * log_cosh + t * t / 6)
        beside = (guard - at_border * np.sign(beyond)) * left + stiffness * bowl
        return energy + beside.sum(axis=1)

    def _outer_gain(self, excess: Array) -> Array:
        """Return (n, k, m) G of the side on which each actuation left its box by excess (n, m)."""
        of_side = self.outside.gain[np.arange(excess.shape[1]), (excess > 0).astype(int)]
        return np.swapaxes(of_side, 1, 2)

    def _border(self, p: Array, excess: Array) -> tuple[Array, Array]:
        """Return a_i (n, k) and ∂a_i/∂p̃ (n, k, m) at p (n, m); zero for axes inside their box."""
        m = p.shape[1]
        tau, gain = np.zeros_like(excess), np.zeros((*excess.shape, m))
        for i in range(excess.shape[1]):
            for side, out in enumerate((excess[:, i] < 0, excess[:, i] > 0)):
                if out.any():
                    u = self.outside.rest.copy()
                    u[i] = self.outside.box[m + i, side]
                    found = self.network.efforts(_points(p[out], np.tile(u, (int(out.sum()), 1))))
                    tau[out, i], gain[out, i] = found[0][:, i], found[1][:, i]
        return tau, gain

    def _sides(self, excess: Array) -> tuple[Array, Array]:
        """Return k_i and D_i of the side that each joint left, (n, k) each."""
        side = (excess > 0).astype(int)
        index = np.arange(excess.shape[1])
        return self.outside.stiffness[index, side], self.outside.guard[index, side]


def _points(actuation: Array, deformation: Array) -> Array:
    """Return points (n, m + k)."""
    return np.column_stack([np.asarray(actuation, float), np.asarray(deformation, float)])


def _narrow(gain: Array) -> Array:
    """Return ∂τ/∂p (n, k, m) in the format of laws: (n, k) for one actuation."""
    return gain[:, :, 0] if gain.shape[2] == 1 else gain
