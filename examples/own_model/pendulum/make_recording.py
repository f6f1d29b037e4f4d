"""Write recording.csv: the pendulum with dry friction, which the model leaves out, integrated finely, with noise."""

from pathlib import Path

import numpy as np
from pendulum import simulate

NOISE_RAD, HIDDEN = 5e-3, {"stiffness": 2.0, "damping": 0.1, "coulomb": 0.12}
rng = np.random.default_rng(0)
time_s, fine = np.arange(0.0, 4.0, 0.02), np.arange(0.0, 3.981, 0.002)
triangle = np.abs((time_s / 1.6 + 0.75) % 1.0 - 0.5) * 4 - 1
torques = (
    1.2 * triangle,
    0.5 * triangle,
    np.array([0.0, 1.0, -1.0, 0.5, 0.0])[np.minimum(time_s / 0.8, 4).astype(int)],
    0.25 * time_s * np.sin(5 * time_s),
)
rows = ["run,time_s,torque_n_m,angle_rad"]
for run, torque in enumerate(torques):
    angle = simulate(fine, {"torque_n_m": np.interp(fine, time_s, torque)}, HIDDEN)["angle_rad"]
    read = np.interp(time_s, fine, angle) + rng.normal(0.0, NOISE_RAD, len(time_s))
    rows += [f"r{run},{t:.2f},{u:.5f},{a:.5f}" for t, u, a in zip(time_s, torque, read, strict=True)]
Path("recording.csv").write_text("\n".join(rows) + "\n")
