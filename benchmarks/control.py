"""Tracking with hidden robots: controllers that know the nominal model, in robots drawn from a study's posterior.

python -m benchmarks.control        prints, and writes benchmarks/out/control.json

Each of 20 robots tracks two paths of 4 s; the tip is read with the posterior's noise, 50 ms late. Errors are root mean
squares over an episode of the true tip from its target. No policy is trained here.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import gymnasium
import numpy as np
from benchmarks.output import make_parser, write

from pliant_plugins.envs.baselines import BASELINES, score
from pliant_plugins.envs.registration import register

WORLDS, SEED, PATHS = 20, 7, 2
# The finger of docs/conventions.md with what an evidence loop may have found, and how sure it is.
STUDY = """
pliant: 1
name: sure-finger
surrogate:
  kind: polynomial
  form: study
  odd: true
  axis: y
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 8, module_length: 11 mm, module_mass: 2 g, module_radius: 7 mm}
physics: {kind: mujoco, timestep: 10 ms, joint_damping: 1e-3}
task: {kind: free_bending, pressure: 15 kPa}
effects: [{kind: stiffness, factor: 1.1}, {kind: actuation_gain, gain: 0.95}, {kind: viscous_damping, time: 0.1 s}]
posterior:
  parameters: [stiffness.factor, actuation_gain.gain, viscous_damping.time_s]
  values: [1.1, 0.95, 0.1]
  sd: [0.1, 0.05, 0.03]
  correlation: [[1, 0.3, 0], [0.3, 1, 0], [0, 0, 1]]
  noise: {angle_rad: 0.01}
  left: {angle_rad: 0.01}
  freedom: 100
"""


def main() -> None:
    make_parser(__doc__).parse_args()
    register()
    with tempfile.TemporaryDirectory() as place:
        study = Path(place) / "study.yaml"
        study.write_text(STUDY)
        env = gymnasium.make(
            "pliant/Track-v0", study=study, worlds=WORLDS, world_seed=SEED, delay_s=0.05, episode_s=4.0
        ).unwrapped
        found = {}
        for name, kind in BASELINES.items():
            controller = kind(env)
            errors = [score(env, controller, range(PATHS), world=k) for k in range(WORLDS)]
            found[name] = 1e3 * np.array(errors).mean(axis=1)
            told = f"median {np.median(found[name]):.2f}, worst {found[name].max():.2f}"
            nominal = 1e3 * score(env, controller, range(PATHS), world=-1).mean()
            print(f"{name}: {told} mm of {WORLDS} robots; {nominal:.2f} mm in the nominal one")
    write("control", {"errors_mm": {name: values.tolist() for name, values in found.items()}})


if __name__ == "__main__":
    main()
