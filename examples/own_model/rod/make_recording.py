"""Write recording.csv: a finer rod whose couple arrives late, with noise. The lag is what the model does not know."""

from pathlib import Path

import numpy as np
from rod import simulate

LAG_S, NOISE_M, FINER = 0.06, 1e-3, {"elements": 16, "step_s": 2.5e-4}
rng = np.random.default_rng(1)
time_s = np.arange(0.0, 1.0, 0.02)
couples = (
    0.008 * np.sin(2 * np.pi * 1.5 * time_s),
    np.where(time_s < 0.5, 0.006, -0.006) * (time_s > 0.04),
    0.008 * time_s * np.sin(2 * np.pi * 2.5 * time_s),
)
rows = ["run,time_s,couple_n_m,tip_y_m,tip_z_m"]
for run, couple in enumerate(couples):
    fine = np.arange(0.0, 1.0, 0.001)
    arrived = np.zeros(len(fine))
    for k in range(1, len(fine)):
        arrived[k] = arrived[k - 1] + 0.001 / LAG_S * (np.interp(fine[k], time_s, couple) - arrived[k - 1])
    tip = simulate(fine, {"couple_n_m": arrived}, {"stiffness": 2e5, "damping": 3.0}, **FINER)
    read = [
        np.interp(time_s, fine, tip[name]) + rng.normal(0, NOISE_M, len(time_s))
        for name in ("tip_y_m", "tip_z_m")
    ]
    rows += [
        f"r{run},{t:.2f},{u:.6f},{y:.5f},{z:.5f}" for t, u, y, z in zip(time_s, couple, *read, strict=True)
    ]
Path("recording.csv").write_text("\n".join(rows) + "\n")
