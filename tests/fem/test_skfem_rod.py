"""The rod frame by law: every derivative, constraints, ribbons, tendons, helices, several axes at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from pliant.records.design import Array
from pliant.records.fem import ModuleProblem, Ribbon, Tendon
from pliant.testing.box import (
    spatial_box_problem,
)
from pliant.testing.stand_ins import sample_material
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.terms import Terms

MATERIAL = sample_material()
RIBBON = Ribbon(2e-3, 40.0)
GLOBALS = (0.11, 0.14, -0.17, 0.03)  # Θ, e of the point where derivatives are taken


def distorted() -> ModuleProblem:
    """The full box with a closed ring as cavity, its inner nodes moved at random, two ribbons."""
    problem = spatial_box_problem()
    nodes = problem.mesh.nodes_m.copy()
    inside = (nodes[:, 0] > 0) & (nodes[:, 0] < problem.span_m)
    nodes[inside] += 1e-4 * np.random.default_rng(0).uniform(-1, 1, (inside.sum(), 3))
    ribbons = (RIBBON, Ribbon(0.0, 7.0))
    return replace(problem, mesh=replace(problem.mesh, nodes_m=nodes), ribbons=ribbons)


def admissible(assembler: Assembler, size: float, seed: int = 4) -> Array:
    """Displacements at random that obey the constraints, Θ and e nonzero."""
    v = size * np.random.default_rng(seed).standard_normal(assembler.pattern.size)
    return np.concatenate([assembler.pattern.expand(v), np.array(GLOBALS)[list(assembler.globals.active)]])


def product(assembler: Assembler, terms: Terms, d: Array) -> Array:
    """Hessian · d over the unknowns and the globals; d obeys the constraints."""
    pattern, G = assembler.pattern, assembler.globals.count
    upper = sparse.csr_matrix((terms.matrix, pattern.indices, pattern.indptr), shape=(pattern.size,) * 2)
    matrix, border = upper + sparse.triu(upper, 1).T, pattern.reduce(terms.border[:-G])
    v = d[pattern.free]
    return np.concatenate([matrix @ v + border @ d[-G:], border.T @ v + terms.border[-G:] @ d[-G:]])


def reduced(assembler: Assembler, terms: Terms) -> Array:
    G = assembler.globals.count
    return np.concatenate([assembler.pattern.reduce(terms.gradient[:-G]), terms.gradient[-G:]])


@pytest.mark.parametrize("what", ["elastic_energy", "cavity"])
@pytest.mark.parametrize("dilatation", ["cell", "point"])
@pytest.mark.parametrize("axes", [("x", "y", "z"), ("x",), ("z",), ("y", "z")])
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
def test_every_entry_of_the_globals_block(what: str, stretches: bool) -> None:
    """Each of Θ–Θ, Θ–e, e–e by itself: a wrong sign in the volume's hides in a whole-matrix test."""
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
