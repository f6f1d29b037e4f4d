"""What the checks of physics share: tolerances, loads, chains, a settled equilibrium."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.physics import PhysicsBackend
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs
from pliant.testing.samples import PRESSURE_PA, sample_chain, softening_law
from pliant.testing.suite import CheckSkipped, Subject

# the bar of every engine: engines agree within 0.01 mm.
POSITION_M = 1e-5
ANGLE_RAD = 3e-4
# Largest unbalanced effort of a converged equilibrium, as a share of the law's effort at full pressure.
RESIDUAL_SHARE = 1e-3
NO_GRAVITY = (0.0, 0.0, 0.0)


def pressed(pressure: float = PRESSURE_PA, **loads: object) -> Inputs:
    """Inputs with a pressure and further loads."""
    return Inputs({"pressure_pa": pressure}, **loads)  # type: ignore[arg-type]


def settled_under(subject: Subject, chain: ChainModel, inputs: Inputs) -> Equilibrium:
    """What a new simulation of this chain settles to."""
    backend: PhysicsBackend = subject.build()
    with backend.build(chain) as simulation:
        simulation.apply(inputs)
        return simulation.settle()


def unbalanced(chain: ChainModel, inputs: Inputs, settled: Equilibrium) -> float:
    """The largest effort that the common statics leaves unbalanced in a settled chain."""
    efforts = ChainStatics(chain).residual(settled.joint_angles, Loads.of(chain, inputs))
    return float(np.abs(efforts).max())


def needs(subject: Subject, capability: str) -> PhysicsBackend:
    """The engine; skips the check where its `Capabilities` lack this one."""
    engine: PhysicsBackend = subject.build()
    if not getattr(engine.capabilities, capability):
        raise CheckSkipped(f"{subject.component.label} has no {capability.replace('_', ' ')}")
    return engine


def needs_joint(subject: Subject, kind: str) -> None:
    """Skip the check for an engine without joints of this kind."""
    joints = type(subject.build()).capabilities.joints
    if kind not in joints:
        raise CheckSkipped(f"{subject.component.label} has no {kind} joints")


def bent_chain(**chain: object) -> ChainModel:
    """Two segments, the second turned about the chain axis: it bends out of the plane."""
    return sample_chain(softening_law(), modules=3, turns_rad=(0.0, 1.2), **chain)


def chain_numbers(chain: ChainModel) -> Array:
    """All arrays of a chain in a row."""
    parts = [chain.tip_offset_m, chain.base_position_m, chain.base_rotation, chain.gravity_m_s2]
    parts += [a for j in chain.joints for a in (j.offset_m, j.rest_rotation)]
    parts += [a for b in chain.bodies for a in (b.com_m, b.inertia_kg_m2, np.array(b.mass_kg))]
    return np.concatenate([np.ravel(part) for part in parts])
