"""Moulds: the part is what the box, the halves, the cores and the inserts leave."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.print.designs import DESIGNS, study_text
from tests.slow import slow_among

from pliant.api import open_study
from pliant_print.boolean import box, surface, united
from pliant_print.chain_solid import chain_solid
from pliant_print.checks import check_surface
from pliant_print.config import MouldConfig, SolidConfig
from pliant_print.draft import drafted, undercut_share
from pliant_print.mould import Mould, mould
from pliant_print.stack import study_pieces

WAYS = {
    "bellow_bending": ["lost"],
    "bellow_helical": ["lost"],
    "bellow_translational": ["lost"],
    "pneunet": ["below"],
    "two_chamber": ["pulled"] * 2,
    "three_chamber": ["pulled"] * 4,
    "fibre_reinforced": ["pulled"],
    "tendon_joint": [],
}
BELLOWS = ("bellow_bending", "bellow_helical", "bellow_translational")


def made_mould(folder: Path, name: str, **settings: Any) -> Mould:
    path = folder / "study.yaml"
    path.write_text(study_text(name, modules=1))
    one = open_study(path, store=folder / "store")
    chain = chain_solid(study_pieces(one.context, one.study))
    cap_m = 0.0 if name == "tendon_joint" else 3e-3
    return mould(chain, MouldConfig.model_validate(settings), SolidConfig(), cap_m)


@pytest.mark.parametrize("name", slow_among(DESIGNS, *BELLOWS, "three_chamber"))
def test_the_part_is_recovered_and_cores_come_out_as_stated(tmp_path, name):
    made = made_mould(tmp_path, name)
    assert made.recovered_m3 == pytest.approx(made.part_m3, rel=5e-3)
    assert made.differs_m3 < 0.012 * made.part_m3
    assert [one.way for one in made.about_cores] == WAYS[name]
    for body in (*made.halves, *made.cores.values()):
        assert check_surface(surface(body)).sound


def test_the_parts_do_not_overlap_and_shrinkage_scales_them(tmp_path):
    plain, larger = (made_mould(tmp_path, "two_chamber", shrinkage=s, draft="0 deg") for s in (0.0, 0.02))
    parts = [*plain.halves, *plain.cores.values()]
    together = sum(one.volume() for one in parts)
    assert united(parts).volume() == pytest.approx(together, rel=1e-9)
    assert plain.recovered_m3 == pytest.approx(plain.part_m3, rel=1e-3)  # less the sprue's end
    for name, core in plain.cores.items():
        assert larger.cores[name].volume() == pytest.approx(core.volume() / 0.98**3, rel=1e-6)


def test_draft_inclines_faces_along_the_pull_and_keeps_the_volume():
    pull, angle = np.array([0.0, 1.0, 0.0]), np.radians(2)
    block = box([0, 0, 0], [10e-3, 6e-3, 4e-3])
    made = drafted(block, pull, float(angle))
    assert made.volume() == pytest.approx(block.volume(), rel=2e-3)
    skin = surface(made)
    assert undercut_share(skin, -pull, None) > 0.1
    far = skin.vertices_m[skin.vertices_m[:, 1] > 5e-3]
    near = skin.vertices_m[skin.vertices_m[:, 1] < 1e-3]
    assert np.ptp(near[:, 2]) - np.ptp(far[:, 2]) == pytest.approx(2 * 6e-3 * np.tan(angle), rel=1e-3)


def test_the_sprue_of_a_tube_with_a_bore_enters_rubber_and_not_the_core(tmp_path):
    made = made_mould(tmp_path, "three_chamber")
    top = max(one.bounding_box()[3] for one in made.halves)
    hits = [half.ray_cast((top + 1, 0.0, z), (top - 5, 0.0, z)) for half in made.halves for z in (-6.0, 6.0)]
    assert any(not hit for hit in hits)  # the sprue is open beside the bore, r = 6 mm
    assert all(half.ray_cast((top + 1, 0.3, 0.0), (top - 2, 0.3, 0.0)) for half in made.halves[:1])
