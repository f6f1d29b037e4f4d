"""PPO with the ask-and-tell interface: an episode is one candidate, an update follows each full batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_plugins.native import load_torch
from pliant_ppo.config import PpoConfig
from pliant_ppo.episode import (
    context_index,
    context_observations,
    decode_action,
    encode_action,
)
from pliant_ppo.policy import write_policy
from pliant_search.optimizer import Optimizer, OptimizerCapabilities, Space, Trial

load_torch("optimizer 'ppo' needs torch")  # before stable-baselines3, which would load it after ngsolve

from stable_baselines3.common.logger import TensorBoardOutputFormat  # noqa: E402

from pliant_ppo.learner import Learner, Sample, packed, unpacked  # noqa: E402

LARGEST = 1e15  # objective; the square of a larger one overflows in the network's single precision
ALL_BROKEN = 1.0  # violation from which on `Rewards` sees no difference
# Margin of a candidate without an objective below the worst known one, as a share of the known range.
MARGIN = 0.1
# Keys that act in an update of the policy.
OF_UPDATES = ("learning_rate", "batch_size", "epochs", "clip_range", "entropy", "value_weight")
# Keys of rewards that follow a step; an episode has one.
OF_LATER_STEPS = ("gamma", "gae_lambda")
# Not written by stable-baselines3 either: it is the step itself.
UNWRITTEN = ("train/n_updates",)


class Rewards:
    """Minus the objective.

    A candidate that failed, or whose objective is NaN, gets the worst reward known so far less a margin: a tenth of
    the range of the known ones, 1 where that is 0 or nothing is known. One that breaks constraints loses up to
    another margin, by how far it breaks them (1 or more: all of it).

    They are not normalised by running statistics: PPO normalises the advantages of every batch, and on a problem of
    two conditions (3000 candidates, three seeds) objectives a thousand times as large, or ten higher in one condition,
    were learned as well without.
    """

    def __init__(self) -> None:
        self._worst, self._best = np.inf, -np.inf

    def compute(self, objectives: Array, violations: Array) -> Array:
        """Return the rewards (n,) of a batch; objectives of refused or failed candidates are NaN."""
        rewards = -np.asarray(objectives, float)
        known = rewards[np.isfinite(rewards)]
        if len(known):
            self._worst = min(self._worst, float(known.min()))
            self._best = max(self._best, float(known.max()))
        worst, span = (self._worst, self._best - self._worst) if self._best >= self._worst else (0.0, 0.0)
        lowest = worst - (MARGIN * span or 1.0) * (1.0 + np.clip(violations, 0.0, 1.0))
        return np.where(np.isfinite(rewards), rewards, lowest)

    def state(self) -> dict[str, Any]:
        """Return the state for `restore`, as JSON values."""
        return {"known": [self._worst, self._best] if self._best >= self._worst else None}

    def restore(self, state: dict[str, Any]) -> None:
        """Restore the known objectives from `state`."""
        self._worst, self._best = state["known"] or (np.inf, -np.inf)


class UpdateLog:
    """One row of named numbers per update, each at the number of candidates that it had learned from."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._rows: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, step: int, logged: Mapping[str, float]) -> None:
        """Append a row; every row has the names of the first."""
        if not self._names:
            self._names = tuple(sorted(logged))
        self._rows.append((float(step), *(float(logged.get(name, np.nan)) for name in self._names)))

    def write(self, folder: Path) -> list[Path]:
        """Write all rows as a TensorBoard event file that replaces existing ones."""
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("events.out.tfevents.*"):
            old.unlink()
        stream = LiveLog(folder)
        for step, *values in self._rows:
            stream.add(int(step), dict(zip(self._names, values, strict=True)))
        stream.close()
        return sorted(folder.glob("events.out.tfevents.*"))

    def state(self) -> dict[str, Any]:
        """Return the state for `restore`, as JSON values."""
        return {"names": list(self._names), "rows": packed(np.array(self._rows, float))}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the log from `state`."""
        self._names = tuple(state["names"])
        self._rows = [tuple(row) for row in unpacked(state["rows"]).tolist()]


class LiveLog:
    """A TensorBoard event file that grows while the policy learns, by stable-baselines3's writer."""

    def __init__(self, folder: Path) -> None:
        try:
            self._stream = TensorBoardOutputFormat(str(folder))
        except OSError as error:
            raise UserError(f"optimizer.tensorboard: '{folder}' cannot be written ({error}).") from None

    def add(self, step: int, logged: Mapping[str, float]) -> None:
        """Write the numbers of one update."""
        excluded = {name: ("tensorboard",) if name in UNWRITTEN else () for name in logged}
        self._stream.write(dict(logged), excluded, step)

    def close(self) -> None:
        """Write pending rows and close the file."""
        self._stream.close()


