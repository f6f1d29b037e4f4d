"""The check file of an export: the study's predictions, to be reproduced by the program that reads the export."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant import __version__
from pliant.interfaces.physics import PhysicsBackend
from pliant.inverse.limits import input_range
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.records.rollout import Equilibrium, Inputs
from pliant_export.written_law import WrittenLaw, written

FORMAT = 1
ABOUT = (
    "What the study predicts of the robot or law in the files beside this one. SI units, world frame.",
    "states: at these coordinates the tip is at tip_m, turned by tip_rotation, and the laws give these efforts, joint "
    "by joint. Where equilibrium is true, the robot rests there under inputs, gravity and tip_force_n (at the tip).",
    "laws: efforts and slopes of a law alone; inputs are its actuations, then its deformations.",
    "tolerance: tip_m of a settled tip; same_… at the same coordinates, efforts as a share of the largest; "
    "law_of_largest of each output of a law, as a share of its largest.",
)
# Tolerances: a settled tip relative to the length; the same arithmetic elsewhere relative to the largest value.
SETTLED, SAME, OF_LAW = 5e-4, 1e-6, 1e-9
# Shares of the inputs' ranges, and of the weight as an additional force at the tip.
SHARES, PULLED = (0.0, 0.4, 0.8), (0.0, 0.0, 0.05)
PULL = np.array([0.3, 0.2, -1.0])
# Bounds where a law states no domain: of a pressure, of anything else.
PRESSURE, OTHER = 1e4, 0.5
POINTS, SEED = 8, 0
TRIES = 4


@dataclass(frozen=True)
class CheckFile:
    """The contents of a check file.

    Attributes:
        study: its name.
        engine: that solved the equilibria; empty without equilibria.
        files: names of the exported files.
        laws: efforts at points.
        states: of the chain.
        length_m: of the chain.
        left_out: effects of the study that are not in the files, nor in these numbers.
    """

    study: str
    engine: str
    files: tuple[str, ...]
    laws: tuple[Mapping[str, Any], ...] = ()
    states: tuple[Mapping[str, Any], ...] = ()
    length_m: float = 0.0
    left_out: tuple[str, ...] = ()

    def write(self, path: Path) -> Path:
        """Write `<file>.check.json` into the folder of the export `path` and return its path."""
        settled = SETTLED * self.length_m
        tolerance = {
            "tip_m": settled,
            "same_tip_m": SAME * self.length_m,
            "same_rotation": SAME,
            "same_efforts_of_largest": SAME,
            "law_of_largest": OF_LAW,
        }
        whole = {
            "pliant_check": FORMAT,
            "about": list(ABOUT),
            "files": list(self.files),
            "study": self.study,
            "pliant": __version__,
            "engine": self.engine or None,
            "left_out": list(self.left_out),
            "tolerance": tolerance,
            "laws": list(self.laws),
            "states": list(self.states),
        }
        place = check_path(path)
        place.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
        return place


def check_path(path: Path) -> Path:
    """Return the path of an export's check file."""
    return path.with_name(f"{path.name}.check.json")


def law_points(law: JointLaw, name: str) -> dict[str, Any]:
    """Return efforts and slopes of a law at points of its domain, the first of them rest without actuation."""
    form: WrittenLaw = written(law, name)
    box = _box(form)
    at = np.random.default_rng(SEED).uniform(box[:, 0], box[:, 1], (POINTS, len(box)))
    at[0] = 0.0
    p = at[:, 0] if form.m == 1 else at[:, : form.m]
    effort = law.evaluate(p, at[:, form.m :])
    outputs = {
        key: np.asarray(value, float).reshape(POINTS, -1)
        for key, value in (("tau", effort.tau), ("dtau_dp", effort.dtau_dp), ("dtau_du", effort.dtau_du))
    }
    return {
        "law": form.name,
        "inputs": [*form.actuations, *form.deformations],
        "unit_of_tau": form.unit,
        "points": [
            {"inputs": row.tolist(), **{key: value[k].tolist() for key, value in outputs.items()}}
            for k, row in enumerate(at)
        ],
    }


