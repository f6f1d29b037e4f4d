"""Fitted neural meta-models: of an energy, or of each axis' torque as in the study.

Of an energy, a design's law is a neural law whose units hold the design. A network of torques has kinks, no energy
and no stiffness to rely on, so the torques that it gives over a design's box are fitted by the common form of the
family, least squares; what that changes counts as the model's error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant_designs.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant_designs.meta_models.common_form import FormLaws
from pliant_designs.meta_models.common_form_fit import fit_common_form
from pliant_designs.meta_models.common_form_terms import scaled_basis
from pliant_designs.meta_models.config import NeuralMetaConfig
from pliant_designs.meta_models.networks import Layers, fit_layers
from pliant_designs.meta_models.ridges import RidgeFamily, ScaledStates, fit_ridges
from pliant_designs.records import SolvedDesigns
from pliant_plugins.surrogates.neural.law import NeuralLaw
from pliant_plugins.surrogates.polynomial.energy import unit

KIND = "neural"
# Of a law's stiffness at rest, what must be left all over its box.
MARGIN = 0.02
TRIES = 3


@dataclass(frozen=True, eq=False)
class EnergyLaws(FormLaws):
    """Laws of one network of an energy.

    Attributes:
        family: the network.
    """

    family: RidgeFamily

    def law(self, values: Array) -> JointLaw:
        """Return the law of one design (d,), stiffened uniformly if it would not be stable in its box."""
        form, rows = self.form, np.asarray(values, float)[None]
        reach = form.reach(rows)[0]
        network = self.family.network(
            form.parameters(rows)[0], float(form.energy(rows)[0]), form.largest_actuation, reach
        )
        law = NeuralLaw(network, form.domain(rows[0]), form.axes, form.joint, form.actuation_name)
        for _ in range(TRIES):
            if law.outside.largest_slope < 0:
                break
            rest = network.efforts(np.zeros((1, 1 + len(reach))))[2][0]
            raised = law.outside.largest_slope + MARGIN * float(np.abs(np.diagonal(rest)).min())
            network = replace(network, stiffness=network.stiffness + raised * np.eye(len(reach)))
            law = replace(law, network=network)
        return law

    def record(self) -> LawRecord:
        """Form and weights as numbers."""
        return self.build_record(KIND, self.family.arrays(), activation="smooth")

    @staticmethod
    def from_record(record: LawRecord) -> EnergyLaws:
        """Return the model of a record; laws are identical bit for bit."""
        return EnergyLaws(**FormLaws.shared_fields(record), family=RidgeFamily.from_arrays(record.arrays))


# Levels of pressure and angle where there is one of each; scattered points for more.
LEVELS = (9, 33)
POINTS, SEED = 500, 0
RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class TorqueLaws(FormLaws):
    """Laws of one network per axis.

    Attributes:
        networks: by axis: scaled parameters, actuations and deformations (n, d + m + k) → scaled torque (n, 1).
        sizes: (k,) mean size of each axis' scaled torque.
    """

    networks: tuple[Layers, ...]
    sizes: Array

    def law(self, values: Array) -> JointLaw:
        """Return the law of one design (d,) of the common form that fits the network's torques best."""
        values = np.asarray(values, float)
        form = self.form
        domain = form.domain(values)
        box = np.vstack([form.scaled_actuation, domain.deformation / form.reach(values[None])[0][:, None]])
        points = box[:, 0] + grid(len(box)) * np.ptp(box, axis=1)
        tau = self.torques(form.parameters(values[None]), np.zeros(len(points), int), points)
        basis, k = scaled_basis(form.exponents), len(form.axes)
        m = len(box) - k
        inputs, turned = points[:, :m], points[:, m:]
        rows = np.concatenate(
            [-basis.derivative(inputs, turned, unit(m + k, m + i)) / self.sizes[i] for i in range(k)]
        )
        columns, right = rows @ form.directions, (tau / self.sizes).T.ravel() - rows @ form.centre
        square = columns.T @ columns
        held = RIDGE * np.trace(square) * np.eye(len(square))
        return form.law(values, np.linalg.solve(square + held, columns.T @ right))

    def torques(self, places: Array, design: Array, points: Array) -> Array:
        """Return (n, k) scaled torques of designs `design` (n,) among places (m, d) at points (n, m + k)."""
        inputs = np.column_stack([places[design.astype(int)], points])
        return np.column_stack([network(inputs) for network in self.networks])

    def record(self) -> LawRecord:
        """Form and weights as numbers."""
        arrays, networks = {"torque_sizes": self.sizes}, []
        for number, network in enumerate(self.networks):
            values, weights = network.record()
            networks.append(values)
            arrays |= {f"axis_{number}_{name}": array for name, array in weights.items()}
        return self.build_record(KIND, arrays, activation="relu", networks=networks)

    @staticmethod
    def from_record(record: LawRecord) -> TorqueLaws:
        """Return the model of a record; laws are identical bit for bit."""
        networks = []
        for number, values in enumerate(record.values["networks"]):
            led = f"axis_{number}_"
            own = {name.removeprefix(led): a for name, a in record.arrays.items() if name.startswith(led)}
            networks.append(Layers.from_record(values, own))
        sizes = np.asarray(record.arrays["torque_sizes"], float)
        return TorqueLaws(**FormLaws.shared_fields(record), networks=tuple(networks), sizes=sizes)


def fit_torques(
    states: ScaledStates, units: int, decay: float, seed: int
) -> tuple[tuple[Layers, ...], Array, float]:
    """Fit one network per axis to torques alone; return them, their sizes and their residuals."""
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


def grid(coordinates: int) -> Array:
    """Return points (g, m + k) of the unit box of m actuations and k deformations."""
    if coordinates > 2:
        return np.random.default_rng(SEED).random((POINTS, coordinates))
    ticks = [np.linspace(0, 1, count) for count in LEVELS]
    return np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)


class NeuralMetaModel(MetaModel):
    """An energy over all designs from efforts and slopes, or the study's torques (doi 10.1002/aisy.70406)."""

    several_actuations = True
    config: NeuralMetaConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Fit scales and boxes of the common form, then the network; torch trains it, numpy evaluates it."""
        enough_designs(designs, self.fewest, KIND)
        form, _ = fit_common_form(designs)
        states = ScaledStates.from_designs(designs, form)
        c = self.config
        common: dict[str, Any] = {
            "names": designs.names,
            "box": designs.box,
            "fixed": dict(designs.fixed),
            "form": form,
        }
        laws: DesignLaws
        if c.activation == "relu":
            networks, sizes, missed = fit_torques(states, c.units, c.decay, c.seed)
            laws = TorqueLaws(**common, networks=networks, sizes=sizes)
        else:
            mirror = np.ones(len(form.axes))
            if form.details["even"]:
                mirror = np.where(np.arange(len(mirror)) == form.main, 1.0, -1.0)
            family, missed = fit_ridges(states, mirror, c.units, c.steps, c.decay, c.seed)
            laws = EnergyLaws(**common, family=family)
        details = {**form.details, "states": len(states.tau), "trained_to": missed}
        return FittedMetaModel(laws, details)

    def load(self, record: LawRecord) -> DesignLaws:
        """Return the model of a record."""
        if record.values["activation"] == "relu":
            return TorqueLaws.from_record(record)
        return EnergyLaws.from_record(record)
