"""What a study may say about Optuna."""

from __future__ import annotations

import re
from typing import Literal

from pydantic import Field, field_validator, model_validator

from pliant.interfaces.optimizer import OptimizerConfig

STORAGE = re.compile(r"sqlite:///.+|journal:.+")
HAS_POPULATION = ("nsga2", "cmaes")
HAS_STARTUP = ("tpe", "gp")


class OptunaConfig(OptimizerConfig):
    """Optuna: learns from few candidates, and knows several objectives.

    What tpe and gp take to propose grows with the trials: with 13 variables tpe needs 14 ms of CPU for a candidate
    after 500 trials and 44 ms after 2000. Beyond that `cmaes` is the better choice.
    """

    kind: Literal["optuna"] = "optuna"
    sampler: Literal["tpe", "cmaes", "nsga2", "gp", "random", "qmc"] = Field(
        default="tpe",
        description="tpe: densities of good and bad candidates; nsga2: evolution, for several objectives; gp: a "
        "Gaussian process, for some hundreds of candidates (needs torch); cmaes: Optuna's own CMA-ES (needs the "
        "package cmaes); random; qmc: a Sobol sequence",
    )
    population: int | None = Field(
        default=None, ge=4, le=10_000, description="candidates of a generation of nsga2 (50) or cmaes"
    )
    startup: int = Field(
        default=10, ge=1, le=100_000, description="random candidates before tpe or gp begin to learn"
    )
    storage: str | None = Field(
        default=None,
        description="where every trial is written as it is told, for optuna-dashboard: sqlite:///search.db or "
        "journal:search.log, relative to the current folder",
    )
    study: str = Field(
        default="pliant",
        pattern=r"^\S(.*\S)?$",
        description="name in the storage; where it is taken, the search becomes pliant-2, pliant-3, …",
    )

    @field_validator("storage")
    @classmethod
    def _known_storage(cls, storage: str | None) -> str | None:
        if storage is not None and not STORAGE.fullmatch(storage):
            raise ValueError(f"'{storage}' is no storage: write sqlite:///search.db or journal:search.log")
        return storage

    @model_validator(mode="after")
    def _options_of_the_sampler(self) -> OptunaConfig:
        if self.population is not None and self.sampler not in HAS_POPULATION:
            raise ValueError(f"'population' is for {' and '.join(HAS_POPULATION)}, not for {self.sampler}")
        if "startup" in self.model_fields_set and self.sampler not in HAS_STARTUP and self.startup != 10:
            raise ValueError(f"'startup' is for {' and '.join(HAS_STARTUP)}, not for {self.sampler}")
        return self
