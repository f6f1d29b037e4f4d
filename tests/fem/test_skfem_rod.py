"""The rod frame by law: every derivative, constraints, ribbons, tendons, helices, several axes at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm
from scipy.optimize import brentq

from pliant.errors import ContractError, UserError
from pliant.records.design import Array
from pliant.records.fem import FemState, Link, ModuleProblem, Ribbon, Tendon
from pliant.testing.box import (
    Y,
    Z,
    box_problem,
    prismatic_box_problem,
    spatial_box_problem,
    tendon_box_problem,
)
from pliant.testing.stand_ins import sample_material
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.rod_solver import placed
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver, at_nodes
from pliant_plugins.fem.skfem.pattern import Terms
from pliant_plugins.fem.skfem.potentials import drawn
from pliant_plugins.fem.skfem.unknowns import constraints

MATERIAL = sample_material()
RIBBON = Ribbon(2e-3, 40.0)
GLOBALS = (0.11, 0.14, -0.17, 0.03)  # Θ, e of the point where derivatives are taken


def distorted() -> ModuleProblem:
    """Return the full box with a closed ring as cavity, its inner nodes moved at random, two ribbons."""
    problem = spatial_box_problem()
    nodes = problem.mesh.nodes_m.copy()
    inside = (nodes[:, 0] > 0) & (nodes[:, 0] < problem.span_m)
    nodes[inside] += 1e-4 * np.random.default_rng(0).uniform(-1, 1, (inside.sum(), 3))
    ribbons = (RIBBON, Ribbon(0.0, 7.0))
    return replace(problem, mesh=replace(problem.mesh, nodes_m=nodes), ribbons=ribbons)


def admissible(assembler: Assembler, size: float, seed: int = 4) -> Array:
    """Return random displacements (and pressures) that obey the constraints, Θ and e nonzero."""
    v = size * np.random.default_rng(seed).standard_normal(assembler.pattern.size)
    return np.concatenate([assembler.pattern.expand(v), np.array(GLOBALS)[list(assembler.globals.active)]])


def product(assembler: Assembler, terms: Terms, d: Array) -> Array:
    """Return Hessian · d over the unknowns and the globals; d obeys the constraints."""
    pattern, G = assembler.pattern, assembler.globals.count
    upper = sparse.csr_matrix((terms.matrix, pattern.indices, pattern.indptr), shape=(pattern.size,) * 2)
    matrix, border = upper + sparse.triu(upper, 1).T, pattern.reduce(terms.border[:-G])
    v = d[pattern.free]
    return np.concatenate([matrix @ v + border @ d[-G:], border.T @ v + terms.border[-G:] @ d[-G:]])


def reduced(assembler: Assembler, terms: Terms) -> Array:
    G = assembler.globals.count
    return np.concatenate([assembler.pattern.reduce(terms.gradient[:-G]), terms.gradient[-G:]])


@pytest.mark.parametrize("what", ["elastic_energy", "cavity"])
@pytest.mark.parametrize("dilatation", ["cell", "continuous", "point"])
@pytest.mark.parametrize("axes", [("x", "y", "z"), ("x",), ("y",), ("z",), ("y", "z")])
def test_gradient_and_hessian_against_differences(what: str, dilatation: str, axes: tuple[str, ...]) -> None:
    problem = replace(distorted(), axes=axes, main_axis=axes[0])
    assembler = Assembler(problem, MATERIAL, dilatation)  # type: ignore[arg-type]
    x, d, h = admissible(assembler, 2e-5), admissible(assembler, 2e-5, seed=5), 1e-5
    evaluate = getattr(assembler, what)
    here, ahead, behind = evaluate(x), evaluate(x + h * d), evaluate(x - h * d)
    assert here.gradient @ d == pytest.approx((ahead.value - behind.value) / (2 * h), rel=1e-7)
    slope = (reduced(assembler, ahead) - reduced(assembler, behind)) / (2 * h)
    got = product(assembler, here, d)
    assert np.linalg.norm(got - slope) < 1e-7 * np.linalg.norm(slope)
    assert np.allclose(got[-assembler.globals.count :], slope[-assembler.globals.count :], rtol=1e-6)


@pytest.mark.parametrize("what", ["elastic_energy", "cavity", "strain_energy", "tendon"])
@pytest.mark.parametrize("stretches", [True, False])
def test_every_entry_in_the_globals_block(what: str, stretches: bool) -> None:
    """Θ–Θ, Θ–e and e–e are tested separately: a test of the whole matrix hides a wrong sign in the volume's entries."""
    tendon = Tendon(1e-3, -2e-3)
    tied = {"end": (2,)}
    problem = replace(distorted(), stretches=stretches, tendon=tendon, tied=tied, links=())
    assembler = Assembler(problem, MATERIAL)
    x, h, G = admissible(assembler, 2e-5), 1e-5, assembler.globals.count
    evaluate = getattr(assembler, what)
    here = evaluate(x)
    for i in range(G):
        d = np.zeros_like(x)
        d[-G + i] = h
        ahead, behind = evaluate(x + d), evaluate(x - d)
        assert here.gradient[-G + i] == pytest.approx((ahead.value - behind.value) / (2 * h), rel=1e-6)
        slope = (ahead.gradient - behind.gradient) / (2 * h)
        for j in range(G):
            scale = np.abs(here.border[-G:]).max()
            assert here.border[-G + j, i] == pytest.approx(slope[-G + j], rel=1e-6, abs=1e-9 * scale), (i, j)
        rows = slope[:-G]
        assert np.allclose(here.border[:-G, i], rows, rtol=1e-5, atol=1e-7 * max(np.abs(rows).max(), 1e-30))


