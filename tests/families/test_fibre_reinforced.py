"""The fibre-reinforced tube: threads as springs of a solid, the angle of constant length, the sheet."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pliant.errors import InvalidDesignError, UserError
from pliant.records.fem import FemState, Fibres
from pliant.testing.box import box_problem, spatial_box_problem
from pliant_plugins.families.fibre_reinforced.family import FibreReinforced, FibreReinforcedConfig
from pliant_plugins.families.reference import WOUND_TUBE
from pliant_plugins.fem.config import NgsolveConfig, SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU_PA, KAPPA_PA = 300e3, 2e6


def rubber(factor: float = 1.0, nu: float = 0.499) -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=factor * MU_PA, poisson_ratio=nu))


def design(**changes: Any) -> FibreReinforced:
    return FibreReinforced(FibreReinforcedConfig.model_validate({**WOUND_TUBE, **changes}))


def free(sheet: float, pressure_pa: float, **changes: Any) -> FemState:
    body = rubber().with_regions({"sheet": rubber(sheet)})
    made = Skfem(SkfemConfig()).solver(design(**changes).problem(), body)
    return made.free(pressure_pa, made.rest())


def threads(problem: Any, direction: tuple[float, float, float]) -> tuple[Fibres, ...]:
    cells = np.arange(len(problem.mesh.cells))
    return (Fibres(cells, np.broadcast_to(np.array(direction), (len(cells), 27, 3)), KAPPA_PA),)


def test_threads_along_a_bar_add_their_stiffness_to_its_own() -> None:
    """∂F/∂u = −(E + κ) A / l, whatever the length of the given directions."""
    bar = replace(spatial_box_problem(), axes=("x",), main_axis="x", joint="prismatic")
    backend, nu = Skfem(SkfemConfig()), 0.3
    plain = backend.solver(bar, rubber(nu=nu)).rest().dmoment_du
    wound = backend.solver(replace(bar, fibres=threads(bar, (-2.0, 0, 0))), rubber(nu=nu)).rest().dmoment_du
    young = 2 * MU_PA * (1 + nu)
    assert wound / plain == pytest.approx((young + KAPPA_PA) / young, rel=1e-6)


def test_slopes_with_threads_are_exact() -> None:
    problem = box_problem()
    made = Skfem(SkfemConfig()).solver(replace(problem, fibres=threads(problem, (1.0, 0.5, 0.2))), rubber())
    state, step = made.constrained(8e3, 0.1, made.rest()), 1e-3
    more, less = (made.constrained(8e3, 0.1 + s, state) for s in (step, -step))
    assert state.dmoment_du == pytest.approx((more.moment_n_m - less.moment_n_m) / (2 * step), rel=1e-5)
    assert state.dmoment_dp == pytest.approx((more.travel - less.travel) / (2 * step), rel=1e-5)


def test_a_thin_tube_keeps_its_length_at_the_netting_angle() -> None:
    """tan² α = 2: threads nearer to the axis shorten the tube, those nearer to the hoop lengthen it."""
    thin = {"wall": "0.6 mm", "sleeve": "0.3 mm"}
    magic = float(np.degrees(np.arctan(np.sqrt(2.0))))
    low, still, high = (
        free(1.0, 2e3, thread_angle=f"{angle} deg", **thin).axial_strain
        for angle in (magic - 10, magic, magic + 10)
    )
    assert low < 0 < high
    assert abs(still) < 0.005 * min(-low, high)


def test_stiff_threads_cost_no_accuracy() -> None:
    """Both linear solvers take the same few steps for any ratio of the threads' to the rubber's stiffness."""
    found = []
    for kind in ("auto", "superlu"):
        body = rubber().with_regions({"sheet": rubber(1.0)})
        thin = design(wall="0.6 mm", sleeve="0.3 mm", thread_angle="45 deg")
        made = Skfem(SkfemConfig(linear_solver=kind)).solver(thin.problem(), body)
        found.append(made.free(2e3, made.rest()))
    assert found[0].iterations == found[1].iterations <= 6
    assert found[0].axial_strain == pytest.approx(found[1].axial_strain, rel=1e-8)


def test_the_sheet_bends_the_tube_and_keeps_its_length() -> None:
    soft, stiff = free(1.0, 50e3), free(100.0, 50e3)
    assert abs(soft.angle_rad) < 0.02 * stiff.angle_rad
    # the soft one's line lengthens as the whole tube does
    assert abs(stiff.axial_strain) < 0.2 * soft.axial_strain


@pytest.mark.slow
def test_threads_around_a_tube_keep_it_slim() -> None:
    growth = []
    for thread in ("0.001 N", "500 N"):
        body = rubber().with_regions({"sheet": rubber(100.0)})
        made = Skfem(SkfemConfig()).solver(design(thread_stiffness=thread).problem(), body)
        state = made.free(30e3, made.rest())
        growth.append((made.deformed_nodes(state)[:, 1] - made.problem.mesh.nodes_m[:, 1]).max())
    assert growth[1] < 0.2 * growth[0]


@pytest.mark.slow
def test_the_module_length_does_not_matter() -> None:
    short, long = (free(100.0, 50e3, module_length=length) for length in ("5 mm", "20 mm"))
    assert long.angle_rad == pytest.approx(4 * short.angle_rad, rel=1e-6)
    assert long.axial_strain == pytest.approx(short.axial_strain, rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"sleeve": "2.5 mm"}, r"sleeve < wall .*but 2.5 mm ≥ 2.5 mm"),
        ({"thread_angle": "95 deg"}, "thread_angle ≤ 90°, but 95° > 90°, over by 5°"),
        ({"sheet_angle": "0 deg"}, "sheet_angle > 0°"),
        ({"radius": 6}, "1 m"),
    ],
)
def test_impossible_tubes_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidDesignError, match=says):
        design(**changes)


def test_a_code_without_threads_says_so() -> None:
    from pliant_plugins.fem.ngsolve.backend import Ngsolve

    body = rubber().with_regions({"sheet": rubber(10.0)})
    with pytest.raises(UserError, match="fem 'ngsolve' does not know 'fibres'"):
        Ngsolve(NgsolveConfig()).solver(design().problem(), body)
