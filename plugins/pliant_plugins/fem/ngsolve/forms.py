"""The module's potentials as symbols: stored energy, and the conjugates of the actuation.

    S = I + ∇v + e e₁⊗e₁,  F = S + (k × ρ) ⊗ S₁,  k = Θ / ((1 + e) L),  ρ = (y + v_y, z + v_z − z₀)

with S₁ the first row of S. The rod's rotation drops out of the energy. A volume element of the section's frame is
λ ds dy dz, λ = 1 + (k × ρ)₁; the field (0, ρ_y, ρ_z) (½ + (λ − 1)/3) has this divergence and neither the end planes nor
the mirror plane y = 0 add to its flux, so that the cavity's volume is

    V = −∫ (½ + (k_y ρ_z − k_z ρ_y)/3) (ρ_y n_y + ρ_z n_z) dA,   n dA = cof(S) N dA₀ out of the solid.

Unknowns are made dimensionless: displacements by the span, pressures by the shear modulus.

Materials as symbols: strain energy densities that NGSolve differentiates.

A nearly incompressible law W = W_iso(F̄) + K/2 (J − 1)² is solved in its mixed form, with an independent pressure q:

    W_iso(F̄) + q (J − 1) − q²/(2K)

which does not lock however large K is, given elements that are stable for it.
Source: Holzapfel, Nonlinear Solid Mechanics (2000), §8.5 (perturbed Lagrangian).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.by_region import material_solids
from pliant.interfaces.material import Material
from pliant.records.fem import IntArray, ModuleProblem
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import CAVITY, END, SOLID

LARGEST_POWER = 8  # of the stretches in Ogden's law


def is_mixed(material: Material) -> bool:
    """Return whether the law is solved with an independent pressure. Raises `UserError` for a law without symbols."""
    kind = material.resolved.config.canonical()["kind"]
    if kind in COMPRESSIBLE:
        return False
    if kind not in ISOCHORIC:
        known = ", ".join(f"'{name}'" for name in ISOCHORIC)
        raise UserError(
            f"fem 'ngsolve' differentiates symbols and has none for material '{kind}'; it has {known}. Use one of "
            "these, or fem.kind 'skfem', which takes any material."
        )
    return True


def density(material: Material, F: Any, q: Any) -> Any:
    """Return energy density (J/m³) of the deformation gradient F (3, 3) and, for a mixed law, the pressure q (Pa).

    Raises `UserError` for a law without symbols.
    """
    J, material = ngs.Det(F), material.resolved
    if not is_mixed(material):
        return COMPRESSIBLE[material.config.canonical()["kind"]](material, F, J)
    isochoric = ISOCHORIC[material.config.canonical()["kind"]](material, F, J)
    return isochoric + q * (J - 1) - q * q / (2 * material.bulk_modulus_pa)


def _first(F: Any, J: Any) -> Any:
    """Return Ī₁ = J^(−2/3) F : F."""
    return J ** (-2 / 3) * ngs.InnerProduct(F, F)


def _second(F: Any, J: Any) -> Any:
    """Return Ī₂ = J^(−4/3) ½ ((F : F)² − C : C)."""
    I1, C = ngs.InnerProduct(F, F), F.trans * F
    return J ** (-4 / 3) * 0.5 * (I1 * I1 - ngs.InnerProduct(C, C))


def _ogden(material: Material, F: Any, J: Any) -> Any:
    """Return Σ λ^2n = tr Cⁿ for even powers. Others need stretches, whose slopes do not exist if two are equal."""
    constants: Any = material.config
    odd = [alpha for alpha in constants.alpha if alpha % 2 or abs(alpha) > LARGEST_POWER]
    if odd:
        raise UserError(
            f"fem 'ngsolve' differentiates Ogden's law for even powers up to ±{LARGEST_POWER} only, not for alpha = "
            f"{odd[0]:g}: other powers have no smooth symbols where two stretches are equal. Use fem.kind 'skfem'."
        )
    C = F.trans * F
    total = 0
    for mu, alpha in zip(constants.mu_pa, constants.alpha, strict=True):
        base = C if alpha > 0 else ngs.Inv(C)
        power = base
        for _ in range(int(abs(alpha)) // 2 - 1):
            power = power * base
        total = total + 2 * mu / alpha**2 * (J ** (-alpha / 3) * ngs.Trace(power) - 3)
    return total


Law = Callable[[Material, Any, Any], Any]


def _yeoh(material: Material, F: Any, J: Any) -> Any:
    constants: Any = material.config
    x = _first(F, J) - 3
    return x * (constants.c10_pa + x * (constants.c20_pa + x * constants.c30_pa))


def _mooney_rivlin(material: Material, F: Any, J: Any) -> Any:
    constants: Any = material.config
    return constants.c10_pa * (_first(F, J) - 3) + constants.c01_pa * (_second(F, J) - 3)


def _ciarlet(material: Material, F: Any, J: Any) -> Any:
    """Return μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J)², of the solid that the conformance checks use."""
    mu, K = material.shear_modulus_pa, material.bulk_modulus_pa
    log_j = ngs.log(J)
    return mu / 2 * (ngs.InnerProduct(F, F) - 3 - 2 * log_j) + (K - 2 / 3 * mu) / 2 * log_j * log_j


ISOCHORIC: dict[str, Law] = {
    "neo_hookean": lambda material, F, J: material.shear_modulus_pa / 2 * (_first(F, J) - 3),
    "mooney_rivlin": _mooney_rivlin,
    "yeoh": _yeoh,
    "ogden": _ogden,
}
COMPRESSIBLE: dict[str, Law] = {"ciarlet_sample": _ciarlet}


AXES = ("x", "y", "z")
STRAIN = "strain"
SINC_TERMS = 14  # of the series of sin θ / θ: exact to rounding for |θ| < 4
EXTRA_ORDER = 4  # of the quadrature over the cavity's faces, whose integrand is a product of three fields


@dataclass(frozen=True, eq=False)
class Forms:
    """Two functionals of the same unknowns.

    Attributes:
        space: displacements × pressures of each solid whose law is mixed × one number for each global.
        stored: U in J, stationary in the pressures.
        worked: W of the piece's potential U − a W, a the actuation: in m³ or m.
        globals_: names of the numbers: axes of Θ, then "strain" for e.
        pressures: of each mixed solid.
    """

    space: Any
    stored: Any
    worked: Any
    globals_: tuple[str, ...]
    pressures: tuple[Pressures, ...]


@dataclass(frozen=True, eq=False)
class Pressures:
    """The pressures q/μ of one mixed solid; those of another material may jump at the border.

    Attributes:
        space: their scalar space.
        cells: numbers of the solid's cells.
        scale_pa: μ.
    """

    space: Any
    cells: IntArray
    scale_pa: float


@dataclass(frozen=True, eq=False)
class Frame:
    """Symbols of the rod frame: trial displacements in m, Θ and e."""

    problem: ModuleProblem
    displacement: Any
    turn: tuple[Any, Any, Any]
    strain: Any

    def section(self, gradient: Any) -> tuple[Any, Any, Any, tuple[Any, ...]]:
        """Return S, ρ_y, ρ_z and k, for the gradient of v in m/m."""
        stretch = ngs.CF((self.strain, 0, 0, 0, 0, 0, 0, 0, 0), dims=(3, 3))
        S = ngs.Id(3) + gradient + stretch
        rho_y = ngs.y + self.displacement[1]
        rho_z = ngs.z + self.displacement[2] - self.problem.reference_z_m
        k = tuple(t / ((1 + self.strain) * self.problem.span_m) for t in self.turn)
        return S, rho_y, rho_z, k

    def deformation_gradient(self, gradient: Any) -> Any:
        S, y, z, k = self.section(gradient)
        carried = (k[1] * z - k[2] * y, -k[0] * z, k[0] * y)
        return S + ngs.CF(tuple(g * S[0, j] for g in carried for j in range(3)), dims=(3, 3))

    def cavity(self, gradient: Any) -> Any:
        """Return density of V over the wetted reference faces."""
        S, y, z, k = self.section(gradient)
        n = ngs.Cof(S) * ngs.specialcf.normal(3)
        return -(0.5 + (k[1] * z - k[2] * y) / 3) * (y * n[1] + z * n[2])

    def ribbons(self) -> Any:
        """Return ½ EA L ⟨ε²⟩ (J) of all ribbons over |y| ≤ w/2: odd powers vanish, ⟨y²⟩ = w²/12, ⟨y⁴⟩ = w⁴/80."""
        L, energy = self.problem.span_m, ngs.CF(0)
        twist, bend = self.turn[0] / L, self.turn[2] / L
        for ribbon in self.problem.ribbons:
            square, fourth = ribbon.width_m**2 / 12, ribbon.width_m**4 / 80
            mean = (
                self.strain * self.strain
                + (bend * bend + self.strain * twist * twist) * square
                + twist**4 / 4 * fourth
            )
            energy = energy + 0.5 * ribbon.stiffness_n * L * mean
        return energy

    def tendon(self) -> Any:
        """Return the length (m) of tendon drawn out: the approach of the hole to the mirror plane x = 0.

        The hole rises with an end section that moves as one.
        """
        tendon, L = self.problem.tendon, self.problem.span_m
        if tendon is None or any(axis != "y" for axis in self.problem.axes):
            raise UserError(
                "fem 'ngsolve' pulls a tendon in problems whose only axis is y, and needs its path."
            )
        theta = self.turn[1]
        sinc, term = ngs.CF(1), ngs.CF(1)
        for n in range(1, SINC_TERMS):
            term = -term * theta * theta / (2 * n * (2 * n + 1))
            sinc = sinc + term
        rise = self.displacement[2] if 2 in self.problem.tied.get("end", ()) else 0
        arm = tendon.z_m - self.problem.reference_z_m + rise
        hole = (1 + self.strain) * L * sinc + tendon.x_m * ngs.cos(theta) + arm * ngs.sin(theta)
        return L + tendon.x_m - hole


def global_names(problem: ModuleProblem) -> tuple[str, ...]:
    """Return the names of the scalar unknowns besides the fields. Raises `UserError` for axes that do not exist."""
    if problem.joint == "prismatic":
        if not problem.stretches or problem.ribbons:
            raise UserError(
                "fem 'ngsolve': a prismatic joint's extension is the strain of the line; it must stretch freely."
            )
        return (STRAIN,)
    strange = [axis for axis in problem.axes if axis not in AXES]
    if strange:
        raise UserError(f"fem 'ngsolve' supports the axes x, y and z, not '{strange[0]}'.")
    return (*problem.axes, *((STRAIN,) if problem.stretches else ()))


def build_forms(mesh: Any, problem: ModuleProblem, material: Material, order: int) -> Forms:
    """Build space and functionals. Raises `UserError` for a law or actuation without symbols."""
    names, solids = global_names(problem), material_solids(problem.mesh, material)
    where = [ngs.dx] if len(solids) == 1 else [ngs.dx(definedon=_domain(mesh, problem, s)) for s, _ in solids]
    pressures = tuple(
        Pressures(_pressure_space(mesh, problem, cells, order - 1), cells, own.shear_modulus_pa)
        for cells, own in solids
        if is_mixed(own)
    )
    fields = [ngs.VectorH1(mesh, order=order), *(one.space for one in pressures)]
    space = ngs.FESpace(fields + [ngs.NumberSpace(mesh) for _ in names])
    trial = space.TrialFunction()
    numbers = dict(zip(names, trial[len(fields) :], strict=True))
    nothing = ngs.CF(0)
    L = problem.span_m
    turn = tuple(numbers.get(axis, nothing) for axis in AXES)
    frame = Frame(problem, L * trial[0], (turn[0], turn[1], turn[2]), numbers.get(STRAIN, nothing))

    # what depends on the numbers alone, or on the end section as one, is spread over that section
    section = float(ngs.Integrate(ngs.CF(1) * ngs.ds(END, bonus_intorder=EXTRA_ORDER), mesh))
    end = ngs.ds(END, bonus_intorder=EXTRA_ORDER)
    F, unknown = frame.deformation_gradient(L * ngs.Grad(trial[0])), iter(trial[1:])
    stored = ngs.BilinearForm(space)
    for (_, own), inside in zip(solids, where, strict=True):
        pressure = own.shear_modulus_pa * next(unknown) if is_mixed(own) else nothing
        stored += ngs.Variation(density(own, F, pressure).Compile() * inside)
    if problem.ribbons:
        stored += ngs.Variation((frame.ribbons() / section).Compile() * end)
    worked = ngs.BilinearForm(space)
    if problem.actuation == "pressure_pa":
        volume = frame.cavity(L * ngs.Grad(trial[0]).Trace())
        worked += ngs.Variation(volume.Compile() * ngs.ds(CAVITY, bonus_intorder=EXTRA_ORDER))
    elif problem.actuation == "tendon_force_n":
        # the module's tendon is `deformation_scale` pieces long; its potential is shared by `energy_scale`
        share = problem.deformation_scale / problem.energy_scale / section
        worked += ngs.Variation((share * frame.tendon()).Compile() * end)
    else:
        raise UserError(
            f"fem 'ngsolve' drives modules by 'pressure_pa' or 'tendon_force_n', not '{problem.actuation}'."
        )
    return Forms(space, stored, worked, names, pressures)


def _domain(mesh: Any, problem: ModuleProblem, cells: IntArray) -> Any:
    """Return the domain of a solid, by one of its cells."""
    return mesh.Materials(f"{SOLID}{problem.mesh.region_numbers[cells[0]]}")


def _pressure_space(mesh: Any, problem: ModuleProblem, cells: IntArray, order: int) -> Any:
    """Return a space continuous within a solid, with unknowns in its cells alone."""
    if len(cells) == len(problem.mesh.cells):
        return ngs.H1(mesh, order=order)
    domain = _domain(mesh, problem, cells)
    everywhere = ngs.H1(mesh, order=order, definedon=domain)
    return ngs.Compress(everywhere, active_dofs=everywhere.GetDofs(domain))
