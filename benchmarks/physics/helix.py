"""The study's helical actuator as a chain: 22 spherical joints in four segments turned about the chain axis.

The law of the main axis y is the published form, fitted by least squares to its FEM table if `../shared/data/reference`
exists; otherwise the coefficients of that fit are stated below. The laws of z and of the twist x are stated: the
study's tables of them are not public. Tip loads are forces. Hinges are on the axis of the modules, so that a rod is the
same body; in examples/helix they are off the axis, as in the study.

The module also has what benchmarks share: the history of the published run, a law in a wrong frame, random designs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from benchmarks.output import REFERENCE, reference_table

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.interfaces.physics import Case, PhysicsBackend, Run
from pliant.mechanics.rotations import left_jacobian, left_jacobian_transpose_slope
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.pipeline.chain import Segment, build_chain, rigid_rod, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Array, Design
from pliant.records.fem import FemDataset
from pliant.records.history import History
from pliant.records.law import Domain, Effort, JointLaw, LawRecord
from pliant.records.rollout import Inputs
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw, study_law
from pliant_plugins.surrogates.polynomial.study import fit_study

# Of the published run: 1 s of ramp and 1 s of hold.
RAMP_S, DURATION_S = 1.0, 2.0
FEM_TABLE = REFERENCE / "helical_y_fem_R5.66_l4.72.csv"
PRESSURE_PA = 15e3
LOADS_KG = (0.0, 0.010, 0.020, 0.050)
G_M_S2 = 9.81

# Least squares on FEM_TABLE, to six digits; used if the table is absent, and checked if it exists.
FITTED_Y = StudyCoefficients(k_n=2.42685e-07, m_a=-8.94493e-08, m_e=8.18381e-3, b_e=6.59128e-3)
FITTED_BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.51432, 0.84926]]))
# Stated, of the size that examples/helix/helix.yaml has from FEM: second bending axis, and twist.
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
    """Return the published states of one module, or None without the folder.

    The joint angle is twice the half-module angle of the table.
    """
    column = reference_table(FEM_TABLE.name)
    if column is None:
        return None
    n = len(column["pressure_pa"])
    unknown = np.full(n, np.nan)
    states = (column["pressure_pa"], 2.0 * column["half_angle_rad"], column["moment_n_m"])
    words = (np.full(n, word) for word in ("constrained", "ok", "fit"))
    return FemDataset(Design("published", {}), "y", "pressure_pa", *states, *[unknown] * 3, *words)


def helix_law() -> AxesLaw:
    """Return the law of one module; outside the box of the data, y continues linearly."""
    table = read_table()
    if table is None:
        print(f"({FEM_TABLE} is absent: the y law is stated, not fitted)")
        y, box = FITTED_Y, FITTED_BOX
    else:
        y = fit_study(table, odd=False)
        p, u = table.actuation, table.angle_rad
        box = Domain(np.array([p.min(), p.max()]), np.array([[u.min(), u.max()]]))
    return _three_axes(STATED_X, study_law(y, False, box, axis="y"), STATED_Z)


def _three_axes(x: StudyCoefficients, y: PolynomialLaw, z: StudyCoefficients, odd: bool = True) -> AxesLaw:
    everywhere = Domain.unbounded(1)
    return AxesLaw((study_law(x, odd, everywhere, axis="x"), y, study_law(z, odd, everywhere, axis="z")))


def linear_law(pressure_pa: float = PRESSURE_PA, cells: int = 1) -> AxesLaw:
    """Return a law linear in u: y has the free angle of `helix_law` at this pressure and its slope; z, x keep b_e.

    `cells` is the number of equal joints that a module is divided into: each is stiffer and bends less under the same
    effort.
    """
    y = helix_law().laws[1]
    free = free_angle(y, pressure_pa)
    slope = -float(y.evaluate(np.array([pressure_pa]), np.array([[free]])).dtau_du[0, 0, 0])
    linear = StudyCoefficients(k_n=slope * free / pressure_pa, m_a=0.0, m_e=0.0, b_e=cells * slope)
    x, z = (StudyCoefficients(k_n=0.0, m_a=0.0, m_e=0.0, b_e=cells * law.b_e) for law in (STATED_X, STATED_Z))
    return _three_axes(x, study_law(linear, False, Domain.unbounded(1), axis="y"), z, odd=False)


def free_angle(law: PolynomialLaw, pressure_pa: float) -> float:
    """Return the angle at which a one-axis law has no effort, by Newton's method from the straight module."""
    u = 0.0
    for _ in range(50):
        effort = law.evaluate(np.array([pressure_pa]), np.array([[u]]))
        u -= float(effort.tau[0, 0] / effort.dtau_du[0, 0, 0])
    return u


