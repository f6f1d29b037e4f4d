"""A hanging robot of two links with constant curvature and a tendon beside them, by SoRoMoX (pip install soromox)."""

import jax
import jax.numpy as jnp
from soromox.systems.components.links import LinkSpec
from soromox.systems.pcs import PlanarPCS
from soromox.systems.pcs.structures import PlanarPCSStructure

jax.config.update("jax_enable_x64", True)
INPUTS = {"tension_n": (0.0, 2.0)}
OUTPUTS = ("tip_x_m", "tip_y_m")
PARAMETERS = {"stiffness": (1.0, 0.5, 2.0, "1", "factor on the stiffness of the links")}
MISSING = {"sheath_friction": (0.0, 0.0, 0.5, "1", "the sheath holds a share of the tension, against the motion")}
DERIVATIVES = "jax"
LENGTH_M, ARM_M, LINKS, PARTS = 0.2, 0.008, 2, 4


def robot(links):
    size = {"length": LENGTH_M / links, "radius": 0.01, "density": 1070.0, "reference_strain": [0.0, 1.0, 0.0]}
    link = LinkSpec.circular(**size, young_modulus=1e5, poisson_ratio=0.45, material_damping_coefficient=2e3)
    bends = PlanarPCSStructure(strain_selector=[True, False, False] * links)
    base = {"gravity": jnp.array([0.0, -9.81]), "base_pose": jnp.array([-jnp.pi / 2, 0.0, 0.0])}
    return PlanarPCS.from_links([link] * links, structure=bends, backend="jax", **base)


@jax.jit
def simulate(time_s, inputs, parameters, plain=robot(LINKS)):
    links = plain.num_coordinates
    made = plain.update_link_params(stiffness=parameters["stiffness"] * plain.params.link.stiffness)

    def step(state, now):
        held = 1.0 - parameters["sheath_friction"] * jnp.tanh(state[links:])
        moment = now[0] * ARM_M * held * LENGTH_M / links
        speed = state[links:] + now[1] * made.forward_dynamics(0.0, state, (None, moment))[links:]
        state = jnp.concatenate([state[:links] + now[1] * speed, speed])
        return state, made.forward_kinematics_tips(state[:links])[-1, 1:]

    fine = jnp.interp(jnp.arange(1, PARTS * (len(time_s) - 1) + 1) / PARTS, jnp.arange(len(time_s)), inputs["tension_n"])
    tips = jax.lax.scan(step, jnp.zeros(2 * links), (fine, jnp.repeat(jnp.diff(time_s) / PARTS, PARTS)))[1]
    tips = jnp.concatenate([jnp.array([[0.0, -LENGTH_M]]), tips[PARTS - 1 :: PARTS]])
    return {"tip_x_m": tips[:, 0], "tip_y_m": tips[:, 1]}
