"""Optuna with the ask-and-tell interface: its samplers, and its storages for a live dashboard."""

from __future__ import annotations

import importlib.util
import itertools
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.exceptions import DuplicatedStudyError
from optuna.samplers import BaseSampler
from optuna.storages import BaseStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial

from pliant.errors import MissingDependencyError, UserError
from pliant_search.optimizer import Optimizer, OptimizerCapabilities, Space, Trial
from pliant_search.optimizers.config import OptunaConfig
from pliant_search.optimizers.optuna.trials import CANDIDATE, TrialMemory, distributions, quiet, shown

EXPORT = "optuna.log"
OWNER = "pliant_search"  # user attribute of a study: which search writes it
# Sampler → modules that Optuna does not bring along, and how they are installed.
NEEDS = {
    "gp": (("scipy", "torch"), "pip install 'pliant[neural]'"),
    "cmaes": (("cmaes",), "pip install cmaes, or use optimizer: {kind: cmaes}"),
    "qmc": (("scipy",), "pip install scipy"),
}
DEFAULT_POPULATION = 50  # Optuna's own, of NSGA-II
UNCONSTRAINED = ("cmaes",)  # samplers without support of constraints
WITHOUT_CHOICES = ("cmaes", "qmc")  # samplers of numbers alone
Learned = tuple[int, tuple[float, ...] | None, float]  # number, objectives, violation


def require_usable(config: OptunaConfig, space: Space) -> None:
    """Raise what keeps the sampler from searching the space.

    Raises:
        MissingDependencyError: a package that the sampler needs is not installed.
        UserError: the sampler supports one objective only.
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
    """Build the sampler that proposes one candidate.

    Every candidate has a new sampler, seeded by the search's seed and the candidate's number. All other state is read
    from the trials, so that a restored search continues exactly as an uninterrupted one. A Sobol sequence (qmc) is
    scrambled by the search's seed; its index is counted in the trials.
    """
    drawn = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
    samplers, startup = optuna.samplers, config.startup

    def alone() -> dict[str, Any]:
        independent = samplers.RandomSampler(seed=drawn)
        return {"independent_sampler": independent, "warn_independent_sampling": False}

    makers: dict[str, Callable[[], BaseSampler]] = {
        "tpe": lambda: samplers.TPESampler(n_startup_trials=startup, seed=drawn, constant_liar=True),
        "nsga2": lambda: samplers.NSGAIISampler(
            population_size=config.population or DEFAULT_POPULATION, seed=drawn
        ),
        "gp": lambda: samplers.GPSampler(n_startup_trials=startup, seed=drawn),
        "random": lambda: samplers.RandomSampler(seed=drawn),
        "qmc": lambda: samplers.QMCSampler(scramble=True, seed=seed % 2**32, **alone()),
        "cmaes": lambda: samplers.CmaEsSampler(seed=drawn, popsize=config.population, **alone()),
    }
    with quiet():
        return makers[config.sampler]()


def opened(place: str) -> BaseStorage:
    """Open the storage; create its file if it does not exist.

    Raises:
        UserError: its folder is missing, or the file is not an Optuna storage.
    """
    kind, _, path = place.partition("///") if place.startswith("sqlite:") else place.partition(":")
    if not Path(path).parent.is_dir():
        raise UserError(
            f"optimizer.storage: the folder '{Path(path).parent}' of '{place}' does not exist; make it first."
        )
    try:
        with quiet():
            if kind == "sqlite:":
                return RDBStorage(place)
            return optuna.storages.JournalStorage(JournalFileBackend(path))
    except Exception as error:  # SQLAlchemy, alembic and json each have their own
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(
            f"optimizer.storage: '{place}' cannot be used as Optuna's storage: {cause}"
        ) from error


class Board:
    """Finished trials in a storage that optuna-dashboard and the `optuna` command read, each candidate once. The
    sampler works on trials in memory and never reads the storage, so a slow disk changes no proposal.
    """

    def __init__(self, place: str, name: str, owner: str, objectives: int, again: bool = False) -> None:
        """Create a study of this name, or of `name-2`, `name-3`, … if it is taken: every search has its own.

        With `again` load that of a continued search; create it if the storage no longer has it.

        Raises:
            UserError: another search has written the continued study; or the storage cannot be used.
        """
        storage, directions = opened(place), ["minimize"] * objectives
        with quiet():
            if again and name in optuna.get_all_study_names(storage):
                self._study = optuna.load_study(study_name=name, storage=storage)
                if self._study.user_attrs.get(OWNER) != owner:
                    raise UserError(
                        f"The search cannot go on in '{place}': its study '{name}' belongs to another search. "
                        "Put the former file back, or move this one away and it is written anew."
                    )
            else:
                for free in itertools.chain([name], (f"{name}-{k}" for k in itertools.count(2))):
                    with suppress(DuplicatedStudyError):
                        self._study = optuna.create_study(
                            storage=storage, study_name=free, directions=directions
                        )
                        break
                self._study.set_user_attr(OWNER, owner)
        trials = self._study.get_trials(deepcopy=False)
        self._written = {trial.user_attrs.get(CANDIDATE) for trial in trials}

    @property
    def name(self) -> str:
        """The study's name in its storage."""
        return self._study.study_name

    def write(self, trials: Iterable[FrozenTrial]) -> None:
        """Add the trials of candidates that are not there yet."""
        with quiet():
            for trial in trials:
                number = trial.user_attrs[CANDIDATE]
                if number not in self._written:
                    self._study.add_trial(trial)
                    self._written.add(number)