def cross(k: Array) -> Array:
    return np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])


def test_placed_sections_follow_the_rod_equations() -> None:
    """R = exp(s [k]), r' = R e₁ by quadrature."""
    k, z0 = np.array([30.0, 45.0, -60.0]), 1.5e-3
    section = np.array([[7e-3, 1e-3, 4e-3], [-1e-3, -2e-3, 0.0], [0.0, 1e-3, 1e-3]])
    got = placed(section, k, z0)
    node, weight = np.polynomial.legendre.leggauss(12)
    for point, (s, y, z) in zip(got, section, strict=True):
        line = sum(
            w * s / 2 * expm(s * (n + 1) / 2 * cross(k))[:, 0] for n, w in zip(node, weight, strict=True)
        )
        exact = line + expm(s * cross(k)) @ np.array([0.0, y, z - z0]) + np.array([0.0, 0.0, z0])
        assert np.allclose(point, exact, atol=1e-15)
    assert np.allclose(placed(section, np.zeros(3), z0), section, atol=1e-18)


def test_the_energy_equals_the_motion_in_space() -> None:
    """W of F by differences of the placed positions, for a smooth displacement that the cells represent exactly."""
    problem = spatial_box_problem()
    assembler = Assembler(problem, MATERIAL, "point")
    turn, strain = np.array(GLOBALS[:3]), GLOBALS[3]
    k = turn / ((1 + strain) * problem.span_m)
    rng = np.random.default_rng(1)
    linear, square = 0.03 * rng.standard_normal((3, 3)), 4.0 * rng.standard_normal((3, 3))

    def displaced(X: Array) -> Array:
        return X @ linear.T + X**2 @ square.T

    def in_space(X: Array) -> Array:
        section = X + displaced(X) + strain * X[:, :1] * np.array([1.0, 0.0, 0.0])
        return placed(section, k, problem.reference_z_m)

    nodes = problem.mesh.nodes_m
    terms = assembler.strain_energy(np.concatenate([displaced(nodes).ravel(), [*turn, strain]]))
    assert terms is not None
    points = (assembler.cells.value @ nodes[assembler.cells.nodes]).reshape(-1, 3)
    h = 1e-7
    columns = [(in_space(points + h * d) - in_space(points - h * d)) / (2 * h) for d in np.eye(3)]
    energy = MATERIAL.energy(np.stack(columns, axis=-1))
    assert terms.value == pytest.approx(float(energy @ assembler.cells.weight.ravel()), rel=1e-7)


