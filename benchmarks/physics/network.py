"""Per-axis networks of the study's size (2-64-64-1, ReLU, single precision), evaluated one sample at a time.

The study trained them on FEM data. Here the hidden layers are random and the output layer is the least-squares
fit to the true law on a grid, which takes a second instead of minutes: an evaluation costs what the study's
costs, and the chain moves alike; `fit_errors` says how well they fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.physics.helix import PRESSURE_PA
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord
from pliant_plugins.surrogates.polynomial.axes import AxesLaw

WIDTH = 64
ANGLES_RAD = (-0.8, 0.9)
Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Network:
    """y = W₃ᵀ relu(W₂ᵀ relu(W₁ᵀ x + b₁) + b₂) + b₃ of x = (p / 15 kPa, u)."""

    weights: tuple[Single, Single, Single, Single, Single, Single]

    def value(self, pressure_pa: float, angle_rad: float) -> float:
        """τ of one sample, N·m."""
        w1, b1, w2, b2, w3, b3 = self.weights
        x = np.array([pressure_pa / PRESSURE_PA, angle_rad], np.float32)
        hidden = np.maximum(x @ w1 + b1, 0)
        hidden = np.maximum(hidden @ w2 + b2, 0)
        return float((hidden @ w3 + b3)[0])

    def slopes(self, pressure_pa: float, angle_rad: float) -> Array:
        """(∂τ/∂p, ∂τ/∂u) of one sample."""
        w1, b1, w2, b2, w3, _ = self.weights
        first = np.array([pressure_pa / PRESSURE_PA, angle_rad], np.float32) @ w1 + b1
        second = np.maximum(first, 0) @ w2 + b2
        slopes = w1 @ ((first > 0) * (w2 @ ((second > 0) * w3[:, 0])))
        return np.asarray(slopes / [PRESSURE_PA, 1.0], float)


@dataclass(frozen=True, eq=False)
class NetworkLaw(JointLaw):
    """Three networks, one for each of x, y, z; no sample shares a call with another."""

    networks: tuple[Network, Network, Network]
    domain: Domain
    joint: JointKind = "spherical"
    axes: tuple[str, ...] = ("x", "y", "z")
    actuation_name: str = "pressure_pa"

    def efforts(self, pressure_pa: float, angles_rad: Array) -> Array:
        """τ (n, 3) of n joints, as the study has them: one call per joint and axis, no slopes."""
        return np.array([self.effort(pressure_pa, u) for u in angles_rad])

    def effort(self, pressure_pa: float, angles_rad: Array) -> list[float]:
        """τ (3,) of one joint."""
        return [net.value(pressure_pa, u) for net, u in zip(self.networks, angles_rad, strict=True)]

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """τ and slopes, joint by joint and axis by axis."""
        n = len(deformation)
        tau, dtau_dp, dtau_du = np.empty((n, 3)), np.empty((n, 3)), np.zeros((n, 3, 3))
        for i in range(n):
            tau[i] = self.effort(actuation[i], deformation[i])
            for k, net in enumerate(self.networks):
                dtau_dp[i, k], dtau_du[i, k, k] = net.slopes(actuation[i], deformation[i, k])
        return Effort(tau, dtau_dp, dtau_du)

    def record(self) -> LawRecord:
        """The weights."""
        arrays = {
            f"{axis}_{k}": np.asarray(weight, float)
            for axis, net in zip(self.axes, self.networks, strict=True)
            for k, weight in enumerate(net.weights)
        }
        return LawRecord("network_benchmark", {"axes": list(self.axes)}, arrays)


def network_law(law: AxesLaw, seed: int = 0) -> NetworkLaw:
    """Networks for the three axes of a law."""
    random = np.random.default_rng(seed)
    nets = [_fitted(law, axis, random) for axis in range(3)]
    return NetworkLaw((nets[0], nets[1], nets[2]), law.domain)


def fit_errors(law: AxesLaw, networks: NetworkLaw) -> dict[str, float]:
    """RMS error over the range of the effort, per axis, on random samples that were not fitted."""
    random = np.random.default_rng(1)
    p, u = PRESSURE_PA * random.random(500), random.uniform(*ANGLES_RAD, 500)
    errors = {}
    for k, axis in enumerate(law.axes):
        true = law.laws[k].evaluate(p, u[:, None]).tau[:, 0]
        net = np.array([networks.networks[k].value(*sample) for sample in zip(p, u, strict=True)])
        errors[axis] = float(np.sqrt(np.mean((net - true) ** 2)) / np.ptp(true))
    return errors


def _fitted(law: AxesLaw, axis: int, random: np.random.Generator) -> Network:
    """Random hidden layers, output layer by ridge regression on a grid."""
    grid = np.meshgrid(np.linspace(0, PRESSURE_PA, 31), np.linspace(*ANGLES_RAD, 121))
    p, u = (values.ravel() for values in grid)
    target = law.laws[axis].evaluate(p, u[:, None]).tau[:, 0]
    w1 = random.normal(size=(2, WIDTH))
    b1 = -(random.uniform([[0.0], [ANGLES_RAD[0]]], [[1.0], [ANGLES_RAD[1]]], (2, WIDTH)) * w1).sum(axis=0)
    w2, b2 = random.normal(size=(WIDTH, WIDTH)) / 8, random.normal(size=WIDTH) / 4
    hidden = np.maximum(np.stack([p / PRESSURE_PA, u], axis=1) @ w1 + b1, 0)
    hidden = np.maximum(hidden @ w2 + b2, 0)
    columns = np.column_stack([hidden, np.ones(len(u))])
    ridge = 1e-5 * np.sqrt(len(u)) * np.eye(WIDTH + 1)
    scale = np.abs(target).max()
    right = np.concatenate([target / scale, np.zeros(WIDTH + 1)])
    w3 = scale * np.linalg.lstsq(np.vstack([columns, ridge]), right, rcond=None)[0]
    layers = [w1, b1, w2, b2, w3[:-1, None], w3[-1:]]
    return Network(tuple(np.asarray(layer, np.float32) for layer in layers))  # type: ignore[arg-type]