class Optuna(Optimizer):
    """Optuna's samplers on trials in memory, with a copy of finished trials in a storage for viewing."""

    capabilities = OptimizerCapabilities(several_objectives=True)
    config: OptunaConfig
    _memory: TrialMemory
    _told: list[Learned]
    _board: Board | None

    @property
    def batch(self) -> int:
        """The population of nsga2 and cmaes; else 8, enough to fill workers without much guessing."""
        if self.config.sampler == "nsga2":
            return self.config.population or DEFAULT_POPULATION
        return self.config.population or 8

    def space_remarks(self, space: Space) -> Sequence[str]:
        """Return a sentence on choices that the sampler draws at random."""
        choices = [v.name for v in space.variables if v.type == "categorical" and len(v.choices) > 1]
        if not choices or self.config.sampler not in WITHOUT_CHOICES:
            return ()
        instead = (
            "sampler: tpe" if self.config.sampler == "qmc" else "sampler: tpe, or optimizer: {kind: cmaes}"
        )
        return (
            f"Optuna's sampler '{self.config.sampler}' learns no choices: {', '.join(choices)} "
            f"{'is' if len(choices) == 1 else 'are'} drawn at random in every candidate. Use {instead}.",
        )

    def start(self, space: Space, seed: int) -> None:
        """Begin at the guess, which is the first candidate.

        Raises:
            MissingDependencyError, UserError: the sampler cannot be used for this space, or the storage cannot.
        """
        require_usable(self.config, space)
        self._begin(space, seed)
        if space.start:
            self._memory.guess(space.start)
        self._owner = uuid.uuid4().hex
        if self.config.storage is not None:
            self._board = Board(self.config.storage, self.config.study, self._owner, space.objectives)

    def ask(self, count: int) -> Sequence[Trial]:
        """Return `count` candidates; tpe counts those without results as bad ones (a constant liar)."""
        asked = []
        for _ in range(count):
            number, values = self._memory.ask(sampler_for(self.config, self._seed, self._asked))
            self._asked += 1
            asked.append(Trial(number, values))
        return asked

    def tell(self, trials: Sequence[Trial]) -> None:
        """Learn, and write to the storage."""
        fresh = []
        for trial in sorted(trials, key=lambda one: one.number):
            if self._memory.is_open(trial.number):
                fresh.append((trial.number, *self._memory.tell(trial)))
        self._told += fresh
        if self._board is not None:
            self._board.write(self._shown(*told) for told in fresh)

    def state(self) -> Mapping[str, Any]:
        """Return all trials as JSON values."""
        return {
            "space": self._space.as_json(),
            "seed": self._seed,
            "asked": self._asked,
            "memory": self._memory.state(),
            "told": [[n, objectives and list(objectives), v] for n, objectives, v in self._told],
            "owner": self._owner,
            "study": self._board.name if self._board is not None else None,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state; missing trials are added to the storage, none twice.

        Raises:
            UserError: the storage has another search's study of that name.
        """
        space = Space.from_json(state["space"])
        require_usable(self.config, space)
        self._begin(space, int(state["seed"]))
        self._memory.restore(state["memory"])
        self._asked, self._owner = int(state["asked"]), str(state["owner"])
        self._told = [
            (int(n), objectives and tuple(objectives), float(v)) for n, objectives, v in state["told"]
        ]
        if self.config.storage is not None:
            name = state["study"] or self.config.study
            self._board = Board(self.config.storage, name, self._owner, space.objectives, again=True)
            self._board.write(self._shown(*told) for told in self._told)

    def export(self, folder: Path) -> Sequence[Path]:
        """Write `optuna.log`, a journal that `optuna-dashboard` opens; nothing if the config names a storage.

        A journal takes a thousand trials a second or so, an SQLite file some dozens.
        """
        if self.config.storage is not None:
            return ()
        path = folder / EXPORT
        path.unlink(missing_ok=True)
        board = Board(f"journal:{path}", self.config.study, self._owner, self._space.objectives)
        board.write(self._shown(*told) for told in self._told)
        return (path,)

    def _begin(self, space: Space, seed: int) -> None:
        self._space, self._seed, self._asked = space, seed, 0
        self._ranges = distributions(space)
        self._memory = TrialMemory(space, constraints=self.config.sampler not in UNCONSTRAINED)
        self._told = []
        self._board = None

    def _shown(self, number: int, objectives: tuple[float, ...] | None, violation: float) -> FrozenTrial:
        return shown(number, self._memory.values(number), self._ranges, objectives, violation)
