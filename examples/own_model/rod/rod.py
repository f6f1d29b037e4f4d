"""A hanging rubber rod that a couple at its tip bends, by PyElastica (pip install pyelastica)."""

import elastica as ea
import numpy as np

INPUTS = {"couple_n_m": (-0.01, 0.01)}
OUTPUTS = ("tip_y_m", "tip_z_m")
PARAMETERS = {"stiffness": (2e5, 1e5, 4e5, "Pa", "Young's modulus"), "damping": (3.0, 1.0, 9.0, "s^-1")}
POSE = {"start": np.zeros(3), "direction": np.array([0, 0, -1.0]), "normal": np.array([1.0, 0, 0])}
SIZE = {"base_length": 0.2, "base_radius": 0.01, "density": 1070.0}
CLAMP = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}


class World(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping): ...


class Couple(ea.NoForces):
    couple_n_m = 0.0

    def apply_torques(self, system, time=0.0):
        system.external_torques[:, -1] += system.director_collection[..., -1] @ [self.couple_n_m, 0.0, 0.0]


def simulate(time_s, inputs, parameters, elements=8, step_s=1e-3):
    world, clock, tips = World(), 0.0, []
    stiff = {"youngs_modulus": parameters["stiffness"], "shear_modulus": parameters["stiffness"] / 3}
    rod = ea.CosseratRod.straight_rod(elements, **POSE, **SIZE, **stiff)
    world.append(rod)
    world.constrain(rod).using(ea.OneEndFixedBC, **CLAMP)
    world.add_forcing_to(rod).using(ea.GravityForces, acc_gravity=np.array([0, 0, -9.81]))
    world.add_forcing_to(rod).using(Couple)
    damper = {"uniform_damping_constant": parameters["damping"], "time_step": step_s}
    world.dampen(rod).using(ea.AnalyticalLinearDamper, **damper)
    world.finalize()
    for at in time_s:
        while clock < at - step_s / 2:
            Couple.couple_n_m = np.interp(clock, time_s, inputs["couple_n_m"])
            clock = ea.PositionVerlet().step(world, np.float64(clock), np.float64(step_s))
        tips.append(rod.position_collection[1:, -1].copy())
    return dict(zip(OUTPUTS, np.array(tips).T, strict=True))
