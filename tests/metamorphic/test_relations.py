"""Results follow physical relations when a random study is changed; `make metamorphic` tries 500 studies of each."""

from __future__ import annotations

import os

import numpy as np
import pytest
from tests.metamorphic.random_studies import random_study, settled_tip
from tests.metamorphic.relations import RELATIONS

COUNT = int(os.environ.get("PLIANT_METAMORPHIC", "50"))  # studies of each relation


@pytest.mark.parametrize("relation", RELATIONS, ids=lambda relation: relation.__name__)
def test_the_tip_moves_as_it_must(relation, tmp_path):
    if relation.__name__ == "in_pybullet":
        pytest.importorskip("pybullet")
    errors, broken = [], []
    for seed in range(COUNT):
        error, tolerance = distance(relation, seed, tmp_path)
        errors.append(error)
        if not error <= tolerance:  # nor where an engine did not converge
            broken.append((seed, error))
    largest = np.nanmax(errors)
    print(
        f"{relation.__name__}: {COUNT} studies, {len(broken)} broken, largest distance {largest:.1e} of the tip's"
    )
    assert broken == [], f"{len(broken)} of {COUNT} studies"


def distance(relation, seed, folder):
    """Return the distance of the tips as a share of the tip's distance from the base, and the tolerance."""
    rng = np.random.default_rng([seed, RELATIONS.index(relation)])
    raw = random_study(rng)
    moved = relation(raw, rng)
    for name, text in moved.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    wanted, there = moved.tip(settled_tip(moved.plain or raw, folder)), settled_tip(moved.study, folder)
    length = max(float(np.linalg.norm(wanted)), 1e-3)
    return float(np.linalg.norm(there - wanted)) / length, moved.tolerance
