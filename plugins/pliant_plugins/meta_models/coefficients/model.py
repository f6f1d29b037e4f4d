"""`coefficients`: a network from the design's parameters to the coefficients of its law, as in the study."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant.records.law import LawRecord
from pliant.records.solved import SolvedDesigns
from pliant_plugins.meta_models.coefficients.config import CoefficientsConfig
from pliant_plugins.meta_models.coefficients.laws import KIND, CoefficientLaws, disagreement
from pliant_plugins.meta_models.coefficients.study import study_targets
from pliant_plugins.meta_models.common_form import CommonForm
from pliant_plugins.meta_models.network_training import fit_layers

HIDDEN = (64, 64, 32)


class Coefficients(MetaModel):
    """Networks 64-64-32 (Yao, Howard, Maiolino, doi 10.1002/aisy.70406); torch trains them, numpy evaluates."""

    config: CoefficientsConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Targets of all designs, then the network; a target's error counts by what it does to the effort."""
        enough_designs(designs, self.fewest, KIND)
        study = self.config.form == "study"
        own = study_targets(designs) if study else None
        form, targets = CommonForm.fit(designs)
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
        """The model of a record."""
        return CoefficientLaws.of_record(record)
