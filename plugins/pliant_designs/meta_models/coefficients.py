"""`coefficients`: a network from the design's parameters to the coefficients of its law, as in the study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import TRUSTED
from pliant.records.law import Domain, JointKind, JointLaw, LawRecord
from pliant_designs.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant_designs.meta_models.common_form import FormLaws
from pliant_designs.meta_models.common_form_fit import fit_common_form
from pliant_designs.meta_models.config import CoefficientsConfig
from pliant_designs.meta_models.networks import Layers, fit_layers
from pliant_designs.records import SolvedDesigns
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw, study_law
from pliant_plugins.surrogates.polynomial.study import fit_study

# Of a law's stiffness at rest, what must be left in every corner of its box.
MARGIN = 0.02


def study_targets(designs: SolvedDesigns) -> Array:
    """Return (n, 4) k_n, m_a, b, m_e of each design, by least squares of the efforts.

    Raises `UserError` for several axes or actuations and for a design whose states do not determine them.
    """
    first = designs.data[0]
    if len(first.axes) > 1:
        raise UserError(
            f"form 'study' is the law of one axis, and the joint of these designs has {len(first.axes)} "
            f"({', '.join(first.axes)}); use form 'adaptive'."
        )
    if len(first.actuations) > 1:
        raise UserError(
            f"form 'study' is the law of one actuation, and these designs are driven by {first.actuation_name}; use "
            "form 'adaptive'."
        )
    found = []
    for data in designs.data:
        table = data.axis(first.main_axis)
        law = fit_study(table.rows(np.isin(table.status, TRUSTED) & (table.role == "fit")), odd=False)
        found.append([law.k_n, law.m_a, law.b_a - law.b_e, law.m_e])
    return np.array(found)


def law_from_targets(
    targets: Array, domain: Domain, actuation_name: str, axis: str, joint: JointKind
) -> PolynomialLaw:
    """Return the law of coefficients (4,), its stiffness raised where it would not be stable in the box."""
    k_n, m_a, b, m_e = (float(value) for value in targets)
    # ∂τ/∂u = m_a p + b − m_e u is largest in a corner of the box.
    corners = m_a * domain.actuation[:, None] + b - m_e * domain.deformation[0]
    stable = b - max(float(corners.max()) + MARGIN * abs(b), 0.0)
    coefficients = StudyCoefficients(k_n=k_n, m_a=m_a, b_a=0.0, m_e=m_e, b_e=-stable)
    return study_law(coefficients, False, domain, actuation_name, axis, joint)


KIND = "coefficients"
# The doubt where all starts agree, as a share of their typical disagreement at the solved designs.
AGREED = 1.0


@dataclass(frozen=True, eq=False)
class CoefficientLaws(FormLaws):
    """Targets of a law as a network of the design's parameters.

    For the study's own form the common form gives the box and the scale of the parameters alone.

    Attributes:
        network: scaled parameters (n, d) → targets (n, q).
        study: whether the targets are the study's coefficients.
        usual: typical disagreement of the starts at the solved designs.
    """

    network: Layers
    study: bool
    usual: float

    def law(self, values: Array) -> JointLaw:
        """Return the law of one design (d,), stable in its box."""
        values = np.asarray(values, float)
        targets = self.network(self.form.parameters(values[None]))[0]
        if not self.study:
            return self.form.law(values, targets)
        form = self.form
        return law_from_targets(
            targets, form.domain(values), form.actuation_name, form.axes[form.main], form.joint
        )

    def doubt(self, values: Array) -> Array:
        """Return the (m,) disagreement of the random starts, relative to the solved designs; 1 for a single start."""
        apart = disagreement(self.network, self.form.parameters(np.asarray(values, float)))
        return np.sqrt(AGREED**2 + (apart / self.usual) ** 2) if self.usual > 0 else np.ones(len(apart))

    def record(self) -> LawRecord:
        """Form and weights as numbers."""
        network, weights = self.network.record()
        return self.build_record(KIND, weights, network=network, study=self.study, usual=self.usual)

    @staticmethod
    def from_record(record: LawRecord) -> CoefficientLaws:
        """Return the model of a record; laws are identical bit for bit."""
        values = record.values
        network = Layers.from_record(values["network"], record.arrays)
        own: dict[str, Any] = {
            "network": network,
            "study": bool(values["study"]),
            "usual": float(values["usual"]),
        }
        return CoefficientLaws(**FormLaws.shared_fields(record), **own)


def disagreement(network: Layers, places: Array) -> Array:
    """Return (m,) deviations of the starts about their mean, all scaled targets together."""
    answers = network.each(places) / network.scale
    return np.sqrt(answers.var(axis=0).sum(axis=1))


HIDDEN = (64, 64, 32)


class Coefficients(MetaModel):
    """Networks 64-64-32 (Yao, Howard, Maiolino, doi 10.1002/aisy.70406); torch trains them, numpy evaluates."""

    several_actuations = True
    config: CoefficientsConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Fit targets of all designs, then the network, with errors weighted by their influence on the effort."""
        enough_designs(designs, self.fewest, KIND)
        study = self.config.form == "study"
        own = study_targets(designs) if study else None
        form, targets = fit_common_form(designs)
        if own is None:
            scale = np.full(targets.shape[1], float(targets.std(axis=0).max()))
        else:
            targets = own
            scale = np.abs(targets).mean(axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        places = form.parameters(designs.values)
        c = self.config
        network = fit_layers(places, targets, HIDDEN, c.activation, c.starts, c.decay, scale, c.seed)
        usual = float(np.sqrt(np.mean(disagreement(network, places) ** 2)))
        missed = (network(places) - targets) / scale
        laws = CoefficientLaws(designs.names, designs.box, dict(designs.fixed), form, network, study, usual)
        details = {**form.details, "trained_to": float(np.sqrt(np.mean(np.sum(missed**2, axis=1))))}
        return FittedMetaModel(laws, details)

    def load(self, record: LawRecord) -> DesignLaws:
        """Return the model of a record."""
        return CoefficientLaws.from_record(record)
