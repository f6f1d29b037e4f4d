"""Optuna's samplers by their names in a study.

A sampler is made anew for every candidate, seeded by the search's seed and the candidate's number. What else it knows
it reads from the trials, so that a restored search goes on exactly as it would have.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np
import optuna
from optuna.samplers import BaseSampler

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.optimizer import Space
from pliant_plugins.optimizers.optuna.config import OptunaConfig
from pliant_plugins.optimizers.optuna.quiet import quiet

# Sampler → modules that Optuna does not bring along, and how they are installed.
NEEDS = {
    "gp": (("scipy", "torch"), "pip install 'pliant[neural]'"),
    "cmaes": (("cmaes",), "pip install cmaes, or use optimizer: {kind: cmaes}"),
    "qmc": (("scipy",), "pip install scipy"),
}
DEFAULT_POPULATION = 50  # Optuna's own, of NSGA-II
UNCONSTRAINED = ("cmaes",)  # samplers that know no constraints


def require_usable(config: OptunaConfig, space: Space) -> None:
    """Raise what keeps the sampler from searching the space.

    Raises:
        MissingDependencyError: a package that the sampler needs is not installed.
        UserError: the sampler knows one objective only.
    """
    modules, install = NEEDS.get(config.sampler, ((), ""))
    missing = [module for module in modules if importlib.util.find_spec(module) is None]
    if missing:
        raise MissingDependencyError(
            f"optimizer 'optuna' with sampler '{config.sampler}' needs {missing[0]}: {install}."
        )
    if space.objectives > 1 and config.sampler == "cmaes":
        raise UserError(
            f"Optuna's sampler 'cmaes' knows one objective, the search has {space.objectives}; "
            "use sampler: nsga2, tpe or gp."
        )


def sampler_for(config: OptunaConfig, seed: int, number: int) -> BaseSampler:
    """The sampler that proposes one candidate."""
    drawn = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
    with quiet():
        return _MAKERS[config.sampler](config, drawn, seed)


def _tpe(config: OptunaConfig, drawn: int, seed: int) -> BaseSampler:
    return optuna.samplers.TPESampler(n_startup_trials=config.startup, seed=drawn, constant_liar=True)


def _nsga2(config: OptunaConfig, drawn: int, seed: int) -> BaseSampler:
    population = config.population or DEFAULT_POPULATION
    return optuna.samplers.NSGAIISampler(population_size=population, seed=drawn)


def _gp(config: OptunaConfig, drawn: int, seed: int) -> BaseSampler:
    return optuna.samplers.GPSampler(n_startup_trials=config.startup, seed=drawn)


def _random(config: OptunaConfig, drawn: int, seed: int) -> BaseSampler:
    return optuna.samplers.RandomSampler(seed=drawn)


def _qmc(config: OptunaConfig, drawn: int, seed: int) -> BaseSampler:
    """One sequence: scrambled by the search's seed, its place counted in the trials."""
    alone = optuna.samplers.RandomSampler(seed=drawn)
    return optuna.samplers.QMCSampler(
        scramble=True, seed=seed % 2**32, independent_sampler=alone, warn_independent_sampling=False
    )


def _cmaes(config: OptunaConfig, drawn: int, seed: int) -> BaseSampler:
    alone = optuna.samplers.RandomSampler(seed=drawn)
    return optuna.samplers.CmaEsSampler(
        seed=drawn, popsize=config.population, independent_sampler=alone, warn_independent_sampling=False
    )


_MAKERS: dict[str, Callable[[OptunaConfig, int, int], BaseSampler]] = {
    "tpe": _tpe,
    "nsga2": _nsga2,
    "gp": _gp,
    "random": _random,
    "qmc": _qmc,
    "cmaes": _cmaes,
}
