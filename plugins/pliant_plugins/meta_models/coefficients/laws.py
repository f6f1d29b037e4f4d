"""The fitted meta-model of coefficients: parameters in, law out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.interfaces.meta_model import DesignLaws
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant.records.solved import Parameter
from pliant_plugins.meta_models.coefficients.study import law_of_targets
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.networks import Layers

KIND = "coefficients"
# The doubt where all starts agree, as a share of their typical disagreement at the solved designs.
AGREED = 1.0


@dataclass(frozen=True, eq=False)
class CoefficientLaws(DesignLaws):
    """Targets of a law as a network of the design's parameters.

    Attributes:
        form: of the laws; for the study's own it gives the box and the scale of the parameters alone.
        network: scaled parameters (n, d) → targets (n, q).
        study: whether the targets are the study's coefficients.
        usual: typical disagreement of the starts at the solved designs.
    """

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]
    form: CommonForm
    network: Layers
    study: bool
    usual: float

    def law(self, values: Array) -> JointLaw:
        """The law of one design (d,), stable in its box."""
        values = np.asarray(values, float)
        targets = self.network(self.form.parameters(values[None]))[0]
        if not self.study:
            return self.form.law(values, targets)
        form = self.form
        return law_of_targets(
            targets, form.domain(values), form.actuation_name, form.axes[form.main], form.joint
        )

    def doubt(self, values: Array) -> Array:
        """(m,) how far the random starts disagree, relative to that at the solved designs; 1 for a single start."""
        apart = disagreement(self.network, self.form.parameters(np.asarray(values, float)))
        found: Array = (
            np.sqrt(AGREED**2 + (apart / self.usual) ** 2) if self.usual > 0 else np.ones(len(apart))
        )
        return found

    def record(self) -> LawRecord:
        """Form and weights as numbers."""
        form, arrays = self.form.record()
        network, weights = self.network.record()
        values = {
            "names": list(self.names),
            "fixed": dict(self.fixed),
            "form": form,
            "network": network,
            "study": self.study,
            "usual": self.usual,
        }
        return LawRecord(KIND, values, {**arrays, **weights, "box": self.box})

    @staticmethod
    def of_record(record: LawRecord) -> CoefficientLaws:
        """The model of a record; both give laws of the same bits."""
        values, arrays = record.values, record.arrays
        return CoefficientLaws(
            tuple(values["names"]),
            np.asarray(arrays["box"], float),
            dict(values["fixed"]),
            CommonForm.of_record(values["form"], arrays),
            Layers.of_record(values["network"], arrays),
            bool(values["study"]),
            float(values["usual"]),
        )


def disagreement(network: Layers, places: Array) -> Array:
    """(m,) deviation of the starts' answers about their mean, all scaled targets together."""
    answers = network.each(places) / network.scale
    found: Array = np.sqrt(answers.var(axis=0).sum(axis=1))
    return found
