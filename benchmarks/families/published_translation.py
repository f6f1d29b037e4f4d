"""Published FEM of the translational bellow, r 5, R 8, t 1.5, l 10 mm, and what it says by itself.

Source: the public repository of Yao, Howard, Maiolino (2026), yaoyao199709/soft-robot-task-driven-design at b1af917,
surrogate/matlab/translation/model_analysis/translation_stiffness.m (COMSOL; material and boundary conditions are not
stated). Every second pressure of the free curves, six of thirty forces at three of fifteen pressures, and three of
forty-one states of each chain are typed in here.

Closed: pressure pushes on both inner ends; open: on the wall alone. Extensions in mm, energies in mJ, volumes in mm³.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from pliant.records.design import Array

KPA = np.arange(16.0)
CLOSED_MM = (
    0.0, 0.67454, 1.2052, 1.6406, 2.0091, 2.3284, 2.6103, 2.8627,
    3.0918, 3.3019, 3.4963, 3.6778, 3.8485, 4.0101, 4.1641, 4.3117,
)  # fmt: skip
CLOSED_MJ = (
    0.0, 0.064691, 0.22434, 0.44862, 0.7225, 1.0382, 1.392, 1.7822,
    2.2086, 2.6718, 3.1733, 3.7151, 4.2994, 4.9291, 5.6075, 6.3383,
)  # fmt: skip
OPEN_MM = (
    0.0, 0.46432, 0.84448, 1.1647, 1.4403, 1.6819, 1.8967, 2.0900,
    2.2657, 2.4270, 2.5762, 2.7152, 2.8457, 2.9689, 3.0859, 3.1976,
)  # fmt: skip
OPEN_MJ = (
    0.0, 0.036224, 0.13122, 0.27204, 0.45174, 0.66665, 0.91495, 1.196,
    1.51, 1.8577, 2.24, 2.6585, 3.115, 3.6113, 4.1499, 4.7333,
)  # fmt: skip
OPEN_MM3 = (
    1584.4, 1685.4, 1770.8, 1845.5, 1912.6, 1974.1, 2031.5, 2085.7,
    2137.5, 2187.6, 2236.3, 2284.1, 2331.2, 2377.9, 2424.4, 2471.0,
)  # fmt: skip
# Closed, pushed back by so many N at a constant pressure (Pa): extension in mm.
FORCES_N = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
PUSHED_MM = {
    5e3: (1.7606, 1.117, 0.37158, -0.51763, -1.6209, -3.0577),
    10e3: (3.1081, 2.6930, 2.2460, 1.7601, 1.2262, 0.63177),
    15e3: (4.0025, 3.6803, 3.3432, 2.9890, 2.6153, 2.2188),
}
# Chains of so many modules solved as one body at 10 kPa, pushed back by so many N: extension of the chain in mm.
MODULES = np.arange(2, 11)
CHAIN_PA = 10e3
CHAINS_MM = {
    0.0: (5.9711, 9.3726, 12.771, 16.172, 19.493, 22.866, 26.239, 29.676, 32.924),
    0.5: (3.9353, 6.3161, 8.6949, 11.075, 13.381, 15.737, 18.090, 20.494, 22.730),
    1.0: (1.4706, 2.5740, 3.6771, 4.7800, 5.8342, 6.9295, 8.0022, 9.1068, 10.101),
}
# The end's area as the script states it, to take its thrust off: a circle of 4.00 mm.
STATED_END_MM2 = 50.263


def end_area_mm2() -> Array:
    """The area (15,) that pressure does not push on where ends are open, by energy: ∫ p dV − U = A ∫ p dx."""
    pressure_mpa, x, volume = 1e-3 * KPA, np.array(OPEN_MM), np.array(OPEN_MM3)
    by_volume = CubicSpline(volume, pressure_mpa).antiderivative()
    by_extension = CubicSpline(x, pressure_mpa).antiderivative()
    missing = by_volume(volume) - by_volume(volume[0]) - np.array(OPEN_MJ)
    return np.asarray(missing[1:] / by_extension(x)[1:])


def chain_slopes() -> dict[float, tuple[float, float]]:
    """By force: what a further module adds, and what the chain's two ends take off (mm), by least squares."""
    found = {force: np.polyfit(MODULES, chain, 1) for force, chain in CHAINS_MM.items()}
    return {force: (float(slope), float(-offset)) for force, (slope, offset) in found.items()}
