"""The neural surrogate: states in, the law of a small network and honest errors out."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import LawRecord
from pliant_plugins.surrogates.neural.config import NeuralConfig
from pliant_plugins.surrogates.neural.fit import Trained, fit_network
from pliant_plugins.surrogates.neural.law import KIND, NeuralLaw
from pliant_plugins.surrogates.neural.system import States
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.states import effort_ranges, split
from pliant_plugins.surrogates.polynomial.system import joint_of
from pliant_plugins.surrogates.records import require_kind


class Neural(Surrogate):
    """Laws τ = −∂Π/∂u of a network Π(p, u), of one axis or of all that a joint has (`NeuralLaw`).

    torch trains the network (`training`); laws are loaded and evaluated by numpy. `FitReport.details` has the history
    of the training, the residuals, and for one axis the errors of the study's form on the same states.
    """

    couples = True
    config: NeuralConfig

    def __init__(self, config: NeuralConfig) -> None:
        super().__init__(config)

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `polynomial.states`).

        Raises `UserError`, in one sentence, for too few states, non-finite numbers and contradictions.
        """
        states = split(data, "a neural law")
        fit = states.fit
        found = fit_network(
            States(
                np.column_stack([fit.actuation, fit.angle_rad]),
                fit.moment_n_m[:, None],
                fit.dmoment_dp[:, None],
                fit.dmoment_du[:, None, None],
            ),
            states.domain,
            effort_ranges(fit),
            self.config.units,
            self.config.seed,
            axes=(data.axis,),
            joint=joint_of(data),
            actuation_name=data.actuation_name,
        )
        return FittedLaw(found.law, scoring.report(found.law, states, self._details(found)))

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Fit all axes of a joint together, with what moves one axis turning another; one axis as `fit` does.

        Raises `UserError` as `polynomial.states.split` does.
        """
        if len(data.axes) == 1:
            return self.fit(data.axis(data.axes[0]))
        states = split(data, "a neural law")
        fit = states.fit
        found = fit_network(
            States(np.column_stack([fit.actuation, fit.deformation]), fit.tau, fit.dtau_dp, fit.dtau_du),
            states.domain,
            states.ranges,
            self.config.units,
            self.config.seed,
            axes=data.axes,
            joint=data.joint,
            actuation_name=data.actuation_name,
        )
        report = scoring.report_axes(found.law, states, self._details(found), found.largest_slope)
        return FittedLaw(found.law, report)

    def load(self, record: LawRecord) -> NeuralLaw:
        """The law of a record that `NeuralLaw.record` wrote."""
        require_kind(record, KIND)
        return NeuralLaw.of_record(record)

    def _details(self, found: Trained) -> dict[str, Any]:
        return {
            "form": KIND,
            "units": self.config.units,
            "parameters": found.law.network.n_parameters,
            "decay": found.history[found.chosen]["decay"],
            "training": [{**step, "chosen": k == found.chosen} for k, step in enumerate(found.history)],
            "largest_slope": found.largest_slope,
            "stable": found.largest_slope < 0,
        }
