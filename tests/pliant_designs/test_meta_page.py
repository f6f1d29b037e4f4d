"""The page of a meta-model: scores, parity, errors over designs and cost are those of the records."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.report.pages import check_sound

from pliant.execution.progress import Silent
from pliant.formatting import percent
from pliant.report.document import Document, page_table
from pliant.report.render import page
from pliant.report.still import still
from pliant_designs.cross_validation import (
    cross_validation_folds,
    misses_left_out,
    scores_by_place,
)
from pliant_designs.error_bars import Bars
from pliant_designs.fitted_model import MetaFitted
from pliant_designs.learning import design_learning
from pliant_designs.next_design import Proposal
from pliant_designs.records import SolvedDesigns
from pliant_designs.report.meta import meta_sentence, meta_warnings
from pliant_designs.report.meta_page import (
    SCORES,
    WORTH,
    cost_table,
    coverage_table,
    designs_chart,
    learning_table,
    meta_drawn,
    next_table,
    parameter_unit,
    parity_chart,
    score_rows,
    worst_table,
)
from pliant_designs.samples import solved_designs, solved_spherical_designs
from pliant_designs.solved_designs import SourcedDesigns
from pliant_designs.stage import MetaModelStage
from pliant_designs.stand_in import StandInMetaModel, StandInMetaModelConfig


def model() -> StandInMetaModel:
    return StandInMetaModel(StandInMetaModelConfig())


def make_fitted(designs: SolvedDesigns) -> MetaFitted:
    """Return a stand-in model with its scores, and FEM of 3 s a design."""
    data = tuple(replace(one, wall_s=np.full(len(one), 3.0 / len(one))) for one in designs.data)
    designs = replace(designs, data=data)
    with TemporaryDirectory() as folder:
        misses = misses_left_out(
            model(), designs, cross_validation_folds(designs, 4, 4), Path(folder), Silent()
        )
    bars = Bars.from_residuals(designs, misses)
    artifact: Any = SimpleNamespace(value={"misses": vars(misses)})
    stage = MetaModelStage(
        StandInMetaModelConfig(), SourcedDesigns(designs, {}, "the sweep's 16 designs"), model().fit(designs).laws,
        scores_by_place(designs, misses), bars.coverage(designs.corners()), bars, {"terms": 7, "regressor": "a_b"},
        4, 0.5, 2.0, artifact,
    )  # fmt: skip
    curve: Any = SimpleNamespace(value=design_learning(model(), designs, Silent()))
    return MetaFitted(stage, curve)


@cache
def fitted() -> MetaFitted:
    return make_fitted(solved_designs((4, 4)))


def timed(one: MetaFitted, **changes: Any) -> MetaFitted:
    """Return the fit with other fields, a law taking 2 ms and three million evaluations a second."""
    made = replace(one, **changes)
    made.__dict__["_timed"] = (2e-3, 3e6)
    return made


def with_designs(one: MetaFitted, designs: SolvedDesigns) -> Any:
    """Return its stage with other designs."""
    return replace(one.stage, solved=replace(one.stage.solved, designs=designs))


@pytest.mark.pixels
def test_the_page_holds_every_part_and_nothing_from_outside() -> None:
    proposals = (Proposal(fitted().designs.names, (7.1e-3, 1.3e-3), 0.12, "gain"),)
    one = timed(fitted(), proposals=proposals)
    made = page(
        Document("", "a <model>", meta_sentence(one), draw=lambda: meta_drawn([one], {"name": "x"}, []))
    )
    text = check_sound(made)
    assert set(made.pictures) == {"meta_parity", "meta_free", "meta_designs", "meta_bars", "meta_learning"}
    assert "a &lt;model&gt;" in made.html and meta_sentence(one) in text and "Solve these next" in text


def test_scores_are_the_pipelines_own() -> None:
    one = fitted()
    table = page_table("", SCORES, score_rows([one]))
    rows = {row[0]: row[1:] for row in table.rows}
    assert list(rows) == ["all", "interior", "border"]
    for place, scores in one.stage.scores.items():
        axis = scores.axes["y"]
        assert rows[place][0] == str(scores.n_designs)
        assert rows[place][2] == f"{axis.r2:.6f}"
        assert rows[place][4] == percent(axis.worst_of_range, 3)
        assert rows[place][5] == percent(scores.free_median, 3)
    assert percent(one.stage.scores["interior"].worst_of_range) in meta_sentence(one)
    beside = [row.label for row in score_rows([one, one])]
    assert beside[3:] == [f"{one.name}: {place}" for place in rows]
    names = ("average_radius_m", "material.shear_modulus_pa", "convolutions")
    units = ["average radius (mm)", "shear modulus (kPa)", "convolutions"]
    assert [parameter_unit(name).axis for name in names] == units


def test_the_worst_designs_have_the_worst_states() -> None:
    one = fitted()
    every = np.abs(one.shares[:, 0])
    design = int(one.misses.design[np.argmax(every)])
    assert one.worst_designs(1) == [design]
    assert one.worst[design] == pytest.approx(one.stage.scores["all"].worst_of_range, rel=1e-12)
    row = worst_table(one).rows[0]
    assert row[0] == percent(float(every.max()), 3)
    assert row[1] == ("border" if one.designs.corners()[design] else "interior")
    assert float(row[2]) == pytest.approx(1e3 * one.designs.values[design, 0], rel=1e-3)


def test_cost_is_fem_against_milliseconds() -> None:
    rows = {row[0]: row[1] for row in cost_table(timed(fitted())).rows}
    assert rows["FEM, one design"] == "3.0 s"
    assert rows["law of an unseen design, with its error bar"] == "2.0 ms"
    assert rows["a design by the model instead of FEM"] == "1500 times faster"
    assert rows["FEM saved by every thousand further designs"] == "0.83 hours of one core"
    nobody_knows = timed(
        fitted(), stage=with_designs(fitted(), replace(fitted().designs, data=tuple(
            replace(one, wall_s=one.wall_s * np.nan) for one in fitted().designs.data
        ))),
    )  # fmt: skip
    assert "FEM, one design" not in {row[0] for row in cost_table(nobody_knows).rows}


def test_coverage_and_proposals_are_told() -> None:
    table = coverage_table(fitted())
    assert table.rows[0][0] == "all"
    assert table.rows[0][2] == percent(fitted().stage.coverage["all"]["0.9"], 3)
    assert next_table(fitted()) is None
    asked = replace(fitted(), proposals=(Proposal(fitted().designs.names, (7.1e-3, 1.3e-3), 0.12, "doubt"),))
    found = next_table(asked)
    assert found is not None and list(found.rows[0]) == ["1", "7.1", "1.3", "12 %"]
    assert found.head[-1] == WORTH["doubt"]


def test_distant_designs_are_warned_about() -> None:
    assert max(scores.worst_of_range for scores in fitted().stage.scores.values()) < 0.05
    assert meta_warnings(fitted()) == []
    bad = replace(fitted().stage.scores["border"], free_lost=2)
    axis = replace(bad.axes["y"], worst_of_range=0.3)
    scores = {"all": bad, "border": replace(bad, axes={"y": axis})}
    assert len(meta_warnings(replace(fitted(), stage=replace(fitted().stage, scores=scores)))) == 2


def test_learning_over_designs_never_fits_what_it_scores() -> None:
    seen = []

    class WatchedMetaModel(StandInMetaModel):
        def fit(self, designs):  # type: ignore[no-untyped-def]
            seen.append({tuple(v) for v in designs.values})
            return super().fit(designs)

    designs = solved_designs((4, 4))
    curve = design_learning(WatchedMetaModel(StandInMetaModelConfig()), designs, Silent())
    tests = {tuple(designs.values[i]) for i in curve["test"]}
    assert len(tests) == 4 and all(not (one & tests) for one in seen)
    sizes = [len(one) for one in seen]
    assert sizes == sorted(sizes) and sizes[-1] == 12
    assert all(few <= more for few, more in pairwise(seen))
    points = curve["points"]
    assert points[-1]["all"]["worst"] < points[0]["all"]["worst"]
    rows = learning_table(curve).rows
    assert rows[-1][:2] == ["12", percent(points[-1]["all"]["rms"], 3)]


def test_an_interrupted_curve_over_designs_goes_on(tmp_path: Path) -> None:
    kept = tmp_path / "points.json"
    designs = solved_designs((4, 4))
    first = design_learning(model(), designs, Silent(), kept)

    class Never(StandInMetaModel):
        def fit(self, designs):  # type: ignore[no-untyped-def]
            raise AssertionError("it was fitted already")

    assert design_learning(Never(StandInMetaModelConfig()), designs, Silent(), kept) == first


@pytest.mark.slow
def test_three_axes_and_one_parameter_have_pictures_too() -> None:
    three = make_fitted(solved_spherical_designs((3, 3)))
    rows = [row.label for row in score_rows([three])]
    assert [row for row in rows if row.startswith("all")] == ["all, axis x", "all, axis y", "all, axis z"]
    assert "all" in three.stage.coverage and len(still(parity_chart(three)).tobytes()) > 10_000
    one = fitted()
    values = one.designs.values[:, :1]
    line = replace(
        one, stage=with_designs(one, replace(one.designs, names=one.designs.names[:1], values=values))
    )
    assert len(still(designs_chart(line)).tobytes()) > 5_000
