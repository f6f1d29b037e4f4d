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
MISSING = {"sheath_friction": (0.0, 0.0, 0.5, "1", "the sheath holds a share of the tension")}
DERIVATIVES = "jax"
LENGTH_M, ARM_M, LINKS, PARTS = 0.2, 0.008, 2, 4
SIZE = {"radius": 0.01, "density": 1070.0, "reference_strain": [0.0, 1.0, 0.0]}
RUBBER = {"young_modulus": 1e5, "poisson_ratio": 0.45, "material_damping_coefficient": 2e3}
BASE = {"gravity": jnp.array([0.0, -9.81]), "base_pose": jnp.array([-jnp.pi / 2, 0.0, 0.0])}


def robot(links):
    link = LinkSpec.circular(length=LENGTH_M / links, **SIZE, **RUBBER)
    bends = PlanarPCSStructure(strain_selector=[True, False, False] * links)
    return PlanarPCS.from_links([link] * links, structure=bends, backend="jax", **BASE)


@jax.jit
def simulate(time_s, inputs, parameters, plain=robot(LINKS)):
    made = plain.update_link_params(stiffness=parameters["stiffness"] * plain.params.link.stiffness)

    def step(state, at_s):
        bend, speed = state
        held = 1.0 - parameters["sheath_friction"] * jnp.tanh(speed)
        moment = jnp.interp(at_s, time_s, inputs["tension_n"]) * ARM_M * made.segment_length * held
        speed += dt * made.forward_dynamics(0.0, jnp.hstack(state), (None, moment))[len(bend) :]
        return (bend + dt * speed, speed), made.forward_kinematics_tips(bend)[-1, 1:]

    dt, rest = (time_s[1] - time_s[0]) / PARTS, jnp.zeros(plain.num_coordinates)
    tips = jax.lax.scan(step, (rest, rest), dt * jnp.arange(PARTS * len(time_s)))[1][::PARTS]
    return {"tip_x_m": tips[:, 0], "tip_y_m": tips[:, 1]}