def helix(
    law: JointLaw | None = None, specs: Sequence[SegmentSpec] = SEGMENTS, end_cylinder: bool = True
) -> ChainModel:
    """Build the chain. Its axis leaves the base 28° below world +x; positive pressure bends its start upward."""
    segments = _segments(law or helix_law(), specs)
    if end_cylinder:
        segments.append(Segment(rigid_rod(END_LENGTH_M, END_MASS_KG, END_RADIUS_M)))
    direction = (math.cos(DESCENT_RAD), 0.0, -math.sin(DESCENT_RAD))
    # build_chain takes the modules from the segments; of the config it reads base, gravity and loads.
    return build_chain(ChainConfig(modules=1, base=BaseConfig(direction=direction)), segments)


def _segments(law: JointLaw, specs: Sequence[SegmentSpec]) -> list[Segment]:
    modules = (rod_module(law, s.length_m, s.mass_kg, s.radius_m) for s in specs)
    return [Segment(one, s.modules, s.rotation_rad) for one, s in zip(modules, specs, strict=True)]


def cut(cells: int, specs: Sequence[SegmentSpec] = SEGMENTS) -> tuple[SegmentSpec, ...]:
    """Return segments with every module divided into equal parts, for `linear_law(cells=cells)`."""
    return tuple(
        s._replace(modules=s.modules * cells, length_m=s.length_m / cells, mass_kg=s.mass_kg / cells)
        for s in specs
    )


