"""Free actuation curve of a module by FEM, for any constants of its material, and stresses of homogeneous tests.

Similarity saves most of the work: stresses of two materials whose moduli differ by one factor (with equal Poisson's
ratio and powers) differ by that factor at equal deformation, so that the curve depends only on actuation over shear
modulus. One computed curve serves all of them, and a law of one constant needs no other. This is not valid if the
family has a part of given stiffness, such as a ribbon.

Nominal stresses of homogeneous tests are fast for any number of rows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy

from pliant.errors import NotReachedError
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.fem import FEMBackend, FemConfig, ModuleSolver
from pliant.interfaces.material import Material, MaterialConfig
from pliant.mechanics.homogeneous import MODES, incompressible_stress, nominal_stress
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant_calibrate.fitting import material_constants

INTERVALS = 8  # initial number along a curve; slopes are exact, so that few suffice
MOST_NODES = 48
BEYOND = 1.02


@dataclass
class _Curve:
    """States along a free branch, at equal steps of actuation over modulus.

    Attributes:
        solver: of the material whose shear modulus is `modulus_pa`.
        step: of actuation / modulus, in m⁰ (pressure) or m² (force).
    """

    solver: ModuleSolver
    modulus_pa: float
    step: float
    states: list[FemState] = field(default_factory=list)

    def missing(self, ratio: float) -> int:
        """Return the number of states to solve until actuation / modulus is covered."""
        return max(math.ceil(ratio / self.step - 1e-9) + 1 - len(self.states), 0)

    def reach(self, ratio: float, advance: Callable[[], None]) -> None:
        """Solve the missing states; raise `NotReachedError` if FEM finds no state."""
        if self.missing(ratio) + len(self.states) > MOST_NODES:
            raise NotReachedError("the free curve needs too many states")
        for _ in range(self.missing(ratio)):
            if self.states:
                target = len(self.states) * self.step * self.modulus_pa
                self.states.append(self.solver.free(target, self.states[-1]))
            else:
                self.states.append(self.solver.rest())
            advance()

    def at(self, ratio: Array) -> Array:
        """Return u (n,) at actuation / modulus (n,), by a cubic through values and slopes."""
        x = [state.actuation / self.modulus_pa for state in self.states]
        slopes = [self.modulus_pa * free_slope(state) for state in self.states]
        return np.asarray(
            scipy.interpolate.CubicHermiteSpline(x, [s.angle_rad for s in self.states], slopes)(ratio), float
        )


def free_slope(state: FemState) -> float:
    """Return du/dp of the main axis along the free branch, from the exact slopes of τ."""
    return float(-np.linalg.solve(state.dtau_du, state.dtau_dp)[state.main])


@dataclass(eq=False)
class FreeCurves:
    """Model of `test: free`, which maps constants to the angle (or extension) of every row.

    Attributes:
        context: builds the material and the solvers.
        problem: of the family's module, about its main axis.
        backend: FEM.
        actuation: (n,) of the rows, Pa or N.
        failure: cause of the last failure of FEM.
    """

    context: RunContext
    problem: ModuleProblem
    backend: FEMBackend
    actuation: Array
    failure: str = ""
    _curves: dict[tuple[float, ...], _Curve] = field(default_factory=dict)

    @staticmethod
    def from_module(
        context: RunContext, family: ActuatorFamily, fem: FemConfig, actuation: Array
    ) -> FreeCurves:
        """Return the model of a study's module."""
        problem = family.problem(fem.refinement, (family.main_axis,))
        return FreeCurves(context, problem, context.build("fem", fem), actuation)

    @property
    def states(self) -> int:
        """Return the number of solved states."""
        return sum(len(curve.states) for curve in self._curves.values())

    @property
    def similar(self) -> bool:
        """Return whether curves depend only on actuation over modulus."""
        return not (self.problem.ribbons or self.problem.mesh.regions)

    def first_slope(self, config: MaterialConfig) -> float:
        """Return d(angle)/d(actuation) at rest, for small actuations without a curve."""
        return free_slope(self._solver(config).rest())

    def predict(self, config: MaterialConfig) -> Array | None:
        """Return u (n,) of the rows; None if FEM finds no state for these constants."""
        modulus = self._material(config).shear_modulus_pa
        largest = float(self.actuation.max()) / modulus
        curve = self._curve(config, modulus, largest)
        missing = curve.missing(largest)
        if missing:
            bar = self.context.progress.begin("FEM states of a free curve", missing)
            try:
                curve.reach(largest, bar.advance)
            except NotReachedError as error:
                self.failure = str(error)
                return None
            finally:
                bar.finish()
        return curve.at(self.actuation / modulus)

    def touching(self, config: MaterialConfig) -> float | None:
        """Return the smallest actuation at which convolutions overlap, which FEM marks and does not resolve."""
        modulus = self._material(config).shear_modulus_pa
        curve = self._curve(config, modulus, 0.0)
        marked = [s.actuation * modulus / curve.modulus_pa for s in curve.states if s.status != "ok"]
        return min(marked) if marked and min(marked) <= self.actuation.max() else None

    def _curve(self, config: MaterialConfig, modulus: float, largest: float) -> _Curve:
        """Return the curve that this material shares with all similar ones."""
        unit = modulus if self.similar else 1.0
        key = tuple(
            float(f"{c.value / (unit if c.is_modulus else 1):.12g}") for c in material_constants(config)
        )
        if key not in self._curves:
            step = BEYOND * largest / INTERVALS
            self._curves[key] = _Curve(self._solver(config), modulus, step)
        return self._curves[key]

    def _material(self, config: MaterialConfig) -> Material:
        built: Material = self.context.build("material", config)
        return built

    def _solver(self, config: MaterialConfig) -> ModuleSolver:
        return self.backend.checked_solver(self.problem, self._material(config))


NODES = 160  # more rows are interpolated between this number of computed stretches


@dataclass(frozen=True, eq=False)
class HomogeneousTests:
    """Model of `test: tensile`, which maps constants to the nominal stress of every row.

    Attributes:
        build: builds the material.
        stretch: (n,) of the rows.
        mode: (n,) uniaxial, equibiaxial or planar.
        incompressible: whether the volume is constant, J = 1; else the free faces follow from the law's ν.
    """

    build: Callable[[MaterialConfig], Material]
    stretch: Array
    mode: np.ndarray
    incompressible: bool

    def predict(self, config: MaterialConfig) -> Array | None:
        """Return the nominal stress (n,) in Pa; None if these constants give none."""
        try:
            with np.errstate(all="ignore"):  # invalid constants overflow; they are refused below
                stress = self._stress(self.build(config))
        except (NotReachedError, np.linalg.LinAlgError):
            return None
        return stress if np.all(np.isfinite(stress)) else None

    def _stress(self, material: Material) -> Array:
        model = incompressible_stress if self.incompressible else nominal_stress
        stress = np.zeros(len(self.stretch))
        for mode in MODES:
            rows = self.mode == mode
            if not rows.any():
                continue
            stretch = self.stretch[rows]
            places, back = np.unique(stretch, return_inverse=True)
            if len(places) <= NODES:
                stress[rows] = model(material, places, mode)[back]
            else:
                nodes = np.geomspace(places[0], places[-1], NODES)
                spline = scipy.interpolate.CubicSpline(np.log(nodes), model(material, nodes, mode))
                stress[rows] = spline(np.log(stretch))
        return stress
