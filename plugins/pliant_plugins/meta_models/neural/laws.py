"""The fitted neural meta-model of an energy: a design's law is a neural law whose units hold the design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pliant.interfaces.meta_model import DesignLaws
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant.records.solved import Parameter
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.neural.ridges import RidgeFamily
from pliant_plugins.meta_models.neural.states import energies_of, top_of
from pliant_plugins.surrogates.neural.law import NeuralLaw

KIND = "neural"
# Of a law's stiffness at rest, what must be left all over its box.
MARGIN = 0.02
TRIES = 3


@dataclass(frozen=True, eq=False)
class EnergyLaws(DesignLaws):
    """Laws of one network of an energy.

    Attributes:
        form: gives the scales of the parameters, reaches and energy, and the box of each design.
        family: the network.
    """

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]
    form: CommonForm
    family: RidgeFamily

    def law(self, values: Array) -> JointLaw:
        """The law of one design (d,); it is stiffened evenly where it would not be stable in its box."""
        form, rows = self.form, np.asarray(values, float)[None]
        reach = form.reach(rows)[0]
        network = self.family.network(
            form.parameters(rows)[0], float(energies_of(form, rows)[0]), top_of(form), reach
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
        form, arrays = self.form.record()
        values = {"names": list(self.names), "fixed": dict(self.fixed), "form": form, "activation": "smooth"}
        return LawRecord(KIND, values, {**arrays, **self.family.arrays(), "box": self.box})

    @staticmethod
    def of_record(record: LawRecord) -> EnergyLaws:
        """The model of a record; both give laws of the same bits."""
        values, arrays = record.values, record.arrays
        return EnergyLaws(
            tuple(values["names"]),
            np.asarray(arrays["box"], float),
            dict(values["fixed"]),
            CommonForm.of_record(values["form"], arrays),
            RidgeFamily.of_arrays(arrays),
        )