def sized_segments(modules: int) -> tuple[SegmentSpec, ...]:
    """Return segments as equal as possible with this total number of modules of the study's sizes."""
    counts = [modules // 4 + (1 if k >= 4 - modules % 4 else 0) for k in range(4)]
    return tuple(s._replace(modules=count) for s, count in zip(SEGMENTS, counts, strict=True))


def inputs(load_kg: float, pressure_pa: float = PRESSURE_PA) -> Inputs:
    """Return pressure, and the weight of a tip load as a force."""
    return Inputs({"pressure_pa": pressure_pa}, tip_force_n=np.array([0.0, 0.0, -load_kg * G_M_S2]))


class UnmappedLaw(JointLaw):
    """τ'(p, u) = J(u)ᵀ τ(p, u): the effort of `inner`, taken for a torque in the child's or parent's frame.

    The published formulation hands τ(u), component by component, to the engine as a torque. In joint coordinates
    that is the effort Jᵀ τ with J the Jacobian of the rotation vector in the frame in which the torque acts, which
    derives from no energy. As a law it runs in every engine through the engine's own, correct map.
    """

    joint = "spherical"

    def __init__(self, inner: JointLaw, frame: Literal["child", "parent"]) -> None:
        self.inner, self.frame, self.axes, self.domain = inner, frame, inner.axes, inner.domain
        self.actuation_name = inner.actuation_name

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return effort and exact slopes; ∂τ'/∂u is not symmetric."""
        effort = self.inner.evaluate(actuation, deformation)
        side = 1.0 if self.frame == "parent" else -1.0
        transposed = left_jacobian(side * np.asarray(deformation, float)).transpose(0, 2, 1)
        turning = side * left_jacobian_transpose_slope(side * deformation, effort.tau)
        return Effort(
            np.einsum("nij,nj->ni", transposed, effort.tau),
            np.einsum("nij,nj->ni", transposed, effort.dtau_dp),
            transposed @ effort.dtau_du + turning,
        )

    def record(self) -> LawRecord:
        inner = self.inner.record()
        return LawRecord("unmapped_benchmark", {"frame": self.frame, **inner.values}, inner.arrays)


@dataclass(frozen=True, eq=False)
class Ended:
    """The final state of a run, and its CPU time."""

    angles_rad: Array
    markers_m: Array
    cpu_s: float


def law_efforts(law: JointLaw) -> Callable[[float, Array], Array]:
    """Return τ (n, 3) at a pressure and joint angles (n, 3), all joints in one call."""
    return lambda pressure_pa, angles: law.evaluate(np.full(len(angles), pressure_pa), angles).tau


def run_history(backend: PhysicsBackend, chain: ChainModel, load_kg: float, step_s: float) -> Ended:
    """Run 1 s of pressure ramp, then a hold, from the straight chain, step by step; build time is excluded."""
    with backend.build(chain) as simulation:
        start = time.process_time()
        for k in range(round(DURATION_S / step_s)):
            pressure = PRESSURE_PA * min((k + 1) * step_s / RAMP_S, 1.0)
            simulation.apply(inputs(load_kg, pressure))
            simulation.step(step_s)
        cpu_s = time.process_time() - start
        return Ended(simulation.snapshot().position, simulation.markers(), cpu_s)


def roll_history(backend: PhysicsBackend, chain: ChainModel, load_kg: float, step_s: float) -> Ended:
    """Run the history in one call of the engine, in compiled code if possible; the time includes building the model."""
    time_s: Array = step_s * np.arange(round(DURATION_S / step_s) + 1.0)
    still = inputs(load_kg)
    pressure = PRESSURE_PA * np.minimum(time_s / RAMP_S, 1.0)
    history = History.from_arrays({"pressure_pa": pressure}, time_s, tip_force_n=still.tip_force_n)
    start = time.process_time()
    (rollout,) = backend.rollout_batch((Run(chain, history),))
    cpu_s = time.process_time() - start
    return Ended(rollout.joint_angles[-1], rollout.markers_m[-1], cpu_s)


def residual_n_m(chain: ChainModel, angles_rad: Array, load_kg: float) -> float:
    """Return largest unbalanced effort of a state by the common statics, N·m."""
    loads = Loads.from_inputs(chain, inputs(load_kg))
    return float(np.abs(ChainStatics(chain).residual(angles_rad, loads)).max())


def random_cases(count: int, seed: int = 0, modules: tuple[int, int] = (6, 60)) -> list[Case]:
    """Draw random designs: number of modules, 1 to 6 segments, pose, law, pressure, tip load."""
    random = np.random.default_rng(seed)
    base = helix_law().laws[1]
    return [_case(random, base, modules) for _ in range(count)]


def _case(random: np.random.Generator, base: PolynomialLaw, modules: tuple[int, int]) -> Case:
    law = _law(random, base)
    specs = _specs(random, int(random.integers(*modules, endpoint=True)), int(random.integers(1, 7)))
    rod = Segment(rigid_rod(float(random.uniform(0, 10e-3)) + 1e-3, 0.4e-3))
    segments = [*_segments(law, specs), rod]
    direction = random.normal(size=3)
    config = ChainConfig(modules=1, base=BaseConfig(direction=tuple(float(x) for x in direction)))
    force = np.array([0.0, 0.0, -G_M_S2 * random.choice([0.0, random.uniform(0.0, 0.06)])])
    return Case(build_chain(config, segments), Inputs({"pressure_pa": PRESSURE_PA * random.random()}, force))


def _specs(random: np.random.Generator, modules: int, segments: int) -> list[SegmentSpec]:
    counts = 1 + random.multinomial(modules - segments, np.full(segments, 1 / segments))
    length = float(random.uniform(4e-3, 6e-3))
    rotations = np.concatenate([[0.0], np.cumsum(random.uniform(-math.pi / 2, math.pi / 2, segments - 1))])
    mass = 0.88e-3 * length / 4.72e-3
    return [
        SegmentSpec(int(count), float(turn), length, mass, 5.7e-3)
        for count, turn in zip(counts, rotations, strict=True)
    ]


def _law(random: np.random.Generator, base: PolynomialLaw) -> AxesLaw:
    """Return the helix's laws, each axis between half and twice as stiff; y's push varies by a third."""
    stiff = np.exp(random.uniform(-math.log(2), math.log(2), 3))
    table = base.coefficients * stiff[1]
    table[1, 0] *= random.uniform(0.7, 1.3)
    y = PolynomialLaw(table, base.actuation_map, base.deformation_map, base.domain, base.odd, axes=("y",))
    x, z = (
        StudyCoefficients(k_n=0.0, m_a=0.0, m_e=stated.m_e * scale, b_e=stated.b_e * scale)
        for stated, scale in ((STATED_X, stiff[0]), (STATED_Z, stiff[2]))
    )
    return _three_axes(x, y, z)
