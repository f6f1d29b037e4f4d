"""Known changes of a chain's tip under changes of its study: each relation gives the other study and the other tip."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from tests.metamorphic.random_studies import Raw, changed

from pliant.mechanics.rotations import exp_map, quaternion_from_matrix
from pliant.records.chain import GRAVITY_M_S2

Tip = Callable[[np.ndarray], np.ndarray]
# An effort of t unbalanced in each of n joints moves them by √n t / λ, with λ the least eigenvalue of the stiffness.
# The random studies have n ≤ 7 and λ ≥ 2e-3 N·m/rad (joints of 0.01 N·m/rad and more at rest, times a factor of 0.3,
# less their weight): 1.3e-9 rad at the tolerance of 1e-12 N·m of these studies, and 1.3e-6 rad at 1e-9, the default of
# the quasi-static engine and of MuJoCo. The tip moves by less than the chain's length times that.
EXACT, ENGINES = 1e-8, 2e-6
PSI = 6894.757293168361


@dataclass(frozen=True)
class Moved:
    """The other study, the map of the tip, and the tolerance as a share of the tip's distance from the base.

    Attributes:
        study: the changed study.
        tip: the tip of the changed study as a function of that of the plain one.
        tolerance: largest distance between them, as a share of the tip's distance from the base.
        plain: the study that is compared, where it is not the random one.
        files: text of the files that the studies read, by name.
    """

    study: Raw
    tip: Tip = lambda tip: tip
    tolerance: float = EXACT
    plain: Raw | None = None
    files: Mapping[str, str] = field(default_factory=dict)


def in_other_units(raw: Raw, rng: np.random.Generator) -> Moved:
    """Write the same quantities in millimetres, psi, grams and mN."""
    chain, task = dict(raw["chain"]), dict(raw["task"])
    for name, unit, factor in (
        ("module_length", "mm", 1e3),
        ("module_radius", "cm", 1e2),
    ):
        chain[name] = f"{chain.pop(name + '_m') * factor!r} {unit}"
    for name in ("module_mass", "payload"):
        chain[name] = f"{chain.pop(name + '_kg') * 1e3!r} g"
    task["pressure"] = f"{task.pop('pressure_pa') / PSI!r} psi"
    task["tip_force"] = [f"{1e3 * f!r} mN" for f in task.pop("tip_force_n")]
    other = {**raw, "chain": chain, "task": task}
    return Moved(other)


def twice_as_stiff_under_twice_the_load(raw: Raw, rng: np.random.Generator) -> Moved:
    """Multiply all efforts by a factor: the pose stays."""
    s = float(rng.uniform(0.3, 3.0))
    coefficients = {name: s * value for name, value in raw["surrogate"]["coefficients"].items()}
    mass = {name: s * raw["chain"][name] for name in ("module_mass_kg", "payload_kg")}
    return Moved(
        changed(
            raw,
            surrogate={"coefficients": coefficients},
            chain=mass,
            task={"tip_force_n": [s * f for f in raw["task"]["tip_force_n"]]},
        )
    )


def stiffer_under_more_pressure(raw: Raw, rng: np.random.Generator) -> Moved:
    """Multiply stiffness, weights and pressure by a factor, with the moment by pressure unchanged."""
    s = float(rng.uniform(0.5, 2.0))
    own = raw["surrogate"]["coefficients"]
    coefficients = {**own, "m_e": s * own["m_e"], "b_e": s * own["b_e"]}
    mass = {name: s * raw["chain"][name] for name in ("module_mass_kg", "payload_kg")}
    task = {
        "pressure_pa": s * raw["task"]["pressure_pa"],
        "tip_force_n": [s * f for f in raw["task"]["tip_force_n"]],
    }
    return Moved(changed(raw, surrogate={"coefficients": coefficients}, chain=mass, task=task))


def larger(raw: Raw, rng: np.random.Generator) -> Moved:
    """Multiply lengths by λ and divide forces by λ: the moments and angles stay, the tip moves λ times as far."""
    scale = float(rng.uniform(0.4, 2.5))
    chain = {
        **{name: scale * raw["chain"][name] for name in ("module_length_m", "module_radius_m")},
        **{name: raw["chain"][name] / scale for name in ("module_mass_kg", "payload_kg")},
    }
    force = [f / scale for f in raw["task"]["tip_force_n"]]
    return Moved(changed(raw, chain=chain, task={"tip_force_n": force}), lambda tip: scale * tip)


def turned_in_the_world(raw: Raw, rng: np.random.Generator) -> Moved:
    """Turn base, gravity and force together: the tip turns with them."""
    turn = exp_map(rng.uniform(-2.0, 2.0, 3))
    along, aside = np.array(raw["chain"]["base"]["direction"], float), np.array([0.0, -1.0, 0.0])
    stands = np.column_stack([along, aside, np.cross(along, aside)])  # as for 'direction' without 'roll'
    task = {"tip_force_n": (turn @ raw["task"]["tip_force_n"]).tolist()}
    base = {"quaternion": quaternion_from_matrix(turn @ stands).tolist()}
    gravity = (turn @ np.array(GRAVITY_M_S2)).tolist()
    other = {**changed(raw, task=task), "chain": {**raw["chain"], "base": base, "gravity_m_s2": gravity}}
    return Moved(other, lambda tip: turn @ tip)


def in_segments(raw: Raw, rng: np.random.Generator) -> Moved:
    """Split the same modules into two segments."""
    chain = dict(raw["chain"])
    count = chain.pop("modules")
    first = int(rng.integers(1, count))
    return Moved({**raw, "chain": {**chain, "segments": [{"modules": first}, {"modules": count - first}]}})


NEUTRAL: list[dict[str, Any]] = [
    {"kind": "stiffness", "factor": 1.0},
    {"kind": "actuation_gain", "gain": 1.0},
    {"kind": "pressure_offset", "offset_pa": 0.0},
    {"kind": "gravity_scale", "factor": 1.0},
    {"kind": "base_misalignment", "pitch_rad": 0.0, "roll_rad": 0.0},
    {"kind": "backlash", "play_rad": 0.0},
]


def with_neutral_effects(raw: Raw, rng: np.random.Generator) -> Moved:
    """Add effects at their neutral strength, which change nothing."""
    count = int(rng.integers(1, len(NEUTRAL)))
    chosen = [NEUTRAL[k] for k in rng.choice(len(NEUTRAL), count, replace=False)]
    return Moved({**raw, "effects": chosen})


def payload_as_a_force(raw: Raw, rng: np.random.Generator) -> Moved:
    """Replace a payload by a dead force at the tip."""
    force = np.array(raw["task"]["tip_force_n"]) + np.array([0.0, 0.0, -9.81]) * raw["chain"]["payload_kg"]
    other = changed(raw, chain={"payload_kg": 0.0}, task={"tip_force_n": force.tolist()})
    return Moved(other)


def with_task_payload(raw: Raw, rng: np.random.Generator) -> Moved:
    """Move the payload from the chain to the task, which overrides the chain's."""
    payload = raw["chain"]["payload_kg"]
    return Moved(changed(raw, chain={"payload_kg": 0.1}, task={"payload_kg": payload}))


