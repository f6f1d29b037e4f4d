"""Write recording.csv: the robot in steps of 0.25 ms whose sheath has friction, with a camera's noise."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
from robot import robot, simulate

NOISE_M, HIDDEN = 2e-3, {"stiffness": 1.0, "sheath_friction": 0.25}
rng = np.random.default_rng(1)
time_s, fine, finer = np.arange(0.0, 2.0, 0.02), np.arange(0.0, 1.981, 0.001), robot(2)
tensions = (
    0.9 * (1 - np.cos(2 * np.pi * time_s)),
    np.where(time_s < 1.0, 1.6, 0.6) * (time_s > 0.04),
    1.5 * np.abs(np.sin(4.0 * time_s)),
)
rows = ["run,time_s,tension_n,tip_x_m,tip_y_m"]
for run, tension in enumerate(tensions):
    tip = simulate(jnp.asarray(fine), {"tension_n": jnp.interp(fine, time_s, tension)}, HIDDEN, finer)
    read = [
        np.interp(time_s, fine, tip[name]) + rng.normal(0, NOISE_M, len(time_s))
        for name in ("tip_x_m", "tip_y_m")
    ]
    rows += [
        f"r{run},{t:.2f},{u:.4f},{x:.5f},{y:.5f}" for t, u, x, y in zip(time_s, tension, *read, strict=True)
    ]
Path("recording.csv").write_text("\n".join(rows) + "\n")
