"""Configuration of CMA-ES, Optuna and PPO. No heavy library is imported here."""

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


class PpoConfig(OptimizerConfig):
    """A policy (condition → design) learned by PPO, each candidate being an episode of one step.

    Needs thousands of candidates; use it if one policy shall serve many conditions. The defaults are those of
    the gripper co-design by Yao, Howard, Maiolino, Adv. Intell. Syst. 2026, doi 10.1002/aisy.70406, `epochs` and `net`
    those of stable-baselines3, which the paper leaves open.
    """

    kind: Literal["ppo"] = "ppo"
    learning_rate: float = Field(
        default=1e-4,
        gt=0,
        le=1,
        description="of Adam; the study's is low: some thousands of candidates need 1e-3 or more",
    )
    environments: int = Field(
        default=4,
        ge=1,
        le=1024,
        description="candidates that stand side by side; with n_steps the size of a batch",
    )
    n_steps: int = Field(
        default=8, ge=1, le=65536, description="candidates of each environment between two updates"
    )
    batch_size: int = Field(default=32, ge=2, le=1_000_000, description="candidates of one gradient step")
    epochs: int = Field(default=10, ge=1, le=1000, description="passes over a batch in one update")
    gamma: float = Field(
        default=0.9, ge=0, le=1, description="discount; without effect in episodes of one step"
    )
    gae_lambda: float = Field(
        default=0.9, ge=0, le=1, description="of the advantages; without effect in episodes of one step"
    )
    clip_range: float = Field(default=0.3, gt=0, le=10, description="how far an update may change the policy")
    entropy: float = Field(
        default=0.03, ge=0, le=10, description="weight of the entropy: more keeps the policy wide"
    )
    value_weight: float = Field(default=0.3, ge=0, le=10, description="weight of the value function's error")
    net: tuple[int, ...] = Field(
        default=(64, 64), max_length=8, description="hidden units of the policy and of the value function"
    )
    tensorboard: bool | str = Field(
        default=True,
        description="event files with the result; a folder: there too, while it learns; false: none",
    )

    @model_validator(mode="after")
    def _sizes(self) -> PpoConfig:
        if self.environments * self.n_steps < 2:
            raise ValueError("environments × n_steps is 1; an update needs at least 2 candidates")
        if any(not 1 <= units <= 4096 for units in self.net):
            raise ValueError(f"net is {list(self.net)}; each layer has 1 to 4096 units")
        return self