def settled_states(chain: ChainModel, engine: PhysicsBackend) -> Iterator[dict[str, Any]]:
    """Yield equilibria of a chain: under its weight, at two levels of its inputs, at the higher one pulled at the tip.

    A level is halved where the engine finds no stable equilibrium inside the laws' domain; a state without one is left
    out.
    """
    chain = chain.with_(mount=None)
    weight = chain.payload_kg + sum(body.mass_kg for body in chain.bodies)
    weight *= float(np.linalg.norm(chain.gravity_m_s2))
    with engine.build(chain) as simulation:
        start = simulation.snapshot()
        for share, pulled in zip(SHARES, PULLED, strict=True):
            for k in range(TRIES):
                force = pulled * weight / 2**k * PULL
                inputs = _level(chain, share / 2**k)
                simulation.restore(start)
                simulation.apply(Inputs(inputs, force))
                found = simulation.settle()
                if _sound(found, share):
                    name = f"{100 * share / 2**k:g} % of the inputs' range" if share else "its weight alone"
                    name += ", pulled at the tip" if force.any() else ""
                    # without masses a dynamic simulation does not come to rest there
                    yield reference_state(chain, found.joint_angles, inputs, name, force, weight > 0.0)
                    break


def posed_states(chain: ChainModel, prefix: str = "") -> Iterator[dict[str, Any]]:
    """Yield two states of a chain that are not equilibria: straight, and bent within the laws' domain."""
    for share in (SHARES[0], SHARES[-1]):
        inputs = _level(chain, share)
        q = np.array([_bent(chain.laws[joint.law], share) for joint in chain.joints])
        yield reference_state(chain, q, inputs, f"posed at {100 * share:g} %", prefix=prefix)


def reference_state(
    chain: ChainModel,
    q: Array,
    inputs: Mapping[str, float],
    name: str,
    force_n: Array | None = None,
    equilibrium: bool = False,
    prefix: str = "",
) -> dict[str, Any]:
    """Return one state for the file: its tip by kinematics, its efforts by the laws."""
    pose = ChainGeometry.from_chain(chain).forward(q)
    tip = pose.origins[-1] + pose.rotations[-1] @ np.asarray(chain.tip_offset_m, float)
    return {
        "name": name,
        "prefix": prefix,
        "equilibrium": equilibrium,
        "inputs": {key: float(value) for key, value in inputs.items()},
        "tip_force_n": (np.zeros(3) if force_n is None else force_n).tolist(),
        "tip_m": tip.tolist(),
        "tip_rotation": pose.rotations[-1].tolist(),
        "axes": list(chain.axes),
        "coordinates": np.asarray(q, float).tolist(),
        "efforts": JointEfforts(chain).evaluate(q, inputs).tau.tolist(),
    }


def _sound(equilibrium: Equilibrium, share: float) -> bool:
    """Return whether another program can reproduce the state; under its weight alone a chain may leave the data."""
    return (
        equilibrium.converged
        and equilibrium.stable is not False
        and not (share and equilibrium.outside_domain)
    )


def _level(chain: ChainModel, share: float) -> dict[str, float]:
    """Return inputs at a share of their ranges, smaller for later ones, so that opposed inputs do not cancel."""
    found = {}
    for k, name in enumerate(chain.inputs):
        low, high = input_range(chain, name)
        high = high if np.isfinite(high) else _most(name)
        low = low if np.isfinite(low) and low > 0.0 else 0.0
        own = share * (1.0 - 0.6 * k / len(chain.inputs))
        found[name] = low + own * (high - low) if share else 0.0
    return found


def _bent(law: JointLaw, share: float) -> Array:
    """Return (a,) deformations at a share of half the domain's upper ends."""
    high = np.atleast_2d(law.domain.deformation)[:, 1]
    return np.asarray(0.5 * share * np.where(np.isfinite(high), high, OTHER))


def _box(form: WrittenLaw) -> Array:
    """Return (m + a, 2) the law's domain, bounded."""
    most = np.array([_most(name) for name in (*form.actuations, *form.deformations)])
    low = np.where(np.isfinite(form.domain[:, 0]), form.domain[:, 0], -most)
    high = np.where(np.isfinite(form.domain[:, 1]), form.domain[:, 1], most)
    return np.stack([low, high], axis=1)


def _most(name: str) -> float:
    """Return the bound of a variable that a law does not bound."""
    return PRESSURE if name.endswith("_pa") else OTHER


def reference_law_points(laws: Sequence[JointLaw], names: Sequence[str]) -> tuple[dict[str, Any], ...]:
    """Return the points of each distinct law by the name of its function, without laws that have no scalar form."""
    distinct = list(dict.fromkeys(laws))
    named = names or [f"law_{k}" for k in range(len(distinct))]
    return tuple(
        law_points(law, name) for law, name in zip(distinct, named, strict=True) if law.scalar() is not None
    )