def test_bent_and_twisted_tube_cavity_in_closed_form() -> None:
    """Pappus: A (1 + e) L (1 + k_y ρ_z − k_z ρ_y) with the cavity's centroid, for any offset of the section."""
    problem = spatial_box_problem()
    assembler = Assembler(problem, MATERIAL)
    v, shift = np.zeros((len(problem.mesh.nodes_m), 3)), np.array([0.7e-3, -0.4e-3])
    v[:, 1:] = shift
    turn, strain = np.array(GLOBALS[:3]), GLOBALS[3]
    length = (1 + strain) * problem.span_m
    k, area = turn / length, 2 * Y[1] * (Z[2] - Z[1])
    y, z = shift[0], (Z[1] + Z[2]) / 2 + shift[1] - problem.reference_z_m
    none = np.zeros(assembler.size - v.size)
    got = assembler.cavity(np.concatenate([v.ravel(), none, [*turn, strain]])).value
    assert got == pytest.approx(area * length * (1 + k[1] * z - k[2] * y), rel=1e-12)


def test_tendon_s_path_by_the_exponential_map() -> None:
    tendon, span, z0, rise = Tendon(1.3e-3, -4e-3), 6e-3, 1e-3, 0.2e-3
    turn, strain = np.array([0.4, 0.9, -0.6]), 0.04
    node, weight = np.polynomial.legendre.leggauss(12)
    mean = sum(w / 2 * expm((n + 1) / 2 * cross(turn)) for n, w in zip(node, weight, strict=True))
    hole = np.array([tendon.x_m, 0.0, tendon.z_m - z0 + rise])
    now = (1 + strain) * span * mean[0, 0] + (expm(cross(turn)) @ hole)[0]
    got, *_ = drawn(tendon, span, z0, turn, strain, rise)
    assert got == pytest.approx(span + tendon.x_m - now, rel=1e-12)
    # a bend alone
    theta = 0.5
    got, *_ = drawn(tendon, span, z0, np.array([0.0, theta, 0.0]), 0.0, 0.0)
    bent = span * np.sin(theta) / theta + (tendon.z_m - z0) * np.sin(theta) + tendon.x_m * np.cos(theta)
    assert got == pytest.approx(span + tendon.x_m - bent, rel=1e-12)


def test_ribbon_s_energy_by_quadrature() -> None:
    problem = replace(spatial_box_problem(), ribbons=(RIBBON,))
    assembler, (turn, strain) = Assembler(problem, MATERIAL), (np.array(GLOBALS[:3]), GLOBALS[3])
    x = np.concatenate([np.zeros(assembler.size), [*turn, strain]])
    elastic, solid = assembler.elastic_energy(x), assembler.strain_energy(x)
    assert elastic is not None and solid is not None
    node, weight = np.polynomial.legendre.leggauss(5)
    y, L = RIBBON.width_m / 2 * node, problem.span_m
    fibre = strain - turn[2] * y / L + (turn[0] * y / L) ** 2 / 2
    exact = 0.5 * RIBBON.stiffness_n * L * float(weight / 2 @ fibre**2)
    assert elastic.value - solid.value == pytest.approx(exact, rel=1e-9)


def backend(**options: object) -> Skfem:
    return Skfem(SkfemConfig.model_validate({"pressure_max_pa": 15e3, **options}))


@pytest.fixture(scope="module")
def spatial() -> SkfemSolver:
    return backend().solver(spatial_box_problem(), MATERIAL)


