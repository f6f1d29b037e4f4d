"""A hanging rubber rod that a couple at its tip bends, by PyElastica (pip install pyelastica)."""

import elastica as ea
import numpy as np

INPUTS = {"couple_n_m": (-0.01, 0.01)}
OUTPUTS = ("tip_y_m", "tip_z_m")
PARAMETERS = {
    "stiffness": (2e5, 1e5, 4e5, "Pa", "Young's modulus of the rubber"),
    "damping": (3.0, 1.0, 9.0, "s^-1", "rate at which motion fades"),
}
LENGTH_M, RADIUS_M, ELEMENTS, STEP_S = 0.2, 0.01, 8, 1e-3


class World(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    pass


class Couple(ea.NoForces):
    def __init__(self, now):
        self.now = now

    def apply_torques(self, system, time=0.0):
        system.external_torques[:, -1] += system.director_collection[..., -1] @ np.array([self.now[0], 0.0, 0.0])


def simulate(time_s, inputs, parameters, elements=ELEMENTS, step_s=STEP_S):
    modulus, world, now = parameters["stiffness"], World(), [0.0]
    axes = (np.zeros(3), np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]))
    rod = ea.CosseratRod.straight_rod(elements, *axes, LENGTH_M, RADIUS_M, 1070.0, youngs_modulus=modulus, shear_modulus=modulus / 3)
    world.append(rod)
    world.constrain(rod).using(ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
    world.add_forcing_to(rod).using(ea.GravityForces, acc_gravity=np.array([0.0, 0.0, -9.81]))
    world.add_forcing_to(rod).using(Couple, now)
    world.dampen(rod).using(ea.AnalyticalLinearDamper, uniform_damping_constant=parameters["damping"], time_step=step_s)
    world.finalize()
    stepper, clock, tips = ea.PositionVerlet(), 0.0, []
    for at in time_s:
        while clock < at - step_s / 2:
            now[0] = np.interp(clock, time_s, inputs["couple_n_m"])
            clock = stepper.step(world, np.float64(clock), np.float64(step_s))
        tips.append(rod.position_collection[1:, -1].copy())
    return {"tip_y_m": np.array(tips)[:, 0], "tip_z_m": np.array(tips)[:, 1]}