def mirrored(raw: Raw, rng: np.random.Generator) -> Moved:
    """Reflect the chain at the plane through its base that contains the bending axis: all bends change their sign.

    A reflection P turns an angle u about an axis in the plane into -u: the efforts become -τ(p, -u).
    """
    along = np.array(raw["chain"]["base"]["direction"], float)
    normal = np.cross(along / np.linalg.norm(along), [0.0, -1.0, 0.0])
    reflect = np.eye(3) - 2.0 * np.outer(normal, normal)
    own = raw["surrogate"]["coefficients"]
    coefficients = {**own, "k_n": -own["k_n"]}  # the other terms are odd in u
    chain = {"gravity_m_s2": (reflect @ np.array(GRAVITY_M_S2)).tolist()}
    task = {"tip_force_n": (reflect @ raw["task"]["tip_force_n"]).tolist()}
    other = changed(raw, surrogate={"coefficients": coefficients}, chain=chain, task=task)
    return Moved(other, lambda tip: reflect @ tip)


def from_a_table(raw: Raw, rng: np.random.Generator) -> Moved:
    """Replace the stated law, without u|u|, by the spline of a table of its values.

    A cubic spline contains the law exactly, and third differences of its coefficients vanish.
    """
    own = raw["surrogate"]["coefficients"]
    stated = {
        **raw["surrogate"],
        "odd": False,
        "domain": {"actuation": [0.0, 10e3], "deformation": [-2.0, 2.0]},
    }
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["pressure_pa", "angle_rad", "moment_n_m"])
    for p in np.linspace(0.0, 10e3, 6):
        for u in np.linspace(-2.0, 2.0, 17):
            bend = own["m_e"] * u**2 / 2 + own["b_e"] * u
            writer.writerow([repr(float(one)) for one in (p, u, own["k_n"] * p + own["m_a"] * p * u - bend)])
    other = {**raw, "surrogate": {"kind": "table", "data": "law.csv"}}
    return Moved(other, plain={**raw, "surrogate": stated}, files={"law.csv": text.getvalue()})


def in_pybullet(raw: Raw, rng: np.random.Generator) -> Moved:
    """Use a third engine, at the tolerance of the others instead of its default of 1e-8 N·m."""
    return Moved({**raw, "physics": {"kind": "pybullet", "tolerance": 1e-9}}, tolerance=ENGINES)


def in_mujoco(raw: Raw, rng: np.random.Generator) -> Moved:
    """Use another engine, which settles at the same place."""
    return Moved({**raw, "physics": {"kind": "mujoco"}}, tolerance=ENGINES)


RELATIONS = (
    in_other_units,
    twice_as_stiff_under_twice_the_load,
    stiffer_under_more_pressure,
    larger,
    turned_in_the_world,
    in_segments,
    with_neutral_effects,
    payload_as_a_force,
    with_task_payload,
    in_mujoco,
    mirrored,
    from_a_table,
    in_pybullet,
)
