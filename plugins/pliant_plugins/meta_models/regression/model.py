"""`regression`: a common form whose numbers are regressed on the design's parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.interfaces.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant.records.solved import SolvedDesigns
from pliant_plugins.meta_models.common_form import FormLaws
from pliant_plugins.meta_models.common_form_fit import fit_common_form
from pliant_plugins.meta_models.common_form_scales import ParameterMap
from pliant_plugins.meta_models.regression.closed_forms import (
    LinearSmoother,
    fit_kernel_ridge,
    fit_polynomial,
)
from pliant_plugins.meta_models.regression.config import RegressionConfig
from pliant_plugins.meta_models.regression.gaussian_process import GaussianProcesses

KIND = "regression"
# Arrays of a record, and those that are no floating-point numbers.
INPUTS = ("low", "high", "logarithmic")
PROCESS = ("places", "targets", "centre", "scale", "widths", "sizes", "rough")
SMOOTHER = ("exponents", "places", "centre", "weights")
KINDS = {"logarithmic": bool, "rough": bool, "exponents": np.int64}


@dataclass(frozen=True, eq=False)
class RegressionLaws(FormLaws):
    """Targets of a common form as functions of the design's parameters.

    Attributes:
        inputs: the map to the regressor's scaled parameters.
        processes: Gaussian processes of the targets: the mean where no other regressor is given, always the doubt.
        smoother: the regressor that gives the mean instead.
    """

    inputs: ParameterMap
    processes: GaussianProcesses
    smoother: LinearSmoother | None = None

    def targets(self, values: Array) -> Array:
        """(m, q) targets of designs (m, d)."""
        places = self.inputs(np.asarray(values, float))
        return self.processes.mean(places) if self.smoother is None else self.smoother.mean(places)

    def law(self, values: Array) -> JointLaw:
        """The law of one design (d,), stable in its box."""
        return self.form.law(values, self.targets(np.asarray(values, float)[None])[0])

    def doubt(self, values: Array) -> Array:
        """(m,) deviation of the effort that the processes expect, as a share of its mean size."""
        variance = self.processes.variance(self.inputs(np.asarray(values, float)))
        found: Array = np.sqrt(variance.sum(axis=1))
        return found

    def gain(self, candidates: Array, over: Array) -> Array:
        """(m,) expected share of the mean squared error over `over` (k, d) that solving each would remove."""
        return self.processes.gain(
            self.inputs(np.asarray(candidates, float)), self.inputs(np.asarray(over, float))
        )

    def record(self) -> LawRecord:
        """Form, inputs, processes and regressor as numbers."""
        parts: dict[str, tuple[Any, tuple[str, ...]]] = {
            "inputs": (self.inputs, INPUTS),
            "process": (self.processes, PROCESS),
        }
        values: dict[str, Any] = {}
        if self.smoother is not None:
            values["smoother"] = {"kind": self.smoother.kind, "width": self.smoother.width}
            parts["smoother"] = (self.smoother, SMOOTHER)
        arrays = {
            f"{part}_{name}": getattr(owner, name) for part, (owner, names) in parts.items() for name in names
        }
        return self.record_of(KIND, arrays, **values)

    @staticmethod
    def of_record(record: LawRecord) -> RegressionLaws:
        """The model of a record; both give laws of the same bits."""

        def read(part: str, names: tuple[str, ...]) -> dict[str, Any]:
            return {
                name: np.asarray(record.arrays[f"{part}_{name}"], KINDS.get(name, float)) for name in names
            }

        smoother = None
        if (told := record.values.get("smoother")) is not None:
            smoother = LinearSmoother(str(told["kind"]), float(told["width"]), **read("smoother", SMOOTHER))
        return RegressionLaws(
            **FormLaws.shared_fields(record),
            inputs=ParameterMap(**read("inputs", INPUTS)),
            processes=GaussianProcesses(**read("process", PROCESS)),
            smoother=smoother,
        )


class Regression(MetaModel):
    """Gaussian processes, kernel ridge or polynomials, whichever misses the efforts of left-out designs least."""

    config: RegressionConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """The common form of all designs, then every regressor asked for; `auto` takes the best of them."""
        enough_designs(designs, self.fewest, KIND)
        form, targets = fit_common_form(designs)
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
