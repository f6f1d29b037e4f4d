"""Configuration of CMA-ES and Optuna. No heavy library is imported here."""

from __future__ import annotations

import re
from typing import Literal

from pydantic import Field, field_validator, model_validator

from pliant_search.optimizer import OptimizerConfig


class CmaesConfig(OptimizerConfig):
    """Covariance matrix adaptation: for one objective and up to some dozens of variables, from some hundreds of
    candidates on.

    A run that has converged before the budget is spent is followed by another one, from a random place.
    """

    kind: Literal["cmaes"] = "cmaes"
    sigma: float = Field(
        default=0.3,
        gt=0,
        le=1,
        description="standard deviation at first, as a share of each variable's range; 0.1 at most of a robust search "
        "that begins at the nominal design",
    )
    population: int | None = Field(
        default=None, ge=4, le=10_000, description="candidates of a generation; by default 4 + ⌊3 ln n⌋"
    )
    restarts: int = Field(
        default=0,
        ge=0,
        le=12,
        description="how many of the runs that follow double the population (IPOP); later ones keep it",
    )


STORAGE = re.compile(r"sqlite:///.+|journal:.+")
HAS_POPULATION = ("nsga2", "cmaes")
HAS_STARTUP = ("tpe", "gp")


class OptunaConfig(OptimizerConfig):
    """Optuna: learns from few candidates, and supports several objectives.

    What tpe and gp take to propose grows with the trials: with 13 variables tpe needs 14 ms of CPU for a candidate
    after 500 trials and 44 ms after 2000. Beyond that `cmaes` is the better choice.
    """

    kind: Literal["optuna"] = "optuna"
    sampler: Literal["tpe", "cmaes", "nsga2", "gp", "random", "qmc"] = Field(
        default="tpe",
        description="tpe: densities of good and bad candidates; nsga2: evolution, for several objectives; gp: a "
        "Gaussian process, for some hundreds of candidates (needs torch); cmaes: Optuna's own CMA-ES (needs the "
        "package cmaes); random; qmc: a Sobol sequence. cmaes and qmc draw choices at random",
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
    def _check_sampler_options(self) -> OptunaConfig:
        if self.population is not None and self.sampler not in HAS_POPULATION:
            raise ValueError(f"'population' is for {' and '.join(HAS_POPULATION)}, not for {self.sampler}")
        if "startup" in self.model_fields_set and self.sampler not in HAS_STARTUP and self.startup != 10:
            raise ValueError(f"'startup' is for {' and '.join(HAS_STARTUP)}, not for {self.sampler}")
        return self
