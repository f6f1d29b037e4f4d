"""The truths of the benchmark, and what their benches allow."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.evidence.form_table import Split
from benchmarks.evidence.protocols import HOT_C, LOAD_N_M
from benchmarks.evidence.robots import Robot
from benchmarks.evidence.sets import SetSpec
from benchmarks.evidence.tasks import ENGINES, TURNS, Task, effect_pairs
from benchmarks.evidence.truths import CLEAN, UNKNOWN, kind_robots

from pliant_bench.config import ExperimentConfig

EFFECTS = (
    "stiffness",
    "actuation_gain",
    "pressure_offset",
    "dead_zone",
    "supply_lag",
    "viscous_damping",
    "viscoelastic",
    "friction_hysteresis",
    "mullins",
    "permanent_set",
    "thermal_softening",
    "gravity_scale",
)
# Seeds of this benchmark are others than those of the evidence bed.
SEED = 7000


@dataclass(frozen=True)
class LoopPlan:
    """How many truths of what: 60 by default.

    Attributes:
        seeds: truths of each of the twelve effects.
        clean, unknown, pairs: truths without an effect, with one outside the list, with two.
        split, draw: calibration truths, or judged ones that are drawn by the digest of the code.
        share: part that is done.
    """

    seeds: int = 3
    clean: int = 9
    unknown: int = 7
    pairs: int = 8
    split: Split = "calibration"
    draw: str = ""
    share: float = 1.0

    def tasks(self) -> list[Task]:
        """Return the truths, groups mixed, so that the first ones are of all groups."""
        found: list[tuple[float, Task]] = []
        hidden = [(seed, kind) for seed in range(self.seeds) for kind in EFFECTS]
        groups = {
            "effect": hidden,
            "clean": [(seed, CLEAN) for seed in range(self.clean)],
            "unknown": [(seed, list(UNKNOWN)[seed * 3 % len(UNKNOWN)]) for seed in range(self.unknown)],
            "pair": list(enumerate(effect_pairs(self.split, self.pairs))),
        }
        for group, members in groups.items():
            for rank, (seed, kind) in enumerate(members):
                found.append(((rank + 0.5) / len(members), Task(group, self._spec(group, kind, seed, rank))))
        mixed = [task for _, task in sorted(found, key=lambda pair: pair[0])]
        return mixed[: max(1, round(self.share * len(mixed)))]

    def _spec(self, group: str, kind: str, seed: int, rank: int) -> SetSpec:
        if group in ("clean", "unknown"):
            robot = TURNS[rank % len(TURNS)]
        else:
            robot = "joint" if group == "pair" else kind_robots(kind)[seed % 3 == 2]
        engines = ENGINES[self.split, robot == "joint"]
        engine = engines[rank % len(engines)]
        return SetSpec(kind, SEED + seed, engine, robot, "rich", self.split, draw=self.draw)


def experiment(robot: Robot) -> ExperimentConfig:
    """Return what the bench of a robot may do: as far, as fast and as warm as the rich protocol, in steps of 0.2 s."""
    inputs = {
        robot.drive: {
            "high": robot.drive_max,
            "rate": robot.drive_max / 1.5,
            "acceleration": robot.drive_max,
        },
        "moment_n_m": {
            "low": -LOAD_N_M,
            "high": LOAD_N_M,
            "rate": 1.6 * LOAD_N_M,
            "acceleration": 3.0 * LOAD_N_M,
        },
    }
    if not robot.tendon:
        inputs["valve_open"] = {"low": 0.0, "high": 1.0}
    return ExperimentConfig.model_validate(
        {
            "inputs": inputs,
            "manual": {
                "temperature_c": [22.0, HOT_C],
                "base_pitch_rad": [0.0, "90 deg"],
                "base_roll_rad": [0.0, "90 deg"],
            },
            "period": "0.2 s",
            "minutes": 120.0,
            "runs": 40,
            "longest_run": "120 s",
        }
    )
