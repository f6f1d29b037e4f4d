"""The next designs to solve: by gain, doubt or distance, without impossible or solved ones."""

from dataclasses import replace

import numpy as np
import pytest
from tests.pliant_designs import meta_bench as bench

from pliant import api
from pliant.errors import UserError
from pliant_designs import next_design
from pliant_designs.next_design import designs_to_solve, write_proposals
from pliant_designs.sweep_designs import sweep_designs


@pytest.fixture(scope="module")
def unseen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("next")
    return api.meta_model(bench.opened(folder))


def near(unseen, proposals):
    """Return the (n,) distance of each proposal to the nearest solved design, the range being 1."""
    designs = unseen.stage.designs
    values = np.array([one.values for one in proposals])
    return next_design._distances(designs, values, designs.values).min(axis=1)


def test_the_best_by_gain_come_first_and_apart(unseen):
    found = unseen.next(3)
    assert found == unseen.next(3)
    with pytest.raises(UserError, match="ask for at least one"):
        unseen.next(0)
    assert all(one.basis == "gain" for one in found)
    assert found[0].gain == max(one.gain for one in found)
    values = np.array([one.values for one in found])
    apart = next_design._distances(unseen.stage.designs, values, values) + np.eye(3)
    assert apart.min() > 0.15
    assert near(unseen, found).min() > 0.01


class _Mute:
    """Laws that state no gain."""

    def __init__(self, laws, doubt):
        self._laws, self._doubt = laws, doubt

    def gain(self, candidates, over):
        return None

    def doubt(self, values):
        return self._doubt(values)

    def law(self, values):
        return self._laws.law(values)


def test_sweep_designs_go_first_and_solved_ones_never(unseen):
    sweep = {"radius": ["4 mm", "4.2 mm", "5.4 mm"], "length": ["8 mm", "9.7 mm"]}
    study = unseen.opened.study
    study = study.model_copy(
        update={"sweep": type(study).model_fields["sweep"].annotation.__args__[0](**sweep)}
    )
    found = designs_to_solve(unseen.opened.context, study, unseen.stage, 5)
    values = {(round(1e3 * r, 6), round(1e3 * length, 6)) for r, length in (one.values for one in found)}
    assert values == {(4.2, 8.0), (5.4, 8.0), (4.0, 9.7), (4.2, 9.7), (5.4, 9.7)}
    with pytest.raises(UserError, match="only 5 possible designs"):
        designs_to_solve(unseen.opened.context, study, unseen.stage, 6)


def test_impossible_designs_are_not_proposed(tmp_path):
    opened = bench.opened(
        tmp_path,
        data=bench.table(tmp_path, (4e-3, 5e-3, 6e-3), (4.5e-3, 6.5e-3, 8e-3)),
        overrides=["family.radius=5 mm", "family.length=8 mm"],
    )
    found = api.meta_model(opened).next(8)
    assert all(one.parameters["radius_m"] <= one.parameters["length_m"] for one in found)


def test_the_table_is_a_sweep(unseen, tmp_path):
    found = unseen.next(2)
    path = tmp_path / "next.csv"
    write_proposals(found, path)
    text = bench.unseen(tmp_path).read_text() + (
        "sweep: {designs: next.csv}\nfem: {kind: springs_fem, pressure_max: 15 kPa}\n"
    )
    (tmp_path / "again.yaml").write_text(text)
    designs = sweep_designs(api.open_study(tmp_path / "again.yaml", store=tmp_path / "store").study)
    assert [tuple(d.changes.values()) for d in designs] == [one.values for one in found]


def test_without_gain_the_largest_doubt_is_taken_and_without_doubt_the_emptiest_place(unseen):
    def best(doubt):
        stage = replace(unseen.stage, laws=_Mute(unseen.stage.laws, doubt))
        (found,) = designs_to_solve(unseen.opened.context, unseen.opened.study, stage, 1)
        return found

    doubtful, far = best(lambda values: values[:, 0]), best(lambda values: np.ones(len(values)))
    assert doubtful.basis == "doubt" and doubtful.parameters["radius_m"] == pytest.approx(5.5e-3, rel=0.01)
    assert far.basis == "distance" and far.gain == pytest.approx(near(unseen, [far])[0])
    # The middle of a cell of the grid of 4 × 3: half its diagonal away from the corners.
    assert far.gain == pytest.approx(np.hypot(1 / 6, 1 / 4), rel=0.15)
