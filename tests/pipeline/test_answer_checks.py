"""Checks of a mesh by FEM results: closed forms of a box pass; a leaking cavity, a wrong hand and a neck fail."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pliant.interfaces.fem import ModuleSolver
from pliant.pipeline.answer_checks import (
    answer_checks,
    answer_doubts,
    beam_stiffness,
    work_over_energy,
    young_pa,
)
from pliant.records.design import Design
from pliant.records.fem import FemState, ModuleData
from pliant.registry.discovery import discover
from pliant.testing.box import BoxModule, box_problem, tetrahedral
from pliant.testing.stand_ins import sample_material

PRESSURES = (1e3, 2e3, 3e3, 4e3)


@cache
def solver() -> ModuleSolver:
    registry = discover()
    config = registry.get("fem", "skfem").config_model()(kind="skfem", pressure_max=PRESSURES[-1])
    made: ModuleSolver = registry.build("fem", config).solver(box_problem(), sample_material())
    return made


@cache
def branch() -> tuple[FemState, ...]:
    """Return the box's free branch, from rest."""
    states = [solver().rest()]
    for pressure in PRESSURES:
        states.append(solver().free(pressure, states[-1]))
    return tuple(states)


def data(states: tuple[FemState, ...]) -> ModuleData:
    columns = {
        name: np.array([getattr(state, name) for state in states])
        for name in (
            *("actuation", "deformation", "tau", "dtau_dp", "dtau_du", "energy_j", "travel"),
            *("iterations", "wall_s", "branch", "status"),
        )
    }
    return ModuleData(
        design=Design("box", {}),
        joint="revolute",
        axes=("y",),
        main_axis="y",
        actuation_name="pressure_pa",
        explored=np.array(["y"] * len(states)),
        role=np.array(["fit"] * len(states)),
        **columns,
    )


def test_the_box_beam_is_its_closed_form():
    material = sample_material()
    exact = BoxModule(material.young_pa, material.poisson).stiffness_n_m
    assert young_pa(material) == pytest.approx(material.young_pa)
    problem = box_problem()
    assert beam_stiffness(problem, material.young_pa) == pytest.approx(exact, rel=1e-9)
    of_tetrahedra = replace(problem, mesh=tetrahedral(problem.mesh))
    assert beam_stiffness(of_tetrahedra, material.young_pa) == pytest.approx(exact, rel=1e-9)


def test_an_inextensible_line_bends_the_section_about_itself():
    """I about the line is I about the centroid plus A d²."""
    problem, material = box_problem(), sample_material()
    held = replace(problem, stretches=False)
    module = BoxModule(material.young_pa, material.poisson)
    length = 2 * problem.span_m
    area = module.axial_stiffness_n_m * length / material.young_pa
    apart = module.centroid_m - problem.reference_z_m
    exact = module.stiffness_n_m + material.young_pa * area * apart**2 / length
    assert beam_stiffness(held, material.young_pa) == pytest.approx(exact, rel=1e-9)


def test_a_sound_module_raises_no_doubt():
    figures = answer_checks(data(branch()), box_problem(), sample_material(), branch()[0])
    assert figures["work_over_energy"] == pytest.approx(1.0, abs=1e-3)
    assert figures["stiffness_over_section"] == pytest.approx(1.0, abs=0.05)
    assert list(answer_doubts(figures)) == []


@pytest.mark.parametrize(("of_the_volume", "what"), [(0.7, "leaks"), (-1.0, "has the wrong hand")])
def test_pressure_that_works_on_other_faces_is_doubted(of_the_volume, what):
    """The pressure acts on the whole cavity, the volume counts some faces in one solver, all reversed in the other."""
    wrong = tuple(replace(state, travel=of_the_volume * state.travel) for state in branch())
    figures = answer_checks(data(wrong), box_problem(), sample_material(), branch()[0])
    assert figures["work_over_energy"] == pytest.approx(of_the_volume, abs=1e-3), what
    (said,) = answer_doubts(figures)
    assert "cavity's faces" in said


def test_what_is_far_softer_or_stiffer_than_its_sections_is_doubted():
    """One body's sections are not bonded to each other, the other one has too many supports."""
    figures = answer_checks(data(branch()), box_problem(), sample_material(), branch()[0])
    rest = branch()[0]
    for factor, word in ((2e-3, "crack"), (3.0, "supports")):
        other = replace(rest, dtau_du=factor * rest.dtau_du)
        odd = answer_checks(data(branch()), box_problem(), sample_material(), other)
        assert odd["stiffness_over_section"] == pytest.approx(factor * figures["stiffness_over_section"])
        (said,) = answer_doubts(odd)
        assert word in said


def test_a_bar_with_a_narrow_part_is_softer_in_series():
    """Half the length at half the height: 1/K = Σ Δx/(E I), I as the cube of the height."""
    problem = box_problem(refinement=2)
    nodes = problem.mesh.nodes_m.copy()
    young = 1e6
    whole = beam_stiffness(problem, young)
    solid = np.unique(nodes[:, 0])
    half = nodes[:, 0] > solid[len(solid) // 2] + 1e-9
    middle = float(np.mean([nodes[:, 2].min(), nodes[:, 2].max()]))
    nodes[half, 2] = middle + 0.5 * (nodes[half, 2] - middle)
    narrow = beam_stiffness(replace(problem, mesh=replace(problem.mesh, nodes_m=nodes)), young)
    assert whole is not None and narrow is not None
    assert 2.0 / (1.0 + 8.0) < narrow / whole < 0.5


def test_few_states_and_other_joints_say_nothing():
    assert work_over_energy(data(branch()[:3])) is None
    assert beam_stiffness(replace(box_problem(), joint="prismatic"), 1e6) is None
