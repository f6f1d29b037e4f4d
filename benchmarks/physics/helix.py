"""The study's helical actuator as a chain: 22 spherical joints in four segments turned about the chain axis.

The law of the main axis y is the study's form, fitted by least squares to its FEM table where
`../shared/data/reference` is there; elsewhere the coefficients of that fit are stated below. The laws of z
and of the twist x are stated: the study's tables of them are not public. Tip loads are forces. Hinges stand on
the axis of the modules, so that a rod is the same body; in examples/helix they stand beside it, as in the study.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from benchmarks.output import REFERENCE, reference_table

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.pipeline.chain import Segment, build_chain, rigid_rod, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Design
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointLaw
from pliant.records.rollout import Inputs
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw
from pliant_plugins.surrogates.polynomial.study import fit_study, study_law

FEM_TABLE = REFERENCE / "helical_y_fem_R5.66_l4.72.csv"
PRESSURE_PA = 15e3
LOADS_KG = (0.0, 0.010, 0.020, 0.050)
G_M_S2 = 9.81

# Least squares on FEM_TABLE, to six digits; used where the table is absent, and checked where it is there.
FITTED_Y = StudyCoefficients(k_n=2.42685e-07, m_a=-8.94493e-08, m_e=8.18381e-3, b_e=6.59128e-3)
FITTED_BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.51432, 0.84926]]))
# Stated, as in examples/helix/helix.yaml: second bending axis, and twist.
STATED_Z = StudyCoefficients(k_n=0.0, m_a=0.0, m_e=0.010, b_e=0.015)
STATED_X = StudyCoefficients(k_n=0.0, m_a=0.0, m_e=0.0, b_e=0.030)


class SegmentSpec(NamedTuple):
    """Equal modules in a row."""

    modules: int
    rotation_rad: float
    length_m: float
    mass_kg: float
    radius_m: float


SEGMENTS = (
    SegmentSpec(5, 0.00, 4.72e-3, 0.868e-3, 5.66e-3),
    SegmentSpec(5, 0.85, 4.72e-3, 0.868e-3, 5.66e-3),
    SegmentSpec(6, 1.44, 4.77e-3, 0.892e-3, 5.71e-3),
    SegmentSpec(6, 2.45, 4.77e-3, 0.892e-3, 5.71e-3),
)
DENSITY_KG_M3 = 1150.0
END_LENGTH_M, END_RADIUS_M = 6e-3, 4e-3
END_MASS_KG = DENSITY_KG_M3 * math.pi * END_RADIUS_M**2 * END_LENGTH_M
DESCENT_RAD = math.radians(28.0)


def read_table() -> FemDataset | None:
    """The published states of one module, or None where the folder is absent.

    The joint angle is twice the half-module angle of the table.
    """
    column = reference_table(FEM_TABLE.name)
    if column is None:
        return None
    n = len(column["pressure_pa"])
    unknown = np.full(n, np.nan)
    return FemDataset(
        design=Design("published", {}),
        axis="y",
        actuation_name="pressure_pa",
        actuation=column["pressure_pa"],
        angle_rad=2.0 * column["half_angle_rad"],
        moment_n_m=column["moment_n_m"],
        dmoment_dp=unknown,
        dmoment_du=unknown,
        energy_j=unknown,
        branch=np.full(n, "constrained"),
        status=np.full(n, "ok"),
        role=np.full(n, "fit"),
    )


def helix_law() -> AxesLaw:
    """The law of one module; outside the box of the data, y goes on linearly."""
    table = read_table()
    if table is None:
        print(f"({FEM_TABLE} is absent: the y law is stated, not fitted)")
        y, box = FITTED_Y, FITTED_BOX
    else:
        y = fit_study(table, odd=False)
        box = Domain(
            np.array([table.actuation.min(), table.actuation.max()]),
            np.array([[table.angle_rad.min(), table.angle_rad.max()]]),
        )
    everywhere = Domain.unbounded(1)
    return AxesLaw(
        (
            study_law(STATED_X, True, everywhere, axis="x"),
            study_law(y, False, box, axis="y"),
            study_law(STATED_Z, True, everywhere, axis="z"),
        )
    )


def linear_law(pressure_pa: float = PRESSURE_PA, cells: int = 1) -> AxesLaw:
    """Linear in u: y has the free angle of `helix_law` at this pressure and its slope there; z and x keep b_e.

    With `cells`, the law of a module cut in so many equal joints: each is stiffer and bends less under the same effort.
    """
    y = helix_law().laws[1]
    free = free_angle(y, pressure_pa)
    slope = -float(y.evaluate(np.array([pressure_pa]), np.array([[free]])).dtau_du[0, 0, 0])
    linear = StudyCoefficients(k_n=slope * free / pressure_pa, m_a=0.0, m_e=0.0, b_e=cells * slope)
    everywhere = Domain.unbounded(1)
    x, z = (StudyCoefficients(k_n=0.0, m_a=0.0, m_e=0.0, b_e=cells * law.b_e) for law in (STATED_X, STATED_Z))
    laws = [study_law(law, False, everywhere, axis=axis) for law, axis in ((x, "x"), (linear, "y"), (z, "z"))]
    return AxesLaw((laws[0], laws[1], laws[2]))


def free_angle(law: PolynomialLaw, pressure_pa: float) -> float:
    """Where a one-axis law has no effort, by Newton's method from the straight module."""
    u = 0.0
    for _ in range(50):
        effort = law.evaluate(np.array([pressure_pa]), np.array([[u]]))
        u -= float(effort.tau[0, 0] / effort.dtau_du[0, 0, 0])
    return u


def helix(
    law: JointLaw | None = None, specs: Sequence[SegmentSpec] = SEGMENTS, end_cylinder: bool = True
) -> ChainModel:
    """The chain. Its axis leaves the base 28° below world +x; positive pressure bends the first segment upward."""
    law = law or helix_law()
    segments = [
        Segment(rod_module(law, s.length_m, s.mass_kg, s.radius_m), s.modules, s.rotation_rad) for s in specs
    ]
    if end_cylinder:
        segments.append(Segment(rigid_rod(END_LENGTH_M, END_MASS_KG, END_RADIUS_M)))
    direction = (math.cos(DESCENT_RAD), 0.0, -math.sin(DESCENT_RAD))
    # build_chain takes the modules from the segments; of the config it reads base, gravity and loads.
    return build_chain(ChainConfig(modules=1, base=BaseConfig(direction=direction)), segments)


def cut(cells: int, specs: Sequence[SegmentSpec] = SEGMENTS) -> tuple[SegmentSpec, ...]:
    """Segments with every module cut in equal parts, for `linear_law(cells=cells)`."""
    return tuple(
        s._replace(modules=s.modules * cells, length_m=s.length_m / cells, mass_kg=s.mass_kg / cells)
        for s in specs
    )


def of_size(modules: int) -> tuple[SegmentSpec, ...]:
    """Segments as equal as possible with this many modules of the study's sizes in all."""
    counts = [modules // 4 + (1 if k >= 4 - modules % 4 else 0) for k in range(4)]
    return tuple(s._replace(modules=count) for s, count in zip(SEGMENTS, counts, strict=True))


def inputs(load_kg: float, pressure_pa: float = PRESSURE_PA) -> Inputs:
    """Pressure, and the weight of a tip load as a force."""
    return Inputs({"pressure_pa": pressure_pa}, tip_force_n=np.array([0.0, 0.0, -load_kg * G_M_S2]))
