"""Smallest Python model: a hinge with a spring and a damper, which may have dry friction."""

import numpy as np

INPUTS = {"torque_n_m": (-2.0, 2.0)}
OUTPUTS = ("angle_rad",)
PARAMETERS = {"stiffness": (2.0, 1.0, 4.0, "N*m/rad", "stiffness of the hinge's spring")}
MISSING = {"coulomb": (0.0, 0.0, 0.3, "N*m", "dry friction of the hinge")}
INERTIA, DAMPING, STICKING, PARTS = 0.05, 0.1, 0.02, 5


def simulate(time_s, inputs, parameters):  # type: ignore[no-untyped-def]
    """Return the angle by semi-implicit Euler, in `PARTS` steps from sample to sample."""
    torque, angle, speed = inputs["torque_n_m"], 0.0, 0.0
    found = np.zeros(len(time_s))
    for n, step in enumerate(np.diff(time_s) / PARTS):
        for k in range(PARTS):
            drive = torque[n] + (torque[n + 1] - torque[n]) * (k + 0.5) / PARTS
            friction = parameters["coulomb"] * np.tanh(speed / STICKING)
            speed += step * (drive - parameters["stiffness"] * angle - DAMPING * speed - friction) / INERTIA
            angle += step * speed
        found[n + 1] = angle
    return {"angle_rad": found}
