"""A pendulum on a spring with a damper, driven by a torque."""

import numpy as np

INPUTS = {"torque_n_m": (-2.0, 2.0)}
OUTPUTS = ("angle_rad",)
PARAMETERS = {
    "stiffness": (2.0, 1.0, 4.0, "N*m/rad", "stiffness of the spring"),
    "damping": (0.1, 0.02, 0.5, "N*m*s/rad", "damping of the bearing"),
}
MISSING = {"coulomb": (0.0, 0.0, 0.3, "N*m", "dry friction of the bearing")}
INERTIA_KG_M2, PARTS = 0.05, 5


def simulate(time_s, inputs, parameters):
    stiffness, damping, coulomb = (parameters[name] for name in ("stiffness", "damping", "coulomb"))
    torque, angle, speed = inputs["torque_n_m"], 0.0, 0.0
    angles = np.zeros(len(time_s))
    for n, step in enumerate(np.diff(time_s) / PARTS):
        for k in range(PARTS):
            drive = torque[n] + (torque[n + 1] - torque[n]) * (k + 0.5) / PARTS
            friction = coulomb * np.tanh(speed / 0.02)
            speed += step * (drive - stiffness * angle - damping * speed - friction) / INERTIA_KG_M2
            angle += step * speed
        angles[n + 1] = angle
    return {"angle_rad": angles}
