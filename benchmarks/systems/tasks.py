"""Tasks of the bed: which sets of which systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from benchmarks.systems.sets import SystemSet, SystemSpec, make_set
from benchmarks.systems.truth import FailedTruthError, Truth

from pliant.store.store import write_atomically

# Whatever changes the measured sets: a change there makes other sets, with other names.
TRUTH_FILES = (
    *(f"{name}_equations.py" for name in ("signal", "force", "number")),
    *(f"{name}.py" for name in ("shapes", "form_table", "plausible", "protocol", "robots")),
    *(f"{name}.py" for name in ("simulation", "truth", "sets")),
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
    """The number of sets of each group, over all systems; cheap systems get more of them.

    Attributes:
        robots: systems; those that are installed by default.
        kinds: effects, `none`, or unknown forms to include; empty means all.
        seeds: sets per effect; `unknown`: sets per unknown form; `clean`: clean sets.
        draw: makes other sets of the same seeds; of a sealed run the digest of the code that is judged.
        share: part of the sets that is done, the first ones in an order that mixes systems and effects.
    """

    robots: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    split: Split = "calibration"
    seeds: int = 2
    unknown: int = 3
    clean: int = 32
    draw: str = ""
    share: float = 1.0

    def tasks(self) -> list[Any]:
        """Return all tasks, or the first `share` of them."""
        counts = {
            **dict.fromkeys(KINDS, self.seeds),
            **dict.fromkeys(UNKNOWN, self.unknown),
            CLEAN: self.clean,
        }
        wanted = {kind: n for kind, n in counts.items() if not self.kinds or kind in self.kinds}
        found = [
            SystemTask(_group(kind), spec=SystemSpec(kind, seed, robot, self.split, self.draw))
            for kind, robots in spread(wanted, self.robots).items()
            for seed, robot in enumerate(robots)
        ]
        order = np.random.default_rng(len(found)).permutation(len(found))
        return [found[k] for k in order][: max(1, round(self.share * len(found)))]


def _group(kind: str) -> str:
    return "clean" if kind == CLEAN else "unknown" if kind in UNKNOWN else "effect"


def spread(counts: Mapping[str, int], robots: Sequence[str]) -> dict[str, list[str]]:
    """Return for each kind the systems of its sets: the least used by its weight, kinds of few systems first."""
    used, found = dict.fromkeys(robots, 0), {}
    there = {kind: [robot for robot in robots if kind in kinds_of(robot, (kind,))] for kind in counts}
    for kind in sorted(counts, key=lambda one: len(there[one])):
        mine: list[str] = []
        for _ in range(counts[kind] if there[kind] else 0):
            chosen = min(there[kind], key=lambda one: (used[one] + 3 * mine.count(one)) / ROBOTS[one].weight)
            used[chosen] += 1
            mine.append(chosen)
        found[kind] = mine
    return {kind: found[kind] for kind in counts}


@cache
def kinds_of(robot: str, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kinds that have a place in a system and show there; without an effect every system is one."""
    truth = Truth(ROBOTS[robot], (), 0)
    wanted = [kind for kind in kinds if kind not in ROBOTS[robot].without]
    return tuple(kind for kind in wanted if kind == CLEAN or truth.names(EVERY[kind].place))


def small_plan() -> SystemPlan:
    """Return a few sets of the smallest system."""
    there = tuple(one.name for one in present((SMALLEST,)))
    return SystemPlan(there, SMALL_KINDS, seeds=1, unknown=1, clean=1)


def make(task: SystemTask, name: str, folder: Path, key: bytes) -> None:
    """Write NAME.csv, NAME.xml, NAME_study.yaml and NAME.sealed, unless they exist.

    Raises:
        FailedTruthError: no system shows the effect with a plausible strength.
    """
    sealed = folder / f"{name}{seal.SUFFIX}"
    if sealed.exists():  # written last, so the set is complete
        return
    folder.mkdir(parents=True, exist_ok=True)
    made = _reached(task.spec, name)
    for ending, text in ((".csv", made.csv), (".xml", made.model), ("_study.yaml", made.study)):
        write_atomically(folder / f"{name}{ending}", text)
    write_atomically(sealed, seal.seal(made.label, key))


def _reached(spec: SystemSpec, name: str) -> SystemSet:
    """Return the set, or that of another system, the cheapest first, where the effect shows."""
    others = sorted(present(), key=lambda one: -one.weight)
    named = [
        one.name for one in others if one.name != spec.robot and spec.kind in kinds_of(one.name, (spec.kind,))
    ]
    draw, refused = f"{spec.draw} instead of {spec.robot}", []
    for one in (spec, *(replace(spec, robot=robot, draw=draw) for robot in named)):
        try:
            return make_set(one, name)
        except FailedTruthError as error:
            refused.append(f"{one.robot}: {error}")
    raise FailedTruthError("; ".join(refused))
