"""Optuna as ask and tell."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from optuna.trial import FrozenTrial

from pliant.interfaces.optimizer import Optimizer, OptimizerCapabilities, Space, Trial
from pliant_plugins.optimizers.optuna import trials
from pliant_plugins.optimizers.optuna.board import Board
from pliant_plugins.optimizers.optuna.config import OptunaConfig
from pliant_plugins.optimizers.optuna.memory import Memory
from pliant_plugins.optimizers.optuna.samplers import (
    DEFAULT_POPULATION,
    UNCONSTRAINED,
    require_usable,
    sampler_for,
)

EXPORT = "optuna.log"
Learned = tuple[int, tuple[float, ...] | None, float]  # number, objectives, violation


class Optuna(Optimizer):
    """Trials in memory for the sampler, and a copy of what was told in a storage for people."""

    capabilities = OptimizerCapabilities(several_objectives=True)
    config: OptunaConfig
    _memory: Memory
    _told: list[Learned]
    _board: Board | None

    @property
    def batch(self) -> int:
        """The population of nsga2 and cmaes; else 8, enough to fill workers without much guessing."""
        if self.config.sampler == "nsga2":
            return self.config.population or DEFAULT_POPULATION
        return self.config.population or 8

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
            self._board = Board.new(self.config.storage, self.config.study, self._owner, space.objectives)

    def ask(self, count: int) -> Sequence[Trial]:
        """`count` candidates; those that are not told yet count as bad ones to tpe (a constant liar)."""
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
        """All trials, as JSON values."""
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
        """Continue; the storage gets the trials that it lacks, and none twice.

        Raises:
            UserError: the storage holds another search's study of that name.
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
            self._board = Board.again(self.config.storage, name, self._owner, space.objectives)
            self._board.write(self._shown(*told) for told in self._told)

    def export(self, folder: Path) -> Sequence[Path]:
        """`optuna.log`, a journal that `optuna-dashboard` opens; nothing where the config names a storage.

        A journal takes a thousand trials a second or so, an SQLite file some dozens.
        """
        if self.config.storage is not None:
            return ()
        path = folder / EXPORT
        path.unlink(missing_ok=True)
        board = Board.new(f"journal:{path}", self.config.study, self._owner, self._space.objectives)
        board.write(self._shown(*told) for told in self._told)
        return (path,)

    def _begin(self, space: Space, seed: int) -> None:
        self._space, self._seed, self._asked = space, seed, 0
        self._ranges = trials.distributions(space)
        self._memory = Memory(space, constraints=self.config.sampler not in UNCONSTRAINED)
        self._told = []
        self._board = None

    def _shown(self, number: int, objectives: tuple[float, ...] | None, violation: float) -> FrozenTrial:
        return trials.shown(number, self._memory.values(number), self._ranges, objectives, violation)
