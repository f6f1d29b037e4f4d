"""Mass that must be accelerated.

    M_i = −f J_i (d²u_i/dt² + 2 ζ ω du_i/dt)

per joint: the inertia forces that a model of equilibria omits (d'Alembert), with the damping of free swings, in
proportion to mass (Rayleigh's). A law term depends on its own joint only, so the chain's mass matrix M at rest, payload
included, becomes a diagonal one that has the same lowest swing ω: there M φ = K φ / ω² (Craig & Kurdila, Fundamentals
of Structural Dynamics, 2006), hence J_i = k_i / ω² with the stiffnesses at rest k_i. For one joint that is its moment
of inertia. A chain has no swing but the lowest: after a step of pressure it makes a third to three quarters of what the
masses do to the whole angle (RMS, two to eight modules, with and without payload). With the payload m of a run,
1/ω² is taken as linear in m, which is exact for one joint and else for a swing whose shape does not change.

Newmark's rule (J. Eng. Mech. Div. ASCE 85, 1959) with velocity v and acceleration a as memory; over a step Δt

    a' = (Δu − Δt v) / (β Δt²) − (1 / 2β − 1) a,      v' = v + Δt ((1 − γ) a + γ a')

With more than six samples per swing it takes no energy from it (γ = 1/2, β = 1/4); what samples cannot show, two and
fewer per swing, it damps out at once (γ = 3/2, β = 1), as it would have died between them. A state that is reached
slowly has v = a = 0. Engines that integrate motion themselves refuse the effect: they have it.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.kinematics import main_axis
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Ratio
from pliant_plugins.effects.scale import joint_stiffnesses

# ω Δt below which a swing is followed, and from which on it is damped out.
RESOLVED, UNSEEN = 1.0, 3.0


class InertiaConfig(EffectConfig):
    """f, acting / computed inertia, and ζ."""

    kind: Literal["inertia"] = "inertia"
    scale: Ratio = parameter(neutral=0.0, bounds=(0.0, 20.0), plausible=(0.3, 2.0), example=1)
    """inertia that acts / that of the chain's masses"""
    damping_ratio: Ratio = parameter(
        neutral=0.1,
        bounds=(0.0, 0.5),
        plausible=(0.02, 0.3),
        role="shape",
        prior="log_normal",
        simpler={0.0: "the swing needs no damping of its own"},
    )
    """damping of the swing / critical, at scale 1"""


class Inertia(Effect):
    """The chain's inertia, divided among the joints."""

    place = "law"
    notes = EffectNotes(
        signature="after a fast step the joint overshoots and rings at a frequency that falls with the mass it "
        "carries; in slow runs and holds nothing is seen.",
        inspection="film a quick vent at fifty pictures a second or more and count the swings; weigh what hangs at "
        "the tip.",
        confounder="viscous_damping",
        distinguishing_test="damping only delays; a mass overshoots, the more the heavier the payload.",
        excitation="step the pressure as fast as the valve allows and record at 50 Hz or more, with and without a "
        "payload.",
        where="chains with masses in the quasistatic engine, sampled above twenty times per swing; mujoco "
        "accelerates masses itself and refuses it (with drag_1_s and joint_damping 0 its chain swings freely).",
    )
    recommended_experiments = ("step_response", "fast_cycles")
    config: InertiaConfig

    def apply(self, model: Model) -> Model:
        """Return the model with its masses accelerated; see `lumped_inertia` for errors."""
        config, chain = self.config, model.chain
        inertia, stiffness = lumped_inertia(chain), joint_stiffnesses(chain).tolist()
        more = chain.payload_kg + sum(body.mass_kg for body in chain.bodies)
        heavier = chain.with_(payload_kg=chain.payload_kg + more)
        gains = [(j - i) / more for i, j in zip(inertia, lumped_inertia(heavier), strict=True)]
        term = LawTerm(
            "moment",
            _moment,
            (config.scale, config.damping_ratio),
            n_states=2,
            needs_time=True,
            per_joint=tuple(zip(inertia, stiffness, strict=True)),
            per_payload_kg=tuple((gain, 0.0) for gain in gains),
            is_inertia=True,
        )
        return model.with_term(term)


def lumped_inertia(chain: ChainModel) -> tuple[float, ...]:
    """Return J_i about each joint's main axis in kg·m² (kg on slides): see above.

    Raises:
        UserError: the chain has no mass beyond its base, or a law that is not stiff at rest.
    """
    n, axes = chain.n_joints, chain.axes
    main = main_axis(chain.axes)
    mass = mass_matrix(chain, np.zeros((n, len(axes)))).reshape(n, len(axes), n, len(axes))[:, main, :, main]
    stiffness = joint_stiffnesses(chain)
    scale = np.sqrt(stiffness)
    slowest = float(np.linalg.eigvalsh(mass / np.outer(scale, scale))[-1])  # 1/ω²
    if not slowest > 0.0:
        raise ImpossibleEffectError(
            "effect 'inertia' needs masses, and the chain has none beyond its base",
            "give the material a density, the chain's modules a mass or the chain a payload, or take it out of "
            "'effects'",
        )
    return tuple((slowest * stiffness).tolist())


def _moment(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    # Memory: velocity and acceleration. Numbers: f, ζ, J, k. Nothing moves in a step of zero duration.
    if math.isinf(dt_s):
        new[0] = 0.0
        new[1] = 0.0
    elif dt_s <= 0.0:
        new[0] = old[0]
        new[1] = old[1]
    else:
        swing = dt_s * math.sqrt(c[3] / (c[0] * c[2])) if c[0] > 0.0 else UNSEEN
        gamma = 0.5 + min(max((swing - RESOLVED) / (UNSEEN - RESOLVED), 0.0), 1.0)
        beta = 0.25 * (gamma + 0.5) * (gamma + 0.5)
        new[1] = (rate - old[0]) / (beta * dt_s) - (0.5 / beta - 1.0) * old[1]
        new[0] = old[0] + dt_s * ((1.0 - gamma) * old[1] + gamma * new[1])
    return -c[0] * (c[2] * new[1] + 2.0 * c[1] * math.sqrt(c[2] * c[3]) * new[0])
