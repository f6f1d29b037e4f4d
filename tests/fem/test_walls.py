"""Walls that meet within the piece, by law: agreement with a mirror plane, exact derivatives, no penetration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from tests.fem.test_contact import BLOCK, GAP, block, material, solver, thin_bellow

from pliant.meshing.hexahedra import boundary_faces
from pliant.records.design import Array
from pliant.records.fem import ModuleProblem
from pliant.testing.box import tetrahedral
from pliant_plugins.families.reference import TENDON_JOINT
from pliant_plugins.families.tendon_joint.family import TendonJoint, TendonJointConfig
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.contact import DEEPEST
from pliant_plugins.fem.skfem.pattern import Terms
from pliant_plugins.fem.skfem.stops import edges

SWAPPED = np.arange(27).reshape(3, 3, 3)[:, :, ::-1].ravel()  # of a cell that is mirrored along x
FACE_SWAPPED = np.arange(9).reshape(3, 3).T.ravel()


def whole(half: ModuleProblem) -> ModuleProblem:
    """Return the piece with its mirror image beyond the section x = span, so that contact is inside the piece."""
    mesh, span = half.mesh, half.span_m
    mine = np.abs(mesh.nodes_m[:, 0] - span) < 1e-12  # nodes that both share
    number = np.where(mine, np.arange(len(mine)), len(mine) + np.cumsum(~mine) - 1)
    image = (mesh.nodes_m * [-1, 1, 1] + [2 * span, 0, 0])[~mine]
    nodes = np.concatenate([mesh.nodes_m, image])
    cells = np.concatenate([mesh.cells, number[mesh.cells][:, SWAPPED]])
    cavity = np.concatenate([mesh.cavity, number[mesh.cavity][:, FACE_SWAPPED]])
    sets = {name: np.union1d(ids, number[ids]) for name, ids in mesh.node_sets.items()}
    x = nodes[:, 0]
    sets |= {"start": np.flatnonzero(np.abs(x) < 1e-12), "end": np.flatnonzero(np.abs(x - 2 * span) < 1e-12)}
    sets |= {"pin": mesh.node_sets["pin"]} if "pin" in sets else {}
    return replace(
        half,
        mesh=replace(
            mesh, nodes_m=nodes, cells=cells, cavity=cavity, skin=boundary_faces(cells)[0], node_sets=sets
        ),
        span_m=2 * span,
        fixed={**half.fixed, "end": (0,)},
        deformation_scale=half.deformation_scale / 2,
        energy_scale=half.energy_scale / 2,
    )


@pytest.mark.parametrize("pressed_m", [0.05e-3, 0.6e-3])
def test_two_blocks_press_each_other_as_one_presses_the_plane_between(pressed_m: float) -> None:
    """The results agree to rounding; the second moves so far in one step that the blocks would be inside each other."""
    states = []
    for problem in (block(), whole(block())):
        here = solver(problem)
        apart = here.constrained(0.0, -GAP / 2, here.rest())
        assert apart.status == "ok"
        states.append(here.constrained(0.0, -GAP - pressed_m, apart))
    one, both = states
    assert both.status == one.status == "touching"
    for name in ("moment_n_m", "dmoment_du", "energy_j"):
        assert getattr(both, name) == pytest.approx(getattr(one, name), rel=1e-10), name


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_derivatives_are_exact_where_faces_do_not_match(cells: str) -> None:
    """Gradient and Hessian of the energy of crooked walls, shifted along each other, against differences."""
    problem = replace(whole(block()), axes=("y", "z"), main_axis="y", joint="spherical")
    if cells == "tetrahedra":
        problem = replace(problem, mesh=tetrahedral(problem.mesh))
    assembler, random = Assembler(problem, material(), contact=True), np.random.default_rng(0)
    pattern, G, nodes = assembler.pattern, assembler.globals.count, problem.mesh.nodes_m
    strain, second = -0.01, nodes[:, 0] > BLOCK[0] + GAP
    v = 2e-5 * random.standard_normal(nodes.shape)
    v[:, 0] += np.where(second, -1, 1) * ((1 + strain) * GAP + 1e-5)
    v[second, 1:] += 0.13e-3, 0.21e-3
    x = np.zeros(assembler.count)
    x[assembler.displacements], x[-G:] = v.ravel(), (0.1, -0.05, strain)
    inner, globals_ = 1e-5 * random.standard_normal(pattern.size), 1e-2 * random.standard_normal(G)
    step = np.concatenate([pattern.expand(inner), globals_])

    def stored(at: Array) -> Terms:
        both, alone = assembler.elastic_energy(at), assembler.strain_energy(at)
        assert both is not None and alone is not None
        return both.plus(-1.0, alone)

    here, h = stored(x), 1e-4
    assert here.value > 0 and here.coupling is not None
    above, below = stored(x + h * step), stored(x - h * step)
    assert (above.value - below.value) / (2 * h) == pytest.approx(float(here.gradient @ step), rel=1e-6)
    more, shape = here.coupling, (pattern.size,) * 2
    upper = sparse.csr_matrix((here.matrix, pattern.indices, pattern.indptr), shape=shape)
    upper = upper + sparse.csr_matrix((more.values, more.pattern.indices, more.pattern.indptr), shape=shape)
    inside = (upper + sparse.triu(upper, 1).T) @ inner + pattern.reduce(here.border[:-G]) @ globals_
    change = (above.gradient - below.gradient) / (2 * h)
    numeric = pattern.reduce(change[:-G, None])[:, 0]
    assert np.abs(inside - numeric).max() < 1e-6 * np.abs(numeric).max()
    of_globals = here.border[:-G].T @ step[:-G] + here.border[-G:] @ globals_
    assert np.abs(of_globals - change[-G:]).max() < 1e-6 * np.abs(change[-G:]).max()


@pytest.mark.slow
def test_folds_within_a_piece_are_those_that_meet_their_image() -> None:
    """The thin bellow from crest to crest, compressed by half more than to contact, against half of it and a plane."""
    states = []
    for problem in (thin_bellow(), whole(thin_bellow())):
        here = solver(problem)
        state = here.rest()
        for pressure in (1e3, 2.5e3, 5e3, 7.5e3, 11.25e3):
            state = here.free(pressure, state)
        contacts = here.assembler.contacts
        assert contacts is not None and state.status == "touching"
        assert 0 < contacts.deepest(state.solution, state.axial_strain) < DEEPEST
        states.append(here.constrained(11.25e3, 0.5 * state.angle_rad, state))
    one, both = states
    for name in ("moment_n_m", "dmoment_du", "dmoment_dp", "energy_j"):
        assert getattr(both, name) == pytest.approx(getattr(one, name), rel=1e-5), name


def test_tendon_joint_links_stop_each_other() -> None:
    """Edges stop at the mirror plane both ways, with exact slopes of the law; before contact nothing changes."""
    problem = TendonJoint(TendonJointConfig.model_validate(TENDON_JOINT)).problem()
    here, open_ = (solver(problem, how, 71.9e6) for how in ("solve", "end"))
    wall = 1e-3  # the flexure's thickness
    for tension, angle, edge in ((9.0, 0.95, 0), (0.0, -0.03, 1)):
        near, far = (
            s.constrained(tension, angle, s.constrained(tension, 0.5 * angle, s.rest()))
            for s in (here, open_)
        )
        assert (near.status, far.status) == ("touching", "self_contact")
        beyond, over = (
            edges(problem, *s._frame(x.solution))[edge][0] for s, x in ((here, near), (open_, far))
        )
        assert 0 < beyond < DEEPEST * wall < over
        du, dT = 1e-5, 1e-3
        more, less = (here.constrained(tension, angle + s * du, near) for s in (1, -1))
        assert (more.moment_n_m - less.moment_n_m) / (2 * du) == pytest.approx(near.dmoment_du, rel=1e-5)
        assert (more.travel - less.travel) / (2 * du) == pytest.approx(near.dmoment_dp, rel=1e-5)
        more, less = (here.constrained(tension + s * dT, angle, near) for s in (1, -1))
        assert (more.moment_n_m - less.moment_n_m) / (2 * dT) == pytest.approx(near.dmoment_dp, rel=1e-5)
    free, apart = (s.free(7.0, s.rest()) for s in (here, open_))
    assert np.array_equal(free.solution, apart.solution) and free.status == "ok"
