"""The robots under test: what the model says of them, as a study, and the same numbers for the truth engines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PRESSURE_MAX_PA = 15e3
GRAVITY_M_S2 = 9.81
# τ(p, u) = k_n p + m_a p u − (m_e u|u|/2 + b_e u), the published law of a bending module, odd form.
K_N, M_A, M_E, B_E = 1.637e-6, -1.704e-6, 0.1012, 0.0245
PEAK_TORQUE_N_M = K_N * PRESSURE_MAX_PA


@dataclass(frozen=True)
class Robot:
    """Equal planar joints in a row; a module is a thin uniform rod, its joint at mid-module.

    Attributes:
        modules, length_m, mass_kg: number of modules; length and mass of each.
        outputs: what its bench reads: `angle_rad` is the sum of the joint angles, tips are in the world.
    """

    name: str
    modules: int
    length_m: float
    mass_kg: float
    outputs: tuple[str, ...]

    @property
    def piece_lengths_m(self) -> Array:
        """(n,) length of the rigid piece that hangs on each joint; the piece before joint 1 is half a module."""
        lengths = np.full(self.modules, self.length_m)
        lengths[-1] /= 2
        return lengths

    @property
    def piece_masses_kg(self) -> Array:
        """(n,) mass of the rigid piece that hangs on each joint."""
        return self.mass_kg * self.piece_lengths_m / self.length_m

    def study(self, name: str) -> str:
        """The study that the diagnoser gets: a stated law and a chain, nothing of the truth."""
        return STUDY.format(
            name=name,
            k_n=K_N,
            m_a=M_A,
            m_e=M_E,
            b_e=B_E,
            modules=self.modules,
            length=self.length_m * 1e3,
            mass=self.mass_kg * 1e3,
        )


STUDY = """\
pliant: 1
name: {name}
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {{k_n: {k_n:g}, m_a: {m_a:g}, m_e: {m_e:g}, b_e: {b_e:g}}}
chain: {{modules: {modules}, module_length: {length:g} mm, module_mass: {mass:g} g}}
physics: quasistatic
task: {{kind: free_bending, pressure: 15 kPa}}
"""

# Lying horizontally, the joint carries 16 % of its peak torque as weight; the chain's first joint 22 %.
JOINT = Robot("joint", 1, 0.080, 0.040, ("angle_rad",))
CHAIN = Robot("chain", 8, 0.011, 0.0016, ("angle_rad", "tip_x_m", "tip_z_m"))
ROBOTS = {robot.name: robot for robot in (JOINT, CHAIN)}


def readings(robot: Robot, angles: Array, base_pitch_rad: Array) -> dict[str, Array]:
    """What an ideal bench reads of joint angles (t, n): bending positive toward world +x, base pitch about world y.

    A base pitch φ turns every piece from −z toward −x: its angle from the vertical is Σ u − φ.
    """
    turned = np.cumsum(angles, axis=1) - base_pitch_rad[:, None]
    first, lengths = robot.length_m / 2, robot.piece_lengths_m
    every = {
        "angle_rad": angles.sum(axis=1),
        "tip_x_m": -first * np.sin(base_pitch_rad) + np.sin(turned) @ lengths,
        "tip_z_m": -first * np.cos(base_pitch_rad) - np.cos(turned) @ lengths,
    }
    return {name: every[name] for name in robot.outputs}
