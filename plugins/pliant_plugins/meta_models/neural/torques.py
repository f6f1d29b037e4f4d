"""The study's neural meta-model: one ReLU network of torque per axis; a design's law is its nearest stable energy.

A network of kinks has no energy and no stiffness to rely on, so the torques that it gives over a design's box are
fitted by the common form of the family, least squares; what that changes counts as the model's error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.interfaces.meta_model import DesignLaws
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant.records.solved import Parameter
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.common_form_terms import scaled_basis
from pliant_plugins.meta_models.network_training import fit_layers
from pliant_plugins.meta_models.networks import Layers
from pliant_plugins.meta_models.neural.laws import KIND
from pliant_plugins.meta_models.neural.states import ScaledStates, top_of
from pliant_plugins.surrogates.polynomial.energy import unit

# Levels of pressure and angle for one axis; scattered points for several.
LEVELS = (9, 33)
POINTS, SEED = 500, 0
RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class TorqueLaws(DesignLaws):
    """Laws of one network per axis.

    Attributes:
        form: the common form of the laws.
        networks: by axis: scaled parameters, actuation and deformations (n, d + 1 + k) → scaled torque (n, 1).
        sizes: (k,) mean size of each axis' scaled torque.
    """

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]
    form: CommonForm
    networks: tuple[Layers, ...]
    sizes: Array

    def law(self, values: Array) -> JointLaw:
        """The law of one design (d,): the common form's that misses the network's torques least."""
        values = np.asarray(values, float)
        form = self.form
        domain = form.domain(values)
        box = np.vstack(
            [domain.actuation / top_of(form), domain.deformation / form.reach(values[None])[0][:, None]]
        )
        points = box[:, 0] + grid(len(form.axes)) * np.ptp(box, axis=1)
        tau = self.torques(form.parameters(values[None]), np.zeros(len(points), int), points)
        basis, k = scaled_basis(form.exponents), len(form.axes)
        rows = np.concatenate(
            [-basis.derivative(points[:, 0], points[:, 1:], unit(k, 1 + i)) / self.sizes[i] for i in range(k)]
        )
        columns, right = rows @ form.directions, (tau / self.sizes).T.ravel() - rows @ form.centre
        square = columns.T @ columns
        held = RIDGE * np.trace(square) * np.eye(len(square))
        return form.law(values, np.linalg.solve(square + held, columns.T @ right))

    def torques(self, places: Array, design: Array, points: Array) -> Array:
        """(n, k) what the networks say, scaled: of designs `design` (n,) among places (m, d) at points (n, 1 + k)."""
        inputs = np.column_stack([places[design.astype(int)], points])
        return np.column_stack([network(inputs) for network in self.networks])

    def record(self) -> LawRecord:
        """Form and weights as numbers."""
        form, arrays = self.form.record()
        described = []
        for number, network in enumerate(self.networks):
            values, weights = network.record()
            described.append(values)
            arrays |= {f"axis_{number}_{name}": array for name, array in weights.items()}
        found = {
            "names": list(self.names),
            "fixed": dict(self.fixed),
            "form": form,
            "activation": "relu",
            "networks": described,
        }
        return LawRecord(KIND, found, {**arrays, "box": self.box, "torque_sizes": self.sizes})

    @staticmethod
    def of_record(record: LawRecord) -> TorqueLaws:
        """The model of a record; both give laws of the same bits."""
        values, arrays = record.values, record.arrays
        networks = []
        for number, described in enumerate(values["networks"]):
            led = f"axis_{number}_"
            own = {name.removeprefix(led): array for name, array in arrays.items() if name.startswith(led)}
            networks.append(Layers.of_record(described, own))
        return TorqueLaws(
            tuple(values["names"]),
            np.asarray(arrays["box"], float),
            dict(values["fixed"]),
            CommonForm.of_record(values["form"], arrays),
            tuple(networks),
            np.asarray(arrays["torque_sizes"], float),
        )


def fit_torques(
    states: ScaledStates, units: int, decay: float, seed: int
) -> tuple[tuple[Layers, ...], Array, float]:
    """One network per axis by the mean squared error of torques alone, their sizes and what they miss of these."""
    inputs = np.column_stack([states.places[states.design], states.points])
    sizes = np.sqrt(np.mean(states.tau**2, axis=0))
    sizes = np.where(sizes > 0, sizes, 1.0)
    networks, missed = [], []
    for axis, size in enumerate(sizes):
        wanted = states.tau[:, axis : axis + 1]
        network = fit_layers(inputs, wanted, (units, units), "relu", 1, decay, np.array([size]), seed + axis)
        networks.append(network)
        missed.append(float(np.mean(((network(inputs) - wanted) / size) ** 2)))
    return tuple(networks), sizes, float(np.sqrt(np.mean(missed)))


def grid(n_axes: int) -> Array:
    """(g, 1 + k) points of the unit box."""
    if n_axes > 1:
        found: Array = np.random.default_rng(SEED).random((POINTS, 1 + n_axes))
        return found
    ticks = [np.linspace(0, 1, count) for count in LEVELS]
    return np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
