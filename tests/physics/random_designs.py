"""Chains as a search would draw them: every kind of joint, turned segments, any base, loads up to 50 g, cords."""

from __future__ import annotations

import numpy as np
from tests.physics.conftest import ScalarSpatial, ScalarStretch, ScalarStudy

from pliant.interfaces.physics import Case
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import MassProperties
from pliant.records.law import JointLaw
from pliant.records.rollout import Cord, Inputs, PointForce

WEIGHTS_N = 9.81 * np.array([0.0, 0.01, 0.02, 0.05])


def random_law(random: np.random.Generator) -> JointLaw:
    """Return a law around the worked number of docs/conventions.md, which softens as pressure rises."""
    kind = random.choice(["revolute", "spherical", "prismatic"], p=[0.4, 0.5, 0.1])
    if kind == "prismatic":
        return ScalarStretch()
    factor = random.uniform(0.7, 1.4, 5)
    if kind == "revolute":
        k_n, m_a, m_e, b_e = factor[:4] * [1.637e-6, -1.704e-6, 0.1012, 0.0245]
        # Positive stiffness at zero pressure and angle; m_e supplies the rest.
        return ScalarStudy(k_n, m_a, 0.0, m_e, max(b_e, 0.9 * abs(m_a) * 15e3))
    stiffness = np.diag(factor[:3] * [0.03, 0.0245, 0.06])
    stiffness[0, 1] = stiffness[1, 0] = 0.002 * random.uniform(-1.0, 1.0)
    gain = np.array([random.uniform(-0.4, 0.4), factor[3], 0.1 * random.uniform(-1.0, 1.0)]) * 1.637e-6
    return ScalarSpatial(stiffness, gain, 0.05 * factor[4])


def random_case(random: np.random.Generator) -> Case:
    """Return one design under one set of loads."""
    n, law = int(random.integers(4, 41)), random_law(random)
    length, mass = random.uniform(0.008, 0.014), random.uniform(0.8e-3, 2.5e-3)
    along = np.array([1.0, 0.0, 0.0])
    body = MassProperties(mass, np.array([length / 2, 0.0, random.uniform(0.0, 0.006)]), 1e-8 * np.eye(3))
    segment = max(1, n // int(random.integers(1, 5)))
    turns = [random.uniform(-1.2, 1.2) if i % segment == 0 else 0.0 for i in range(n)]
    turned = exp_map(random.normal(size=3) * random.choice([0.0, 1.0, 3.0])) @ default_base_rotation()
    chain = ChainModel(
        joints=tuple(Joint(0, along * length, exp_map(turn * along)) for turn in turns),
        bodies=(body,) * (n + 1),
        laws=(law,),
        tip_offset_m=along * length / 2,
        base_position_m=np.zeros(3),
        base_rotation=turned,
        payload_kg=float(random.choice([0.0, 0.0, 0.02])),
    )
    cords: tuple[Cord, ...] = ()
    if random.random() < 0.3:
        # Out of reach: a cord that pulls its end into its pulley has no direction there.
        away = random.normal(size=3)
        pulley = away / np.linalg.norm(away) * (n + 1) * length * random.uniform(1.05, 2.0)
        cords = (Cord(n, along * length / 2, pulley, random.uniform(0.02, 0.4)),)
    forces: tuple[PointForce, ...] = ()
    if random.random() < 0.2:
        forces = (PointForce(int(random.integers(1, n + 1)), along * length, random.normal(size=3) * 0.05),)
    weight = np.array([0.0, 0.0, -random.choice(WEIGHTS_N)])
    pressure = float(random.uniform(0.0, 15e3))
    return Case(chain, Inputs({"pressure_pa": pressure}, weight, 0.0, forces, cords))


def random_cases(count: int, seed: int = 0) -> list[Case]:
    """Return `count` designs from one seed."""
    random = np.random.default_rng(seed)
    return [random_case(random) for _ in range(count)]