class Ppo(Optimizer):
    """See `PpoConfig`.

    Candidates fill batches in the order of their numbers; PPO learns from a batch when all its results are known.
    Candidates of the next batch that are requested before that are drawn by the current policy, and PPO weighs them by
    the density with which they were drawn.
    """

    capabilities: ClassVar[OptimizerCapabilities] = OptimizerCapabilities(contexts=True)

    def __init__(self, config: PpoConfig) -> None:
        super().__init__(config)
        self.ppo = config
        self._live: LiveLog | None = None

    @property
    def batch(self) -> int:
        """Return the number of candidates of one update."""
        return self.ppo.environments * self.ppo.n_steps

    def remarks(self, candidates: int | None) -> Sequence[str]:
        """Name the keys without effect: those of later steps where stated, all of updates where none takes place."""
        said = [
            f"optimizer.{name} has no effect: an episode of a search has one step, and no reward follows it."
            for name in OF_LATER_STEPS
            if name in self.ppo.model_fields_set
        ]
        if candidates is not None and candidates < self.batch:
            keys = ", ".join(f"optimizer.{name}" for name in OF_UPDATES)
            said.append(
                f"ppo updates its policy after every {self.batch} candidates and the search has {candidates}: the "
                f"policy learns nothing, and {keys} have no effect. Raise search.budget, or lower optimizer.n_steps."
            )
        return said

    def start(self, space: Space, seed: int) -> None:
        """Begin with a policy whose mean is the space's start, or the middle of every range."""
        if space.objectives != 1:
            raise UserError(
                f"optimizer 'ppo' has one objective and the search has {space.objectives}; "
                "write them as one expression, or take optimizer 'optuna'."
            )
        self._space, self._seed = space, seed
        self._seen = context_observations(space.contexts)
        self._learner = Learner(
            self.ppo,
            self._seen.shape[1],
            len(space.variables),
            seed,
            encode_action(space.start, space.variables),
        )
        self._rewards, self._log = Rewards(), UpdateLog()
        self._asked = 0
        self._waiting: dict[int, Sample] = {}  # drawn and not learned from
        self._told: dict[int, tuple[float, float]] = {}  # objective, NaN for failed ones, and violation

    def ask(self, count: int) -> Sequence[Trial]:
        """Return up to `count` draws, at most the free places of the batch."""
        room = self.batch - self._asked % self.batch
        numbers = range(self._asked, self._asked + min(count, room))
        self._asked = numbers.stop
        drawn = []
        for number in numbers:
            context = context_index(number, len(self._space.contexts), self._seed)
            sample = self._waiting[number] = self._learner.sample(self._seen[context], number)
            drawn.append(Trial(number, decode_action(sample.action, self._space.variables), context))
        return drawn

    def tell(self, trials: Sequence[Trial]) -> None:
        """Store results; learn from each batch that they complete."""
        for trial in trials:
            if trial.number not in self._waiting or trial.number in self._told:
                raise UserError(f"candidate {trial.number} is not waiting for a result.")
            good = trial.violation <= 0 and abs(trial.objective) <= LARGEST
            objective = float(trial.objective) if good else float("nan")
            violation = float(trial.violation) if np.isfinite(trial.violation) else ALL_BROKEN
            self._told[trial.number] = objective, violation
        while all(number in self._told for number in self._next_batch):
            self._learn()

    @property
    def _next_batch(self) -> range:
        first = self._learner.updates * self.batch
        return range(first, first + self.batch)

    def _learn(self) -> None:
        numbers = self._next_batch
        rewards = self._rewards.compute(*np.array([self._told.pop(number) for number in numbers]).T)
        logged = self._learner.learn([self._waiting.pop(number) for number in numbers], rewards)
        self._log.add(numbers.stop, logged)
        if isinstance(self.ppo.tensorboard, str):
            self._live = self._live or LiveLog(Path(self.ppo.tensorboard))
            self._live.add(numbers.stop, logged)

    def recommend(self) -> Sequence[Trial]:
        """Return the policy's mean design in each context; their numbers are −1."""
        means = [decode_action(self._learner.mean(seen), self._space.variables) for seen in self._seen]
        return [Trial(-1, values, context) for context, values in enumerate(means)]

    def export(self, folder: Path) -> Sequence[Path]:
        """Write `policy.zip` (stable-baselines3's), `policy.json` (the meaning of its numbers) and `tensorboard/`."""
        files = write_policy(folder, self._learner.model, self._space, self._seen)
        if self.ppo.tensorboard is not False and len(self._log):
            files += self._log.write(folder / "tensorboard")
        return files

    def state(self) -> Mapping[str, Any]:
        """Return networks, Adam, pending candidates, results, statistics and log."""
        return {
            "space": self._space.as_json(),
            "seed": self._seed,
            "asked": self._asked,
            "learner": self._learner.state(),
            "waiting": [[n, packed(s.action), s.value, s.log_prob] for n, s in self._waiting.items()],
            "told": [
                [n, None if np.isnan(objective) else objective, v] for n, (objective, v) in self._told.items()
            ],
            "rewards": self._rewards.state(),
            "log": self._log.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue with the same draws, bit for bit on the same machine."""
        self.start(Space.from_json(state["space"]), state["seed"])
        self._asked = state["asked"]
        self._learner.restore(state["learner"])
        for number, action, value, log_prob in state["waiting"]:
            seen = self._seen[context_index(number, len(self._space.contexts), self._seed)]
            self._waiting[number] = Sample(seen, unpacked(action), value, log_prob)
        self._told = {n: (float("nan") if value is None else value, v) for n, value, v in state["told"]}
        self._rewards.restore(state["rewards"])
        self._log.restore(state["log"])
