"""The PneuNet: valid designs, its regions and masses in closed form, and the bending by its layer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pliant.errors import InvalidDesignError
from pliant.meshing.hexahedra import area_vector, cell_volumes
from pliant.records.fem import FemState
from pliant_plugins.families.pneunet.family import Pneunet, PneunetConfig
from pliant_plugins.families.reference import PNEUNET
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU_PA, PRESSURE_PA = 200e3, 8e3


def design(**changes: Any) -> Pneunet:
    return Pneunet(PneunetConfig.model_validate({**PNEUNET, **changes}))


def solver(layer: float, **changes: Any) -> SkfemSolver:
    body, other = (NeoHookean(NeoHookeanConfig(shear_modulus_pa=f * MU_PA)) for f in (1.0, layer))
    return Skfem(SkfemConfig()).solver(design(**changes).problem(), body.with_regions({"layer": other}))


def free(layer: float, **changes: Any) -> FemState:
    made = solver(layer, **changes)
    return made.free(PRESSURE_PA, made.rest())


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"wall": "4.5 mm"}, r"2 wall \+ gap < module_length .*but 10 mm ≥ 10 mm"),
        ({"shell": "6.6 mm"}, r"2 shell \+ channel_width .* over by 0.2 mm"),
        ({"height": "6 mm"}, r"floor \+ channel_height \+ bridge \+ shell .* over by 0.5 mm"),
        ({"layer": "0 mm"}, r"layer > 0"),
        ({"width": 15}, "1 m"),
    ],
)
def test_impossible_chambers_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidDesignError, match=says):
        design(**changes)


def test_layer_body_and_cavity_have_their_box_volumes() -> None:
    g = design().geometry
    mesh = design().problem().mesh
    volumes = 4 * cell_volumes(mesh.nodes_m, mesh.cells)
    layer = volumes[mesh.regions["layer"]].sum()
    assert layer == pytest.approx(g.module_length_m * g.width_m * g.layer_m, rel=1e-12)
    chamber = (g.module_length_m - g.gap_m - 2 * g.wall_m) * (g.width_m - 2 * g.shell_m)
    chamber *= g.height_m - g.floor_m - g.shell_m
    channel = (g.gap_m + 2 * g.wall_m) * g.channel_width_m * g.channel_height_m
    above = g.height_m - g.floor_m - g.channel_height_m - g.bridge_m
    body = g.module_length_m * g.width_m * g.height_m - g.gap_m * g.width_m * above - chamber - channel
    assert volumes.sum() - layer == pytest.approx(body, rel=1e-12)
    # ∮ z n_z dA over the hollow: the planes x = 0, x = l/2 and y = 0 that close it have no n_z
    height = mesh.nodes_m[mesh.cavity, 2].mean(axis=1)
    upward = np.array([area_vector(mesh.nodes_m, face[None])[2] for face in mesh.cavity])
    assert -4 * height @ upward == pytest.approx(chamber + channel, rel=1e-12)


def test_the_layer_weighs_what_its_material_weighs() -> None:
    family = design()
    g = family.geometry
    light, heavy = family.mass(1000.0), family.mass(1000.0, {"layer": 1500.0})
    more = heavy.end.mass_kg - light.end.mass_kg
    assert more == pytest.approx(500.0 * g.module_length_m / 2 * g.width_m * g.layer_m, rel=1e-12)
    assert heavy.start.com_m[0] == -heavy.end.com_m[0]


@pytest.mark.parametrize(("stiffer", "less"), [(0.1, 5), pytest.param(1000.0, 0.1, marks=pytest.mark.slow)])
def test_a_stiffer_layer_strains_less(stiffer: float, less: float) -> None:
    """The line at the layer's middle keeps its length in the limit; a thick layer then also resists bending."""
    state, other = free(stiffer), free(10.0)
    compared = abs(state.axial_strain) / abs(other.axial_strain)
    assert compared > less if stiffer < 10 else compared < less
    assert state.angle_rad > 0 and other.angle_rad > 0


def test_thinner_walls_bend_more() -> None:
    thin, thick = (free(10.0, wall=wall, gap=gap) for wall, gap in (("1.2 mm", "1.6 mm"), ("1.5 mm", "1 mm")))
    assert thin.angle_rad > 1.05 * thick.angle_rad


def test_reciprocity() -> None:
    """∂τ/∂p = ∂V/∂u, as both derive from one energy."""
    made, u, step = solver(10.0), 0.05, 1e-3
    state = made.constrained(PRESSURE_PA, u, made.rest())
    more, less = (made.constrained(PRESSURE_PA, u + s, state) for s in (step, -step))
    assert state.dmoment_dp == pytest.approx((more.travel - less.travel) / (2 * step), rel=1e-4)


def test_walls_that_bulge_to_mid_gap_are_marked() -> None:
    made = solver(10.0)
    assert made.free(20e3, made.free(10e3, made.rest())).status == "self_contact"
