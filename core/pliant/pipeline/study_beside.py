"""The published study's form, fitted to the same states as another law, so that the two can stand side by side."""

from __future__ import annotations

from pliant.errors import PliantError
from pliant.interfaces.surrogate import Surrogate
from pliant.pipeline.workbench import Workbench
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw

KIND, FORM = "polynomial", "study"


def study_law_beside(bench: Workbench, data: ModuleData) -> JointLaw | None:
    """The law of the study's form, or None where it cannot be fitted or the polynomial surrogate is not installed."""
    try:
        component = bench.registry.get("surrogate", KIND)
        config = component.config_model().model_validate({"kind": KIND, "form": FORM})
        surrogate: Surrogate = component.build(config)
        return surrogate.fit_module(data).law
    except (PliantError, ValueError):
        return None
