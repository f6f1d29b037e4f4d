"""Checks of FEM results: work of the pressure, and stiffness of the joint against that of its section.

Counts of faces and nodes do not reveal a cavity that leaks, a pressure on the wrong side or an unintended neck.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pliant.formatting import percent
from pliant.interfaces.material import Material
from pliant.meshing.cells import cell_kind
from pliant.records.fem import TRUSTED, FemState, ModuleData, ModuleProblem

# Of the elastic energy: allowed error of the work of the actuation on a branch of few states.
BALANCE = 0.05
# Of a beam with the module's sections. Convolutions make a joint softer (bellows: 0.016 to 0.04), and few causes make
# it stiffer: sections that cannot contract give 1 / (1 − ν²), two chambers 1.6.
SOFTEST, STIFFEST = 3e-3, 2.0
SLICES = 24
EXACT = 5  # order of a quadrature that is exact for products of two positions
FEWEST = 3  # free states beside rest, so that a spline follows the branch


def answer_checks(
    data: ModuleData, problem: ModuleProblem, material: Material, rest: FemState
) -> dict[str, float]:
    """Return the figures of the checks that apply to a module's data and its state at rest.

    Keys: `work_over_energy` of the free branch; `stiffness_over_section`, −∂τ/∂u at rest over that of a beam.
    """
    figures = {
        "work_over_energy": work_over_energy(data),
        "stiffness_over_section": stiffness_over_section(problem, material, rest),
    }
    return {name: value for name, value in figures.items() if value is not None}


def answer_doubts(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each figure of `answer_checks` that contradicts mechanics."""
    work, stiffness = figures.get("work_over_energy"), figures.get("stiffness_over_section")
    if work is not None and abs(work - 1.0) > BALANCE:
        yield (
            f"The actuation does {percent(work)} of the work that the free module stores: pressure acts on other faces "
            "than those that enclose the volume, or on their wrong side. Check the cavity's faces."
        )
    if stiffness is not None and not SOFTEST <= stiffness <= STIFFEST:
        why = (
            "its sections hang together by little: is there a crack, or a wall that is not bonded?"
            if stiffness < SOFTEST
            else "no module is stiffer than its sections: are the supports or the unit of its file wrong?"
        )
        yield f"The joint at rest has {percent(stiffness)} of the stiffness of a beam with its sections; {why}"


def work_over_energy(data: ModuleData) -> float | None:
    """Return ∫ p dV / (E − E₀) along the free branch from rest; None for several actuations or too few states.

    ∫ p dV = p V − ∫ V dp, with V(p) a spline through the states and V(0) = 0.
    """
    if data.actuation.ndim > 1:
        return None
    rows = np.flatnonzero((data.branch == "free") & np.isin(data.status, TRUSTED) & (data.actuation > 0))
    _, first = np.unique(data.actuation[rows], return_index=True)
    rows = rows[first]
    if len(rows) < FEWEST:
        return None
    p = np.concatenate([[0.0], data.actuation[rows]])
    travel = np.concatenate([[0.0], data.travel[rows]])
    work = p[-1] * travel[-1] - float(CubicSpline(p, travel).integrate(0.0, p[-1]))
    energy = float(data.energy_j[rows[-1]])
    return work / energy if energy > 0.0 else None


def stiffness_over_section(problem: ModuleProblem, material: Material, rest: FemState) -> float | None:
    """Return −∂τ/∂u of the main axis at rest over that of a beam; None without a beam of one solid."""
    beam = beam_stiffness(problem, young_pa(material))
    stiffness = -float(rest.dmoment_du)
    return stiffness / beam if beam is not None and np.isfinite(stiffness) else None


def beam_stiffness(problem: ModuleProblem, young: float) -> float | None:
    """Return −∂τ/∂u (N·m) of a beam with the piece's sections in series: 1 / K = Σ Δx / (E I).

    I is about the centroid of each section, or about the reference line if that keeps its length. It includes a neck;
    the areas of end sections are checked when a mesh is read. None for joints that do not bend about y, and for pieces
    stiffened by more than one solid.
    """
    mesh = problem.mesh
    others = problem.ribbons or problem.fibres or mesh.regions or problem.stops
    if problem.main_axis != "y" or problem.joint == "prismatic" or others:
        return None
    # Slices at least as thick as a cell, so that each contains whole sections.
    thickest = float(np.ptp(mesh.nodes_m[mesh.cells, 0], axis=1).max())
    count = max(1, min(SLICES, int(problem.span_m / thickest + 1e-6)))
    points, volumes = cell_kind(mesh.cells).quadrature(mesh.nodes_m, mesh.cells, EXACT)
    points, volumes = points.reshape(-1, 3), volumes.ravel()
    slices = np.clip((points[:, 0] / problem.span_m * count).astype(int), 0, count - 1)
    height = points[:, 2] - problem.reference_z_m
    width = problem.span_m / count
    area, first, second = (np.bincount(slices, volumes * height**k, count) / width for k in range(3))
    if np.any(area <= 0.0):
        return None
    keeps_length = not problem.stretches or "e" in problem.axes
    inertia = second if keeps_length else second - first**2 / area
    piece = 1.0 / float(np.sum(width / (young * inertia)))
    return problem.energy_scale / problem.deformation_scale**2 * piece


def young_pa(material: Material) -> float:
    """Return Young's modulus at small strain."""
    shear, bulk = material.shear_modulus_pa, material.bulk_modulus_pa
    return 9.0 * bulk * shear / (3.0 * bulk + shear)
