"""Mass that must be accelerated.

    M_i = −f J_i d²u_i/dt²

per joint: what a model of equilibria leaves out (d'Alembert). A law term knows its own joint only, so the chain's mass
matrix M at rest, payload included, becomes a diagonal one that has the same lowest swing: there M φ = K φ / ω²
(Craig & Kurdila, Fundamentals of Structural Dynamics, 2006), hence J_i = k_i / ω² with the stiffnesses at rest k_i.
For one joint that is its moment of inertia. A chain has no swing but the lowest: after a step of pressure that makes a
third to three quarters of what the masses do to the whole angle (RMS, two to eight modules, with and without
payload). A payload that a recording gives instead of the chain's own counts as weight only.

The acceleration is that of Newmark's average-acceleration rule (β = 1/4, γ = 1/2; J. Eng. Mech. Div. ASCE 85, 1959),
velocity v and acceleration a being the memory: over a step Δt in which the angle moves by Δu

    a' = 4/Δt (Δu/Δt − v) − a,      v' = 2 Δu/Δt − v

which is stable at any step and takes no energy from a swing; a step should be below a twentieth of its period. A
state that is reached slowly has v = a = 0. Engines that integrate motion themselves refuse the effect: they have it.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, EffectParameter, Model, Place
from pliant.mechanics.inertia import mass_matrix
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Ratio
from pliant_plugins.effects.scale import joint_stiffnesses, main_axis

BOUNDS = (0.0, 20.0)


class InertiaConfig(EffectConfig):
    """f, acting / computed inertia."""

    kind: Literal["inertia"] = "inertia"
    scale: Ratio = Field(
        default=0.0, ge=BOUNDS[0], le=BOUNDS[1], description="inertia that acts / that of the chain's masses"
    )


class Inertia(Effect):
    """Adds each joint's share of the chain's inertia."""

    place: ClassVar[Place] = "law"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("scale", "1", neutral=0.0, bounds=BOUNDS, plausible=(0.3, 2.0)),
    )
    notes: ClassVar[EffectNotes] = EffectNotes(
        signature=(
            "after a fast step the joint overshoots and rings at a frequency that falls with the mass it carries; in "
            "slow runs and holds nothing is seen."
        ),
        look_alike="viscous_damping",
        told_apart="damping only delays; a mass overshoots, the more the heavier the payload.",
        excited_by=(
            "step the pressure as fast as the valve allows and record at 50 Hz or more, with and without a payload."
        ),
        where=(
            "chains with masses in the quasistatic engine, sampled above twenty times per swing; mujoco accelerates "
            "masses itself and refuses it (with drag_1_s and joint_damping 0 its chain swings freely)."
        ),
    )
    exciting: ClassVar[tuple[str, ...]] = ("step_response", "fast_cycles")
    config: InertiaConfig

    def apply(self, model: Model) -> Model:
        """The model with its masses accelerated; see `lumped_inertia` for errors."""
        rows = tuple((inertia,) for inertia in lumped_inertia(model.chain))
        term = LawTerm(
            "moment",
            _moment,
            (self.config.scale,),
            n_states=2,
            needs_time=True,
            per_joint=rows,
            is_inertia=True,
        )
        return model.with_term(term)


def lumped_inertia(chain: ChainModel) -> tuple[float, ...]:
    """J_i about each joint's main axis in kg·m² (kg on slides): see above.

    Raises:
        UserError: the chain has no mass beyond its base, or a law that is not stiff at rest.
    """
    n, axes = chain.n_joints, chain.axes
    main = main_axis(chain)
    mass = mass_matrix(chain, np.zeros((n, len(axes)))).reshape(n, len(axes), n, len(axes))[:, main, :, main]
    stiffness = joint_stiffnesses(chain)
    scale = np.sqrt(stiffness)
    slowest = float(np.linalg.eigvalsh(mass / np.outer(scale, scale))[-1])  # 1/ω²
    if not slowest > 0.0:
        raise UserError(
            "effect 'inertia' needs masses, and the chain has none beyond its base; give the material a density, the "
            "chain's modules a mass or the chain a payload, or take it out of 'effects'."
        )
    return tuple((slowest * stiffness).tolist())


def _moment(
    angle: float,
    rate: float,
    dt_s: float,
    actuation: float,
    temperature_c: float,
    old: Array,
    new: Array,
    parameters: Array,
) -> float:
    # Memory: velocity and acceleration. In no time nothing moves.
    if math.isinf(dt_s):
        new[0] = 0.0
        new[1] = 0.0
    elif dt_s <= 0.0:
        new[0] = old[0]
        new[1] = old[1]
    else:
        new[0] = 2.0 * rate - old[0]
        new[1] = 4.0 / dt_s * (rate - old[0]) - old[1]
    return -parameters[0] * parameters[1] * new[1]
