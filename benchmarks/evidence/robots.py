"""The robots under test: their model, as a study, and the same numbers for the truth engines."""

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
TIPS = ("tip_x_m", "tip_y_m", "tip_z_m")


@dataclass(frozen=True)
class Robot:
    """Equal planar joints in a row; a module is a thin uniform rod, its joint at mid-module.

    Attributes:
        modules, length_m, mass_kg: number of modules; length and mass of each.
        outputs: what its bench reads: `angle_rad` is the sum of the joint angles, tips are in the world.
        second: readings of a second sensor, in the runs that have it.
        law: k_n, m_a, m_e, b_e of the study, and the whole truth of one that bends by joints.
        drive: the input's name; `drive_max` its largest value, which acts as `PRESSURE_MAX_PA` does.
    """

    name: str
    modules: int
    length_m: float
    mass_kg: float
    outputs: tuple[str, ...]
    second: tuple[str, ...] = ()
    drive: str = "pressure_pa"
    drive_max: float = PRESSURE_MAX_PA
    law: tuple[float, float, float, float] = (K_N, M_A, M_E, B_E)

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

    @property
    def tendon(self) -> bool:
        """A tendon drives it."""
        return self.drive.startswith("tendon")

    @property
    def payload_max_kg(self) -> float:
        """Mass at the tip whose weight takes `PAYLOAD_SHARE` of the first joint's peak torque, lying horizontally."""
        arm = (self.modules - 0.5) * self.length_m
        return round(PAYLOAD_SHARE * PEAK_TORQUE_N_M / GRAVITY_M_S2 / arm, 4)

    def study(
        self, name: str, gravity: tuple[float, float, float] | None = None, exact_law: bool = True
    ) -> str:
        """Return the study that the diagnoser gets: a stated law and a chain, without the truth.

        Args:
            gravity: wrongly stated gravity, m/s²; by default the study omits it, which means the usual one.
            exact_law: the law is the truth's up to `LAW_ERROR`; otherwise its error is not stated.
        """
        per_drive = PRESSURE_MAX_PA / self.drive_max
        k_n, m_a, m_e, b_e = self.law
        return STUDY.format(
            name=name,
            drive=self.drive,
            k_n=k_n * per_drive,
            m_a=m_a * per_drive,
            m_e=m_e,
            b_e=b_e,
            modules=self.modules,
            length=self.length_m * 1e3,
            mass=self.mass_kg * 1e3,
            task="{kind: free_bending, pressure: 15 kPa}" if not self.tendon else TENDON_TASK,
            gravity="" if gravity is None else ", gravity: [{:g}, {:g}, {:g}]".format(*gravity),
            law_error=LAW_ERROR if exact_law and LAW_ERROR_STATED else "",
        )


# Statement of the law's error in the study of an exact law, if a study has that key.
LAW_ERROR_STATED = True
LAW_ERROR = "law_error: 0.5 %\n"
PAYLOAD_SHARE = 0.3
TENDON_TASK = "{kind: tendon_finger, tendon_force: 9 N}"
STUDY = """\
pliant: 1
name: {name}
surrogate:
  kind: polynomial
  form: study
  odd: true
  actuation_name: {drive}
  coefficients: {{k_n: {k_n:g}, m_a: {m_a:g}, m_e: {m_e:g}, b_e: {b_e:g}}}
chain: {{modules: {modules}, module_length: {length:g} mm, module_mass: {mass:g} g{gravity}}}
physics: quasistatic
task: {task}
{law_error}"""

# Lying horizontally, the joint carries 16 % of its peak torque as weight; the chains' first joints 22 % and 21 %.
JOINT = Robot("joint", 1, 0.080, 0.040, ("angle_rad",), TIPS)
CHAIN = Robot("chain", 8, 0.011, 0.0016, ("angle_rad", *TIPS))
FOUR = Robot(
    "four", 4, 0.022, 0.0032, ("angle_rad", *TIPS), tuple(f"joint_{k}_angle_rad" for k in (1, 2, 3, 4))
)
FINGER = Robot(
    "finger", 3, 0.030, 0.004, tuple(f"joint_{k}_angle_rad" for k in (1, 2, 3)), TIPS, "tendon_force_n", 9.0
)
# An elastic rod with a tendon, which `rod_truth.py` follows: law and mass are fitted to it at rest.
ROD = Robot("rod", 1, 0.080, 0.0040021, ("angle_rad",), law=(1.471785e-6, 2.18347e-8, -6.69920e-4, 0.0279465))
ROBOTS = {robot.name: robot for robot in (JOINT, CHAIN, FOUR, FINGER)}
