"""Tasks of the bed: which sets of which systems."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.evidence import ledger, seal
from benchmarks.evidence.form_table import Split
from benchmarks.evidence.tasks import Task, digest
from benchmarks.evidence.truths import CLEAN
from benchmarks.systems.form_table import EVERY, KINDS, UNKNOWN
from benchmarks.systems.robots import ROBOTS, present
from benchmarks.systems.sets import SystemSpec, make_set
from benchmarks.systems.truth import Truth

from pliant.store.store import write_atomically

# Whatever changes the measured sets: a change there makes other sets, with other names.
TRUTH_FILES = (
    *(f"{name}_equations.py" for name in ("signal", "force", "number")),
    *(f"{name}.py" for name in ("shapes", "form_table", "protocol", "robots", "simulation", "truth", "sets")),
    "soft_finger.xml",
)
# Code that determines a diagnosis of a MuJoCo model.
CODE = (
    *(part for part in ledger.CODE if part.startswith("core/")),
    "plugins/pliant_systems",
    "plugins/pliant_mjcf",
    "plugins/pliant_plugins/effects",
)
# Of the small plan, and of a run for a first look: the smallest system.
SMALLEST = "reacher"
SMALL_KINDS = (CLEAN, "viscous_damping", "actuation_gain", "sensor_lag", "torque_ripple")


@cache
def truth_digest() -> str:
    """Return digest of the code that makes the sets."""
    return digest(Path(__file__).parent / name for name in TRUTH_FILES)


@dataclass(frozen=True)
class SystemTask(Task):
    """One question about one set of a system."""

    spec: SystemSpec = field()  # type: ignore[assignment]

    @property
    def _text(self) -> bytes:
        return f"{self.group} {self.mode} {self.spec} {truth_digest()}".encode()


@dataclass(frozen=True)
class SystemPlan:
    """The number of sets of each group, for every system.

    Attributes:
        robots: systems; those that are installed by default.
        kinds: effects, `none`, or unknown forms to include; empty means all.
        seeds: sets per effect and per unknown form; `clean`: clean sets for each seed.
        draw: makes other sets of the same seeds; of a sealed run the digest of the code that is judged.
        share: part of the sets that is done, the first ones in an order that mixes systems and effects.
    """

    robots: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    split: Split = "calibration"
    seeds: int = 2
    clean: int = 3
    draw: str = ""
    share: float = 1.0

    def tasks(self) -> list[Any]:
        """Return all tasks, or the first `share` of them."""
        found: list[Any] = []
        for seed in range(self.seeds):
            mine = [task for robot in self.robots for task in self._of(robot, seed)]
            order = np.random.default_rng([seed, len(mine)]).permutation(len(mine))
            found += [mine[k] for k in order]
        kept = [task for task in found if not self.kinds or task.spec.kind in self.kinds]
        return kept[: max(1, round(self.share * len(kept)))]

    def _of(self, robot: str, seed: int) -> list[SystemTask]:
        named = [("effect", kind) for kind in kinds_of(robot, tuple(KINDS))]
        named += [("unknown", kind) for kind in kinds_of(robot, tuple(UNKNOWN))]
        tasks = [SystemTask(g, spec=SystemSpec(k, seed, robot, self.split, self.draw)) for g, k in named]
        numbers = range(seed * self.clean, (seed + 1) * self.clean)
        clean = [SystemSpec(CLEAN, number, robot, self.split, self.draw) for number in numbers]
        return [*tasks, *(SystemTask("clean", spec=spec) for spec in clean)]


@cache
def kinds_of(robot: str, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kinds that have a place in a system and show there."""
    truth = Truth(ROBOTS[robot], (), 0)
    wanted = [kind for kind in kinds if kind not in ROBOTS[robot].without]
    return tuple(kind for kind in wanted if truth.names(EVERY[kind].place))


def small_plan() -> SystemPlan:
    """Return a few sets of the smallest system."""
    there = tuple(one.name for one in present((SMALLEST,)))
    return SystemPlan(there, SMALL_KINDS, seeds=1, clean=1)


def make(task: SystemTask, name: str, folder: Path, key: bytes) -> None:
    """Write NAME.csv, NAME.xml, NAME_study.yaml and NAME.sealed, unless they exist."""
    sealed = folder / f"{name}{seal.SUFFIX}"
    if sealed.exists():  # written last, so the set is complete
        return
    folder.mkdir(parents=True, exist_ok=True)
    made = make_set(task.spec, name)
    for ending, text in ((".csv", made.csv), (".xml", made.model), ("_study.yaml", made.study)):
        write_atomically(folder / f"{name}{ending}", text)
    write_atomically(sealed, seal.seal(made.label, key))
