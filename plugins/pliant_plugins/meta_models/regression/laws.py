"""The fitted regression meta-model: parameters in, law out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.interfaces.meta_model import DesignLaws
from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant.records.solved import Parameter
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.common_form_scales import ParameterMap
from pliant_plugins.meta_models.regression.closed_forms import LinearSmoother
from pliant_plugins.meta_models.regression.gaussian_process import GaussianProcesses

KIND = "regression"
PROCESS = ("places", "targets", "centre", "scale", "widths", "sizes")


@dataclass(frozen=True, eq=False)
class RegressionLaws(DesignLaws):
    """Targets of a common form as functions of the design's parameters.

    Attributes:
        form: what the targets mean.
        inputs: the map to the regressor's scaled parameters.
        processes: Gaussian processes of the targets: the mean where no other regressor is given, always the doubt.
        smoother: the regressor that gives the mean instead.
    """

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]
    form: CommonForm
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
        form_values, arrays = self.form.record()
        arrays["box"] = self.box
        arrays |= {f"inputs_{name}": getattr(self.inputs, name) for name in ("low", "high", "logarithmic")}
        arrays |= {f"process_{name}": getattr(self.processes, name) for name in (*PROCESS, "rough")}
        values: dict[str, Any] = {"names": list(self.names), "fixed": dict(self.fixed), "form": form_values}
        if self.smoother is not None:
            values["smoother"] = {"kind": self.smoother.kind, "width": self.smoother.width}
            for name in ("exponents", "places", "centre", "weights"):
                arrays[f"smoother_{name}"] = getattr(self.smoother, name)
        return LawRecord(KIND, values, arrays)

    @staticmethod
    def of_record(record: LawRecord) -> RegressionLaws:
        """The model of a record; both give laws of the same bits."""
        values, arrays = record.values, record.arrays

        def read(name: str) -> Array:
            return np.asarray(arrays[name], float)

        smoother = None
        if "smoother" in values:
            smoother = LinearSmoother(
                str(values["smoother"]["kind"]),
                float(values["smoother"]["width"]),
                np.asarray(arrays["smoother_exponents"], np.int64),
                *(read(f"smoother_{name}") for name in ("places", "centre", "weights")),
            )
        process: dict[str, Any] = {name: read(f"process_{name}") for name in PROCESS}
        logarithmic = np.asarray(arrays["inputs_logarithmic"], bool)
        return RegressionLaws(
            tuple(values["names"]),
            read("box"),
            dict(values["fixed"]),
            CommonForm.of_record(values["form"], arrays),
            ParameterMap(read("inputs_low"), read("inputs_high"), logarithmic),
            GaussianProcesses(**process, rough=np.asarray(arrays["process_rough"], bool)),
            smoother,
        )