@pytest.fixture(scope="module")
def mixed(spatial: SkfemSolver) -> FemState:
    return spatial.constrained(8e3, {"x": 0.1, "y": 0.15, "z": -0.12}, spatial.rest())


def test_a_whole_module_is_four_quarters(spatial: SkfemSolver) -> None:
    """Periodic, with warping free, against the symmetric piece: one solution on matching cells."""
    quarter = backend().solver(box_problem(), MATERIAL)
    part = quarter.constrained(8e3, 0.15, quarter.rest())
    whole = spatial.constrained(8e3, {"x": 0.0, "y": 0.15, "z": 0.0}, spatial.rest())
    for name in ("moment_n_m", "dmoment_dp", "dmoment_du", "energy_j", "travel", "axial_strain"):
        assert getattr(whole, name) == pytest.approx(getattr(part, name), rel=1e-8), name


def test_periodic_displacements_are_periodic(spatial: SkfemSolver, mixed: FemState) -> None:
    v = mixed.solution[: spatial.problem.mesh.nodes_m.size].reshape(-1, 3)
    sets = spatial.problem.mesh.node_sets
    assert np.abs(v[sets["start"]] - v[sets["end"]]).max() == 0
    assert np.abs(v[sets["start"]]).max() > 1e-6


def test_held_axes_must_be_the_joint_s(spatial: SkfemSolver, mixed: FemState) -> None:
    with pytest.raises(UserError, match="'w' is none of this module's: x, y, z"):
        spatial.constrained(0.0, {"w": 0.1}, mixed)
    with pytest.raises(UserError, match="distinct ones of x, y, z"):
        backend().solver(replace(spatial_box_problem(), axes=("y", "y")), MATERIAL)
    with pytest.raises(UserError, match="prismatic"):
        backend().solver(replace(spatial_box_problem(), joint="prismatic"), MATERIAL)
    with pytest.raises(UserError, match="main axis"):
        backend().solver(replace(box_problem(), main_axis="z"), MATERIAL)


@pytest.mark.slow
def test_a_stiff_ribbon_is_a_stretchless_line() -> None:
    """EA → ∞ without width and `stretches = False` are one problem."""
    base = box_problem()
    stiff = backend().solver(replace(base, ribbons=(Ribbon(0.0, 1e6),)), MATERIAL)
    rigid = backend().solver(replace(base, stretches=False), MATERIAL)
    a, b = (s.constrained(6e3, 0.1, s.rest()) for s in (stiff, rigid))
    assert b.axial_strain == 0 < abs(a.axial_strain) < 1e-6
    for name in ("moment_n_m", "dmoment_dp", "dmoment_du", "energy_j"):
        assert getattr(a, name) == pytest.approx(getattr(b, name), rel=1e-4), name
    soft = backend().solver(base, MATERIAL).rest()
    assert abs(b.dmoment_du) > 1.5 * abs(soft.dmoment_du)


def test_ribbon_stiffens_sideways_bending_by_its_second_moment(spatial: SkfemSolver) -> None:
    banded = backend().solver(replace(spatial_box_problem(), ribbons=(RIBBON,)), MATERIAL).rest()
    added = RIBBON.stiffness_n * RIBBON.width_m**2 / 12 / spatial.problem.span_m
    plain = spatial.rest()
    assert banded.dtau_du[2, 2] == pytest.approx(plain.dtau_du[2, 2] - added, rel=1e-9)
    assert banded.dtau_du[0, 0] == pytest.approx(plain.dtau_du[0, 0], rel=1e-9)


