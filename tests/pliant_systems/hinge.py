"""A hinge as a user's model, with recordings of it for the tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from pliant.records.design import Array

MODEL = """
import numpy as np

INPUTS = {"torque_n_m": (-2.0, 2.0)}
OUTPUTS = ("angle_rad", "speed_rad_s")
PARAMETERS = {"stiffness": (2.0, 1.0, 4.0, "N*m/rad", "stiffness of the hinge"), "damping": (0.1, 0.02, 0.5)}
MISSING = {"coulomb": (0.0, 0.0, 0.3, "N*m", "dry friction of the hinge")}


def simulate(time_s, inputs, parameters):
    k, c, f = (parameters[name] for name in ("stiffness", "damping", "coulomb"))
    torque, angle, speed = inputs["torque_n_m"], 0.0, 0.0
    found = np.zeros((len(time_s), 2))
    for n, dt in enumerate(np.diff(time_s) / 5):
        for j in range(5):
            u = torque[n] + (torque[n + 1] - torque[n]) * (j + 0.5) / 5
            speed += dt * (u - k * angle - c * speed - f * np.tanh(speed / 0.02)) / 0.05
            angle += dt * speed
        found[n + 1] = angle, speed
    return {"angle_rad": found[:, 0], "speed_rad_s": found[:, 1]}
"""
STUDY = "name: hinge\nmodel: {kind: python, file: hinge.py}\nmeasurements: {file: bench.csv}\n"
SIGMA_RAD = 2e-3


def torques(n: int = 200) -> list[tuple[Array, Array]]:
    """Return clock and torque of four runs: triangles of two sizes, steps, a swell."""
    clock = np.arange(n) * 0.02
    triangle = np.abs((clock / 1.6 + 0.75) % 1.0 - 0.5) * 4 - 1
    steps = np.repeat([0.0, 1.0, -1.0, 0.5, 0.0], -(-n // 5))[:n]
    return [
        (clock, 1.2 * triangle),
        (clock, 0.5 * triangle),
        (clock, steps),
        (clock, clock / clock[-1] * np.sin(5 * clock)),
    ]


def simulated(torque: Array, clock: Array, **values: float) -> dict[str, Array]:
    """Return the readings of the model's own function."""
    scope: dict[str, Callable[..., dict[str, Array]]] = {}
    exec(MODEL, scope)
    parameters = {"stiffness": 2.0, "damping": 0.1, "coulomb": 0.0, **values}
    return scope["simulate"](clock, {"torque_n_m": torque}, parameters)


def write_bench(folder: Path, seed: int = 0, n: int = 200, **hidden: float) -> Path:
    """Write study, model and a recording of the angle with hidden values; return the study's path."""
    rng = np.random.default_rng(seed)
    rows = ["run,time_s,torque_n_m,angle_rad"]
    for k, (clock, torque) in enumerate(torques(n)):
        angle = simulated(torque, clock, **hidden)["angle_rad"] + rng.normal(0.0, SIGMA_RAD, n)
        rows += [f"r{k},{t:.3f},{u:.6f},{a:.6f}" for t, u, a in zip(clock, torque, angle, strict=True)]
    (folder / "bench.csv").write_text("\n".join(rows) + "\n")
    (folder / "hinge.py").write_text(MODEL)
    study = folder / "study.yaml"
    study.write_text(STUDY)
    return study
