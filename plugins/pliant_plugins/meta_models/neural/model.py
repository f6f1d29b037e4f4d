"""`neural`: one network of design, actuation and deformation."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.interfaces.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant.records.law import LawRecord
from pliant.records.solved import SolvedDesigns
from pliant_plugins.meta_models.common_form_fit import fit_common_form
from pliant_plugins.meta_models.neural.config import NeuralMetaConfig
from pliant_plugins.meta_models.neural.laws import KIND, EnergyLaws, TorqueLaws, fit_torques
from pliant_plugins.meta_models.neural.states import ScaledStates
from pliant_plugins.meta_models.neural.training import fit_ridges


class NeuralMetaModel(MetaModel):
    """An energy over all designs from efforts and slopes, or the study's torques (doi 10.1002/aisy.70406)."""

    config: NeuralMetaConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Scales and boxes of the common form, then the network; torch trains it, numpy evaluates it."""
        enough_designs(designs, self.fewest, KIND)
        form, _ = fit_common_form(designs)
        states = ScaledStates.of(designs, form)
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
        """The model of a record."""
        if record.values["activation"] == "relu":
            return TorqueLaws.of_record(record)
        return EnergyLaws.of_record(record)
