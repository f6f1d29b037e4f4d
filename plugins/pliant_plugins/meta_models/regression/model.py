"""`regression`: a common form whose numbers are regressed on the design's parameters."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant.records.design import Array
from pliant.records.law import LawRecord
from pliant.records.solved import SolvedDesigns
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.common_form_scales import ParameterMap
from pliant_plugins.meta_models.regression.closed_forms import fit_kernel_ridge, fit_polynomial
from pliant_plugins.meta_models.regression.config import RegressionConfig
from pliant_plugins.meta_models.regression.gaussian_process import GaussianProcesses
from pliant_plugins.meta_models.regression.laws import KIND, RegressionLaws


class Regression(MetaModel):
    """Gaussian processes, kernel ridge or polynomials, whichever misses the efforts of left-out designs least."""

    config: RegressionConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """The common form of all designs, then every regressor asked for; `auto` takes the best of them."""
        enough_designs(designs, self.fewest, KIND)
        form, targets = CommonForm.fit(designs)
        inputs = ParameterMap.of(designs.values, self.config.inputs == "logarithm")
        places = inputs(designs.values)
        processes = GaussianProcesses.fit(places, targets)
        others = {
            "kernel_ridge": fit_kernel_ridge(places, targets),
            "polynomial": fit_polynomial(places, targets),
        }
        errors = {"gaussian_process": _size(processes.left_out())}
        errors |= {name: _size(missed) for name, (_, missed) in others.items()}
        chosen: str = self.config.regressor
        if chosen == "auto":
            chosen = min(errors, key=lambda name: errors[name])
        smoother = others[chosen][0] if chosen in others else None
        laws = RegressionLaws(
            designs.names, designs.box, dict(designs.fixed), form, inputs, processes, smoother
        )
        return FittedMetaModel(laws, {**form.details, "regressor": chosen, "left_out": errors})

    def load(self, record: LawRecord) -> DesignLaws:
        """The model of a record."""
        return RegressionLaws.of_record(record)


def _size(missed: Array) -> float:
    """Root mean square of the effort's error, as a share of its mean size, over designs left out."""
    return float(np.sqrt(np.mean(np.sum(missed**2, axis=1))))