def test_tendon_is_drawn_by_what_the_holes_come_nearer() -> None:
    """For a whole module the travel is that of both half lengths, read from the deformed nodes of a rigid end."""
    base = tendon_box_problem()
    solver = backend().solver(base, MATERIAL)
    free = solver.free(0.2, solver.rest())
    assert free.angle_rad > 0 and free.travel > 0
    end = base.mesh.node_sets["end"]
    now, theta = solver.deformed_nodes(free)[end[0]], free.angle_rad / 2
    corner = base.mesh.nodes_m[end[0]]
    assert base.tendon is not None
    along, down = base.tendon.x_m, base.tendon.z_m - corner[2]
    hole = now[0] + along * np.cos(theta) + down * np.sin(theta)
    assert free.travel == pytest.approx(2 * (base.span_m + along - hole), rel=1e-9)


def test_prismatic_module_is_stretched_and_does_not_turn() -> None:
    solver = backend().solver(prismatic_box_problem(), MATERIAL)
    state = solver.constrained(5e3, 1e-3, solver.rest())
    assert state.deformation == pytest.approx([1e-3]) and state.held == ("x",)
    length = solver.problem.span_m
    assert state.axial_strain == pytest.approx(1e-3 / length)
    end = solver.problem.mesh.node_sets["end"]
    start = solver.problem.mesh.node_sets["start"]
    moved = solver.deformed_nodes(state)
    assert np.allclose(moved[end] - moved[start], [length + 1e-3, 0, 0], atol=1e-12)
    free = solver.free(5e3, state)
    assert free.deformation[0] > 0 and abs(free.moment_n_m) < 1e-8


def test_constraints_join_fix_and_cancel() -> None:
    """Tied to linked to fixed; v = −v is zero; signs multiply along a chain of links."""
    base = spatial_box_problem()
    nodes = len(base.mesh.nodes_m)
    sets = {**base.mesh.node_sets, "three": np.array([3, 4, 5]), "one": np.array([9])}
    pairs = [
        Link(np.array([5]), np.array([6]), {0: -1.0, 1: 1.0}),
        Link(np.array([6]), np.array([7]), {0: -1.0, 1: -1.0}),
        Link(np.array([8]), np.array([8]), {2: -1.0}),
        Link(np.array([9]), np.array([10]), {1: 1.0}),
    ]
    mesh = replace(base.mesh, node_sets=sets)
    problem = replace(base, mesh=mesh, tied={"three": (0, 1)}, links=tuple(pairs), fixed={"one": (1,)})
    held = constraints(problem)
    u = np.random.default_rng(2).uniform(1, 2, len(held.first))
    v = np.asarray(held.spread @ u).reshape(nodes, 3)
    assert len(u) == 3 * nodes - 4 - 4 - 1 - 2
    assert v[3, 0] == v[4, 0] == v[5, 0] == -v[6, 0] == v[7, 0] != 0
    assert v[3, 1] == v[5, 1] == v[6, 1] == -v[7, 1] != 0
    assert v[8, 2] == 0 and v[9, 1] == 0 and v[10, 1] == 0
    with pytest.raises(ContractError, match="'nowhere'; the mesh has .*start"):
        constraints(replace(base, fixed={"nowhere": (0,)}))


