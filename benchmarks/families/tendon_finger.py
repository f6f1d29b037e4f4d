"""Published values of the study's tendon finger compared with ours: python -m benchmarks.families.tendon_finger

Source: the public repository of Yao, Howard, Maiolino (2026), yaoyao199709/soft-robot-task-driven-design at 2311337,
cases/tendon_driven/run_tendon_validation.py. The example's law (least squares to the published FEM of one joint) is
put into a chain with the script's pose, masses and cord: the finger is along world x, gravity is −z, the tendon turns
it upward, and the cord of the weight runs from the underside of the last link, 3.59 mm before its joint, to a point
10.1 mm beyond and below the straight finger's tip.

Prints the stated values, and for each weight the largest tendon force before a joint leaves the law's data.
Writes benchmarks/out/tendon_finger.json.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from typing import Any

import numpy as np
from benchmarks.output import ROOT, engine, write
from numpy.polynomial import polynomial

from pliant import api
from pliant.pipeline.study import build_study_chain
from pliant.records.chain import ChainModel
from pliant.records.rollout import Cord, Equilibrium, Inputs
from pliant_plugins.families.reference import TENDON_JOINT
from pliant_plugins.families.tendon_joint.family import TendonJoint, TendonJointConfig
from pliant_plugins.tasks.tendon_finger import STUDY_LENGTH_M

STUDY = ROOT / "examples/tendon_finger/finger.yaml"
# Of the script: lengths in m, volumes in m³, densities in kg/m³.
BASE_M, LINK_M, HEIGHT_M = 31.987038e-3, 28e-3, 20.2e-3
RIGID_KG_M3, SOFT_KG_M3 = 1240.0, 1120.0
LINK_M3, LAST_M3 = (6967.283023e-9, 2055.561247e-9), (8166.460645e-9, 1703.826106e-9)
TENDON_END_M = (8e-3, 6.7e-3)  # along the last link from its joint, and off its axis
CORD_M, FINGER_M = (-3.59e-3, 0.0, HEIGHT_M / 2), BASE_M + 3 * LINK_M
GRAVITY, WEIGHT = 9.8, 9.81
PULLS = {0.0: 8.07, 20e-3: 9.185, 50e-3: 10.77}  # weight (kg) → pull (N)
LARGEST_RAD, STEP_N = 0.93, 0.05


def link_kg(volumes_m3: tuple[float, float]) -> float:
    """Return mass of a link from its rigid and its soft volume."""
    return RIGID_KG_M3 * volumes_m3[0] + SOFT_KG_M3 * volumes_m3[1]


def finger() -> ChainModel:
    """Build the example's laws in the script's pose; every link's mass is at its joint, as in the script."""
    lies = ["chain.base={direction: [1, 0, 0]}", f"chain.segments.0.rigid.length={1e3 * BASE_M - 14} mm"]
    with tempfile.TemporaryDirectory() as folder:
        opened = api.open_study(STUDY, lies, store=folder)
        chain = build_study_chain(opened.context, opened.study).chain
    base, *links = chain.bodies
    masses = (link_kg(LINK_M3), link_kg(LINK_M3), link_kg(LAST_M3))
    moved = [replace(b, mass_kg=m, com_m=np.zeros(3)) for b, m in zip(links, masses, strict=True)]
    return replace(chain, bodies=(base, *moved), gravity_m_s2=np.array([0.0, 0.0, -GRAVITY]))


def cords(weight_kg: float) -> tuple[Cord, ...]:
    """Return the cord of the weight, along the script's line."""
    pulley = np.array([FINGER_M + HEIGHT_M / 2, 0.0, -HEIGHT_M / 2])
    return (Cord(3, np.array(CORD_M), pulley, WEIGHT * weight_kg),) if weight_kg else ()


def pulled(chain: ChainModel, weight_kg: float, up_to_n: float) -> tuple[float, Equilibrium]:
    """Return the last pull and equilibrium, in steps, at which every joint is within the law's data."""
    with engine("quasistatic").build(chain) as simulation:
        reached = 0.0
        found = simulation.settle()
        for pull in np.arange(STEP_N, up_to_n + STEP_N, STEP_N).tolist():
            simulation.apply(Inputs({"tendon_force_n": pull}, cords=cords(weight_kg)))
            state = simulation.settle()
            if state.joint_angles[:, 0].max() > LARGEST_RAD:
                break
            reached, found = pull, state
        return reached, found


def row(chain: ChainModel, weight_kg: float, stated_n: float) -> dict[str, Any]:
    """Return the largest pull within the data, with angles (rad), travel by the published formula (m) and tip (m)."""
    reached, state = pulled(chain, weight_kg, stated_n)
    angles = state.joint_angles[:, 0]
    lengths = polynomial.polyval(angles, np.array(STUDY_LENGTH_M))
    return {
        "weight_kg": weight_kg,
        "stated_n": stated_n,
        "within_data_n": reached,
        "angles_rad": angles.tolist(),
        "travel_m": float(np.sum(STUDY_LENGTH_M[0] - lengths)),
        "tip_m": state.markers_m[-1].tolist(),
    }


def main() -> None:
    joint = TendonJoint(TendonJointConfig.model_validate(TENDON_JOINT))
    geometry = joint.geometry
    soft = geometry.flexure_length_m * geometry.flexure_thickness_m * geometry.flexure_width_m
    mass = joint.mass(SOFT_KG_M3)
    stated = {
        "link, g": (1e3 * link_kg(LINK_M3), 1e3 * (mass.start.mass_kg + mass.end.mass_kg)),
        "last link, g": (1e3 * link_kg(LAST_M3), None),
        "soft volume of a joint, mm³": (1e9 * LINK_M3[1], 1e9 * soft),
        "rigid volume of a link, mm³": (1e9 * LINK_M3[0], None),
        "height of a link, mm": (1e3 * HEIGHT_M, 1e3 * geometry.link_height_m),
        "tendon off the joint's axis, mm": (1e3 * TENDON_END_M[1], 6.591),
    }
    print("stated by the script                    published      ours")
    for words, (published, ours) in stated.items():
        print(f"    {words:36s} {published:8.3f}  " + ("        –" if ours is None else f"{ours:9.3f}"))
    chain = finger()
    rows = [row(chain, weight, pull) for weight, pull in PULLS.items()]
    print(
        f"weight  stated pull  a joint passes {LARGEST_RAD} rad at   angles before, rad     travel   tip (x, z)"
    )
    for one in rows:
        angles = ", ".join(f"{angle:.3f}" for angle in one["angles_rad"])
        x, _, z = (1e3 * c for c in one["tip_m"])
        print(
            f"{1e3 * one['weight_kg']:4.0f} g  {one['stated_n']:7.3f} N    {one['within_data_n'] + STEP_N:7.2f} N"
            f"                          {angles}   {1e3 * one['travel_m']:5.2f} mm  ({x:.1f}, {z:.1f}) mm"
        )
    write("tendon_finger", {"stated": {k: list(v) for k, v in stated.items()}, "rows": rows})


if __name__ == "__main__":
    main()
