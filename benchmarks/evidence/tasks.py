"""Tasks of the bench: the sets and the questions about each."""

from __future__ import annotations

import hashlib
import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from benchmarks.evidence import rod_truth
from benchmarks.evidence.bench_errors import MISTAKES
from benchmarks.evidence.form_table import Split
from benchmarks.evidence.law_shapes import SIZES
from benchmarks.evidence.sets import SetSpec
from benchmarks.evidence.truths import (
    CLEAN,
    KINDS,
    PAIRED,
    PARAMETERS,
    PLUS,
    UNKNOWN,
    Engine,
    kind_robots,
)

# Poor sets that get two more runs: the proposed ones, or any of the menu.
PLANS = ("suggested", "random")
Mode = Literal["diagnose", "improve", "suggested", "random"]
# In turn. Thresholds are chosen on one engine, and judged on all of them.
ENGINES: dict[tuple[Split, bool], tuple[Engine, ...]] = {
    ("judged", True): ("functional", "mujoco", "explicit"),
    ("judged", False): ("functional", "mujoco"),
    ("calibration", True): ("functional",),
    ("calibration", False): ("functional",),
}
# Every this many-th set of a kind is made of its other robot.
OTHER_EVERY = 5
WEAK_SNR = (0.5, 1.0)
# Sets of plans are others than those of the poor protocol.
PLAN_SEED = 1000
SHOWN = tuple(
    kind
    for kind in KINDS
    if kind_robots(kind)[0] == "joint" and kind not in ("thermal_softening", "leak", "inertia")
)
# Kinds that depend on initial states and sampling.
QUICK = ("viscous_damping", "supply_lag", "friction_hysteresis", "viscoelastic", "sensor_lag")
QUICK_PROTOCOLS = ("midway", "coarse")
NAMED = (*KINDS, CLEAN, *UNKNOWN)
# Clean sets and unknown effects are of every robot in turn.
TURNS = ("joint", "four", "finger", "chain")


# Whatever changes the measured sets: a change there makes other sets, with other names.
TRUTH_FILES = (
    "robots skeleton protocols forms form_table sensors truths law_shapes bench_errors "
    "functional_truth mujoco_truth explicit_truth rod_truth sets"
)


@cache
def truth_digest() -> str:
    """Return digest of the code that makes the sets."""
    here = Path(__file__).parent
    return digest(here / f"{name}.py" for name in TRUTH_FILES.split())


def digest(files: Iterable[Path]) -> str:
    """Return digest of the files' contents, in the order given."""
    found = hashlib.sha256()
    for file in files:
        found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()[:16]


@dataclass(frozen=True)
class Task:
    """One question about one set. `group` says in which table the answer counts."""

    group: str
    spec: SetSpec
    mode: Mode = "diagnose"

    def secret_id(self, key: bytes) -> str:
        """Return a name that does not reveal the kind, reproducible with the same key and the same truths."""
        return hashlib.blake2b(self._text, key=key, digest_size=8).hexdigest()

    @property
    def public_id(self) -> str:
        """Return the name of the task in the stored answers, whose labels are opened."""
        return hashlib.blake2b(self._text, digest_size=8).hexdigest()

    @property
    def _text(self) -> bytes:
        return f"{self.group} {self.mode} {self.spec} {truth_digest()}".encode()


Bed = Literal["exact", "law_off"]
BEDS: tuple[Bed, Bed] = ("exact", "law_off")
# Of sets with two unknown effects that listed ones imitate by cancelling: others than those of `unknown`.
MISSED, MISSED_SEED = ("tilted_sensor", "detent"), 2000
# Where a recording begins while its pressure rises, what was before is not known, and no interval could hold.
INTERVAL_PROTOCOL = "rich_open"
# Errors of the bench's records, by group: the kind, and the protocol that shows it.
MISTAKE_GROUPS = {
    "payload": ("wrong_payload", "payload"),
    "clock": ("wrong_clock", "rich"),
    "gravity": ("wrong_gravity", "rich"),
}