@pytest.mark.slow
def test_antiperiodic_links_give_half_a_symmetric_cell() -> None:
    """A twist alone has the two-fold symmetry about z through mid-span: half the cell with signed links suffices.

    (x, y, z) → (−x, −y, z) maps v to (−v_x, −v_y, v_z): on the mid-plane x = l/2 and on x = 0 alike it joins the
    nodes at y and −y.
    """
    whole = spatial_box_problem()
    quarter_length = whole.span_m / 2
    nodes = whole.mesh.nodes_m
    keep = nodes[whole.mesh.cells].max(axis=1)[:, 0] < quarter_length * (1 + 1e-9)
    cells = whole.mesh.cells[keep]
    cavity = whole.mesh.cavity[nodes[whole.mesh.cavity].max(axis=1)[:, 0] < quarter_length * (1 + 1e-9)]
    used = np.unique(cells)
    small = nodes[used]
    sets = {
        name: np.flatnonzero(np.abs(small[:, 0] - x) < 1e-9)
        for name, x in (("start", 0.0), ("end", quarter_length))
    }
    pins = {name: np.searchsorted(used, whole.mesh.node_sets[name]) for name in ("pin", "level")}
    links = []
    for ids in sets.values():
        order = {tuple(np.rint(1e7 * small[i, 1:]).astype(int)): i for i in ids}
        pair = [(i, order[(-y, z)]) for (y, z), i in order.items() if y >= 0]
        first, second = np.array(pair).T
        links.append(Link(first, second, {0: -1.0, 1: -1.0, 2: 1.0}))
    mesh = replace(
        whole.mesh,
        nodes_m=small,
        cells=np.searchsorted(used, cells),
        cavity=np.searchsorted(used, cavity),
        skin=np.searchsorted(used, cavity),
        node_sets={**sets, **pins},
    )
    half = replace(
        whole,
        mesh=mesh,
        span_m=quarter_length,
        deformation_scale=2.0,
        energy_scale=2.0,
        links=tuple(links),
        fixed={"pin": (2,)},
        axes=("x",),
        main_axis="x",
    )
    a, b = backend().solver(half, MATERIAL), backend().solver(whole, MATERIAL)
    part = a.constrained(0.0, 0.3, a.rest())
    full = b.constrained(0.0, {"x": 0.3, "y": 0.0, "z": 0.0}, b.rest())
    assert part.moment_n_m == pytest.approx(full.tau[0], rel=1e-7)


@pytest.mark.parametrize("dilatation", ["cell", "continuous", "point"])
def test_uniform_stretch_fields_in_closed_form(dilatation: str) -> None:
    """A bar in tension: σ = P₁₁ λ₁ / J, the lateral stretch from μ (λ₂² − 1) + λ ln J = 0."""
    solver = backend(dilatation=dilatation).solver(prismatic_box_problem(), MATERIAL)
    length = solver.problem.span_m
    state = solver.constrained(0.0, 0.1 * length, solver.rest())
    fields, config = solver.fields(state), MATERIAL.config
    along = 1.1
    across = brentq(
        lambda s: config.shear_modulus_pa * (s**2 - 1) + config.lame_pa * np.log(along * s**2), 0.8, 1.0
    )
    law = MATERIAL.evaluate(np.diag([along, across, across]))
    J = along * across**2
    stress = law.stress[0, 0] * along / J
    exact = {
        "von_mises_pa": stress,
        "hydrostatic_pa": stress / 3,
        "energy_j_m3": float(law.energy),
        "volume_ratio": J,
        "largest_stretch": along,
    }
    for name, value in exact.items():
        assert fields.point_data[name] == pytest.approx(np.full(len(fields.points_m), value), rel=1e-6), name
    assert set(fields.point_data) == set(exact)
    pin = fields.points_m[solver.problem.mesh.node_sets["pin"][0]]
    stretched = (fields.points_m - pin) * [along - 1, across - 1, across - 1]
    assert np.allclose(fields.displacement_m, stretched, atol=1e-10)


def test_fields_belong_to_the_state(spatial: SkfemSolver, mixed: FemState) -> None:
    """∫W is the stored energy, the displacement that of the picture; a linear field is mapped to the nodes exactly."""
    fields, assembler = spatial.fields(mixed), spatial.assembler
    _, energy, _ = assembler.at_points(mixed.solution)
    assert float(np.sum(energy * assembler.cells.weight)) == pytest.approx(mixed.energy_j, rel=1e-12)
    nodes = spatial.problem.mesh.nodes_m
    assert np.allclose(nodes + fields.displacement_m, spatial.deformed_nodes(mixed))
    slope = np.array([2.0, -3.0, 5.0])
    points = assembler.cells.value @ nodes[assembler.cells.nodes]
    assert np.allclose(at_nodes(assembler, points @ slope), nodes @ slope, atol=1e-15)
