"""The joint law of a network of an energy, of one to three axes, defined and stable outside its box too."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.neural.continuation import Continuation, continue_
from pliant_plugins.surrogates.neural.network import Network
from pliant_plugins.surrogates.neural.scalar import network_effort, pack, shared
from pliant_plugins.surrogates.records import arrays_of, law_record, shared_fields

KIND = "neural"


@dataclass(frozen=True, eq=False)
class NeuralLaw(JointLaw):
    """τ = −∂Π/∂u of `Network` inside the box and of `Continuation` outside: nothing gains energy anywhere.

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
    outside: Continuation = field(init=False, repr=False)

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
        t = np.abs(excess[:, 1:]) / reach
        t = np.tanh(t)
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
        difference: Array = self._energy(_points(actuation, u)) - self._energy(
            _points(actuation, np.zeros_like(u))
        )
        return difference

    def scalar(self) -> ScalarLaw:
        """The same law for compiled engines."""
        return ScalarLaw(
            network_effort, pack(self.network, self.outside), partial(shared, axes=len(self.axes))
        )

    def record(self) -> LawRecord:
        """Network, domain and error bar; the continuation follows from them."""
        return law_record(KIND, self, self.network.arrays())

    @staticmethod
    def of_record(record: LawRecord) -> NeuralLaw:
        """The law of a record; both evaluate to the same bits."""
        return NeuralLaw(Network(**arrays_of(record, *Network.__dataclass_fields__)), **shared_fields(record))

    def _energy(self, points: Array) -> Array:
        """(n,) Π̃, see `Continuation`."""
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
        total: Array = energy + beside.sum(axis=1)
        return total

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
