"""Mirror planes of a solved piece: its images add up to the module, in volume and energy alike."""

from __future__ import annotations

import pytest

from pliant.meshing.cells import cell_volumes
from pliant.pipeline.dataset import mirror_planes
from pliant.registry.component import Component
from pliant.registry.discovery import discover

FAMILIES = [c for c in discover().by_interface("family") if c.package.startswith("pliant ")]


@pytest.mark.parametrize("component", FAMILIES, ids=[c.kind for c in FAMILIES])
def test_images_count_as_the_energy_does(component: Component) -> None:
    family = component.build(
        component.config_model().model_validate({"kind": component.kind, **component.smallest_block()})
    )
    main = family.problem(axes=(family.main_axis,))
    assert main.energy_scale == 2 ** len(mirror_planes(main))
    whole = family.problem()
    assert whole.energy_scale == 2 ** len(mirror_planes(whole))
    volumes = [
        float(cell_volumes(p.mesh.nodes_m, p.mesh.cells).sum()) * 2 ** len(mirror_planes(p))
        for p in (main, whole)
    ]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-3)
