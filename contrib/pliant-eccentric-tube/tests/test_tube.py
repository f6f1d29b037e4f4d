"""Areas, masses and the bend of a small pressure, by hand."""

import numpy as np
import pytest
from pliant_eccentric_tube.config import EccentricTubeConfig
from pliant_eccentric_tube.family import EccentricTube
from pliant_eccentric_tube.section import Section

from pliant.errors import InvalidDesignError
from pliant.meshing.hexahedra import cell_volumes
from pliant.registry.discovery import discover
from pliant.testing.stand_ins import sample_material

FINGER = {"outer_radius": "6 mm", "bore_radius": "3.5 mm", "offset": "1.2 mm", "module_length": "12 mm"}


@pytest.fixture
def tube() -> EccentricTube:
    return EccentricTube(EccentricTubeConfig.model_validate(FINGER))


def test_mesh_has_the_tubes_volume(tube: EccentricTube) -> None:
    mesh = tube.problem(2).mesh
    wanted = np.pi * (6e-3**2 - 3.5e-3**2) * 12e-3
    assert 4 * cell_volumes(mesh.nodes_m, mesh.cells).sum() == pytest.approx(wanted, rel=1e-4)


def test_the_wall_centroid_is_the_mass_centroid(tube: EccentricTube) -> None:
    # 6² and 3.5² mm² times 1.2 mm: −12.25 · 1.2 / 23.75 mm
    assert tube.section.centroid_m == pytest.approx(-0.618947e-3, rel=1e-5)
    assert tube.mass(1150.0).end.com_m[2] == pytest.approx(tube.section.centroid_m, rel=1e-12)


def test_masses_equal_the_round_section(tube: EccentricTube) -> None:
    end, section, half = tube.mass(1150.0).end, tube.section, 6e-3
    mass = 1150.0 * section.area_m2 * half
    assert end.mass_kg == pytest.approx(mass, rel=1e-6)
    across = 1150.0 * half * section.second_moment_m4 + mass * half**2 / 12
    assert end.inertia_kg_m2[1, 1] == pytest.approx(across, rel=1e-6)


def test_small_pressure_bends_it_as_a_beam(tube: EccentricTube) -> None:
    """Reciprocity: the moment of p is (1 − 2ν) π a² (d − z_c) p, the stiffness E I / l."""
    registry = discover()
    component = registry.get("fem", "skfem")
    config = component.config_model().model_validate({"kind": "skfem", "pressure_max": "10 kPa"})
    material = sample_material()
    rest = component.build(config).solver(tube.problem(), material).rest()
    section = tube.section
    gain = (1 - 2 * material.poisson) * np.pi * section.bore_m**2 * (section.offset_m - section.centroid_m)
    assert rest.dmoment_dp == pytest.approx(gain, rel=2e-3)
    stiffness = material.young_pa * section.second_moment_m4 / tube.module_length_m
    assert rest.dmoment_du == pytest.approx(-stiffness, rel=2e-3)


@pytest.mark.parametrize(
    ("section", "length", "says"),
    [
        (Section(6e-3, 4.5e-3, 1.4e-3), 12e-3, r"thin wall.*0.1 mm < 0.3 mm, short by 0.2 mm"),
        (Section(6e-3, 3.5e-3, 0.0), 12e-3, "offset > 0"),
        (Section(6.0, 3.5, 1.2), 12e-3, "were units forgotten"),
        (Section(6e-3, 3.5e-3, 1.2e-3), 1e-4, "module_length ≥ 0.05 outer_radius"),
    ],
)
def test_impossible_tubes_are_refused(section: Section, length: float, says: str) -> None:
    with pytest.raises(InvalidDesignError, match=says):
        EccentricTube(
            EccentricTubeConfig(
                outer_radius_m=section.outer_m,
                bore_radius_m=section.bore_m,
                offset_m=section.offset_m,
                module_length_m=length,
            )
        )