@dataclass(frozen=True)
class Plan:
    """The number of sets of each group.

    Attributes:
        bed: of laws that are the truth's own but for 0.4 %, or of laws that are off by a random share and shape.
        kinds: effects, `none`, or unknown forms to include; empty means all.
        seeds: sets per effect; `clean`: clean sets; `unknown`: sets per unknown form; `pairs`: sets with two effects.
        weak: sets per effect at each of `WEAK_SNR`; `poor`, `noload`: sets per effect and clean ones under these
            protocols.
        quick: sets per quick effect, and clean ones, whose recordings begin in mid-transient, and of coarse ones.
        rods: sets per effect of a rod, and thrice as many clean ones; judged only, so that no threshold sees a rod.
        missed: sets per effect of `MISSED`.
        payload, clock, gravity: sets whose record is wrong.
        interval: sets per effect of `PARAMETERS` that have the candidate's own equation.
        plan: sets for each way of adding runs to a poor set; `improve`: sets per effect that go through `improve`.
        other_every: every this many-th set of a kind is made of its other robot.
        draw: makes other sets of the same seeds; of a sealed run the digest of the code that is judged.
        share: part of every group that is done, from the first seeds on.
    """

    kinds: tuple[str, ...] = ()
    protocol: str = "rich"
    split: Split = "calibration"
    seeds: int = 20
    clean: int = 320
    unknown: int = 8
    pairs: int = 60
    weak: int = 1
    poor: int = 2
    noload: int = 1
    quick: int = 8
    rods: int = 5
    plan: int = 50
    improve: int = 2
    other_every: int = OTHER_EVERY
    draw: str = ""
    share: float = 1.0
    bed: Bed = "exact"
    missed: int = 0
    payload: int = 0
    clock: int = 0
    gravity: int = 0
    interval: int = 0

    def tasks(self) -> list[Task]:
        """Return all tasks, or the first `share` of them, in an order in which any prefix represents every group."""
        usual = {kind: kind_robots(kind)[0] for kind in (*KINDS, CLEAN)}
        every = [Task("effect", self._set(kind, seed)) for kind in KINDS for seed in range(self.seeds)]
        every += [Task("clean", self._turn(CLEAN, seed)) for seed in range(self.clean)]
        for kind in UNKNOWN:
            every += [Task("unknown", self._turn(kind, seed)) for seed in range(self.unknown)]
        for kind, snr, seed in itertools.product(KINDS, WEAK_SNR, range(self.weak)):
            every.append(Task("weak", self._set(kind, seed, usual[kind], snr=snr)))
        for name, count in (("poor", self.poor), ("rich_noload", self.noload)):
            for kind, robot in usual.items():
                every += [Task(name, self._set(kind, seed, robot, name)) for seed in range(count)]
        for name, kind, seed in itertools.product(QUICK_PROTOCOLS, (*QUICK, CLEAN), range(self.quick)):
            robot = usual[kind] if seed % 2 == 0 else kind_robots(kind)[1]
            every.append(Task(name, self._set(kind, seed, robot, name)))
        for kind in (*rod_truth.CHANGES, CLEAN) if self.split == "judged" else ():
            for seed in range(self.rods * (3 if kind == CLEAN else 1)):
                spec = SetSpec(kind, seed, "rod", "rod", self.protocol, self.split, draw=self.draw)
                every.append(Task("rod", spec))
        for seed in range(self.plan):
            # Effects in turn, of those that a poor recording of one joint shows.
            spec = self._set(SHOWN[seed % len(SHOWN)], PLAN_SEED + seed, "joint", "poor")
            every += [Task("plan", spec, mode) for mode in PLANS]
        for kind in KINDS:
            sets = (self._set(kind, seed, usual[kind]) for seed in range(self.improve))
            every += [Task("improve", spec, "improve") for spec in sets]
        for seed, kind in enumerate(effect_pairs(self.split, self.pairs)):
            every.append(Task("pair", self._set(kind, seed, "joint")))
        every += self._mistaken()
        for kind in MISSED:
            seeds = range(MISSED_SEED, MISSED_SEED + self.missed)
            every += [Task("missed", self._turn(kind, seed)) for seed in seeds]
        for kind in PARAMETERS:
            sets = (self._set(kind, seed, "joint", INTERVAL_PROTOCOL) for seed in range(self.interval))
            every += [Task("interval", replace(spec, candidates=True)) for spec in sets]
        if self.bed == "law_off":
            every = [replace(task, spec=with_law_off(task.spec)) for task in every]
        kept = [task for task in every if not self.kinds or task.spec.kind in self.kinds]
        mixed = _interleaved(kept)
        return mixed[: max(1, round(self.share * len(mixed)))]

    def _mistaken(self) -> Iterator[Task]:
        """Yield sets with a wrong record, robots in turn."""
        for group, (kind, name) in MISTAKE_GROUPS.items():
            for seed in range(getattr(self, group)):
                yield Task(group, replace(self._turn(kind, seed), protocol=name))

    def _turn(self, kind: str, seed: int) -> SetSpec:
        """Return a set of the next robot, and of the next engine among those of that robot."""
        name = TURNS[seed % len(TURNS)]
        engines = ENGINES[self.split, name == "joint"]
        engine = engines[seed // len(TURNS) % len(engines)]
        return SetSpec(kind, seed, engine, name, self.protocol, self.split, draw=self.draw)

    def _set(
        self, kind: str, seed: int, robot: str = "", protocol: str = "", snr: float | None = None
    ) -> SetSpec:
        other = self.other_every > 0 and seed % self.other_every == self.other_every - 1
        usual, second = kind_robots(kind.split(PLUS)[0])
        name = robot or (second if other else usual)
        engines = ENGINES[self.split, name == "joint"]
        engine = engines[(seed + seed // self.other_every if self.other_every else seed) % len(engines)]
        return SetSpec(kind, seed, engine, name, protocol or self.protocol, self.split, snr, self.draw)


def with_law_off(spec: SetSpec) -> SetSpec:
    """Return the set with an inexact law: size and shape of its error are drawn from the set's name."""
    name = hashlib.sha256(f"law {spec}".encode()).digest()
    rng = np.random.default_rng(int.from_bytes(name[:16]))
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    return replace(spec, law_error=round(size, 5), law_seed=int(rng.integers(2**31)))


def _interleaved(tasks: Sequence[Task]) -> list[Task]:
    """Mix groups evenly: any prefix has the same share of each group's sets, kinds in turn.

    Within a seed the kinds come in an order of the seed's own; both ways of adding runs to a set stand side by side.
    """
    ranks: dict[int, dict[str, int]] = {}
    for seed in {task.spec.seed for task in tasks}:
        order = np.random.default_rng(seed).permutation(len(NAMED))
        ranks[seed] = {kind: int(order[i]) for i, kind in enumerate(NAMED)}

    def within(task: Task) -> tuple[int, int]:
        return task.spec.seed, ranks[task.spec.seed].get(task.spec.kind, 0)

    groups: dict[tuple[str, str], list[Task]] = {}
    for task in tasks:
        groups.setdefault((task.group, task.mode), []).append(task)
    placed = [
        ((rank + 0.5) / len(mine), task)
        for mine in groups.values()
        for rank, task in enumerate(sorted(mine, key=within))
    ]
    return [task for _, task in sorted(placed, key=lambda pair: pair[0])]


def planned(plan: Plan) -> dict[str, int]:
    """Return the number of sets of each group in the whole plan, whatever share of it is done."""
    return dict(Counter(task.group for task in replace(plan, share=1.0).tasks()))


def effect_pairs(split: Split, count: int) -> list[str]:
    """Return names "a+b" of two hidden effects: all pairs of `PAIRED` in the split's random order, repeated."""
    every = [PLUS.join(sorted(pair)) for pair in itertools.combinations(PAIRED, 2)]
    order = np.random.default_rng(list(split.encode())).permutation(len(every))
    return [every[order[i % len(every)]] for i in range(count)]


NOTHING = Plan(
    seeds=0, clean=0, unknown=0, pairs=0, weak=0, poor=0, noload=0, quick=0, rods=0, plan=0, improve=0
)
GROUPS = ("effect", "clean", "unknown", "pair", "weak", "poor", "rich_noload", *QUICK_PROTOCOLS)
GROUPS += ("missed", *MISTAKE_GROUPS, "interval")
# The plan of each bed; a whole run takes two cores about one and a half hours.
PLAN_OF: dict[Bed, Plan] = {
    "exact": Plan(),
    "law_off": Plan(
        bed="law_off",
        seeds=8,
        clean=90,
        unknown=3,
        pairs=40,
        weak=0,
        poor=0,
        noload=0,
        quick=4,
        rods=3,
        plan=20,
        improve=1,
        missed=6,
        payload=16,
        clock=16,
        gravity=16,
        interval=6,
    ),
}


def group_tasks(group: str, count: int, split: str, bed: Bed = "exact") -> list[Task]:
    """Return the first tasks of a group, kinds in turn."""
    each = -(-count // len(KINDS))
    sizes = {
        "effect": {"seeds": each},
        "clean": {"clean": count},
        "unknown": {"unknown": -(-count // len(UNKNOWN))},
        "pair": {"pairs": count},
        "weak": {"weak": -(-count // (2 * len(KINDS)))},
        "poor": {"poor": each},
        "rich_noload": {"noload": each},
        **{name: {"quick": -(-count // (len(QUICK) + 1))} for name in QUICK_PROTOCOLS},
        "missed": {"missed": -(-count // len(MISSED))},
        **{name: {name: count} for name in MISTAKE_GROUPS},
        "interval": {"interval": -(-count // len(PARAMETERS))},
    }
    plan = replace(NOTHING, split=split, bed=bed, **sizes[group])
    return [task for task in plan.tasks() if task.group == group][:count]


SMALL_KINDS = (CLEAN, "stiffness", "viscous_damping", "mullins", "leak", "sensor_lag", "cross_axis")
SMALL_KINDS += ("tendon_friction", "torque_ripple", "run_slip")


def small_plan(bed: Bed = "exact") -> Plan:
    """Return a few sets of every group for CI: at most ten minutes on two cores."""
    few = {"seeds": 1, "clean": 2, "unknown": 1, "quick": 1, "plan": 1}
    none = dict.fromkeys(("pairs", "weak", "poor", "noload", "improve"), 0)  # a plan begins with a poor set
    if bed == "exact":
        return Plan(kinds=SMALL_KINDS, **few, **none)
    more = {**dict.fromkeys(MISTAKE_GROUPS, 1), "interval": 1}
    return Plan(kinds=(*SMALL_KINDS, *MISTAKES), bed=bed, **few, **none, **more)
