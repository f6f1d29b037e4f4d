"""A study whose law comes from a meta-model: by nothing but parameters, inside the range, readable elsewhere."""

import json
import shutil
from html import unescape

import numpy as np
import pytest
from tests.pipeline import meta_bench as bench
from tests.pipeline.sweep_bench import solved as log_of
from tests.pipeline.sweep_bench import study as sweep_study

from pliant import api
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.pipeline.meta_model.designs import values_of
from pliant.pipeline.meta_model.error_bars import LEVELS
from pliant.pipeline.study import laws_of_study
from pliant.report.folder import finished, read_folder, write_folder
from pliant.report.render import page
from pliant.report.run import run_document

RADIUS, LENGTH = 4.7e-3, 8.6e-3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a table, a study and a store that keeps the fitted model."""
    place = tmp_path_factory.mktemp("unseen")
    bench.unseen(place)
    return place


def opened(folder, *changes, overrides=()):
    return bench.opened(folder, *changes, data=folder / "fem.csv", overrides=overrides)


def laws(folder, *changes, overrides=()):
    one = opened(folder, *changes, overrides=overrides)
    return laws_of_study(one.bench, one.study)


def test_the_law_of_an_unseen_design_is_close_and_its_band_holds_the_truth(folder):
    (stages,) = laws(folder)
    law = stages.law.law
    assert stages.fem is None
    k, c, d = bench.springs_law(RADIUS, LENGTH)
    p, u = np.meshgrid(np.linspace(0, 15e3, 6), np.linspace(-0.15, 0.45, 7))
    p, u = p.ravel(), u.ravel()
    missed = np.abs(law.evaluate(p, u[:, None]).tau[:, 0] - (k * p - c * u - d * u**2))
    assert missed.max() < 0.01 * k * 15e3
    assert np.mean(missed <= law.band(p, u[:, None], 0.99)[:, 0]) > 0.9
    narrow, wide = (law.band(p, u[:, None], level) for level in (0.5, 0.9))
    assert np.all(narrow < wide)


def test_the_whole_study_runs(folder):
    run = api.simulate(opened(folder))
    angles = run.engines[0].result.final.joint_angles
    assert angles == pytest.approx(bench.free_angle(RADIUS, LENGTH, 10e3), rel=0.01)
    assert run.unused == ()


def test_nothing_is_fitted_twice(folder):
    first = api.meta_model(opened(folder))
    again = api.meta_model(opened(folder))
    assert again.stage.artifact.cached
    assert again.stage.artifact.key == first.stage.artifact.key
    other = api.meta_model(opened(folder, overrides=["meta_model.extrapolate=true"]))
    assert other.stage.artifact.cached


def test_folds_make_other_scores_and_another_artifact(folder):
    one = api.meta_model(opened(folder)).stage
    other = api.meta_model(opened(folder, overrides=["meta_model.folds=3"])).stage
    assert one.artifact.key != other.artifact.key
    assert (one.parts, other.parts) == (12, 3)


def test_the_table_counts_by_its_content(folder, tmp_path):
    one = api.meta_model(opened(folder)).stage
    moved = shutil.copy(folder / "fem.csv", tmp_path / "moved.csv")
    path = bench.unseen(tmp_path, data=moved)
    other = api.meta_model(api.open_study(path, store=folder / "store")).stage
    assert other.artifact.cached
    assert other.artifact.key == one.artifact.key


def test_two_segments_of_two_designs_have_two_laws(folder):
    chain = "chain: {segments: [{modules: 1}, {modules: 1, family: {radius: 5.2 mm}}], gravity: [0, 0, 0]}"
    stages = laws(folder, ("chain: {modules: 2, gravity: [0, 0, 0]}", chain))
    assert len(stages) == 2
    gains = [s.law.law.evaluate(np.array([1e4]), np.zeros((1, 1))).dtau_dp[0, 0] for s in stages]
    assert gains == pytest.approx([2e-6 * (4.7 / 5) ** 2, 2e-6 * (5.2 / 5) ** 2], rel=0.01)
    assert stages[0].law.key != stages[1].law.key


def test_a_segment_with_a_surrogate_of_its_own_keeps_it(folder):
    stated = "{kind: polynomial, form: study, coefficients: {k_n: 2e-6, m_a: 0, b_a: 0, m_e: 0.1, b_e: 0.05}}"
    chain = f"chain: {{segments: [{{modules: 1}}, {{modules: 1, surrogate: {stated}}}], gravity: [0, 0, 0]}}"
    stages = laws(folder, ("chain: {modules: 2, gravity: [0, 0, 0]}", chain))
    assert [s.design.meta_model is None for s in stages] == [False, True]
    assert stages[1].law.artifact is None


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ("radius: 4.7 mm", "radius: 6 mm"),
            "family.radius is 6 mm, outside the meta-model's range 4 mm to 5.5",
        ),
        (
            ("length: 8.6 mm", "length: 7.9 mm"),
            "family.length is 7.9 mm, outside .* range 8 mm to 10 mm; solve",
        ),
    ],
)
def test_a_design_for_which_the_model_does_not_hold(folder, change, sentence):
    with pytest.raises(UserError, match=sentence):
        laws(folder, change)


def test_a_family_of_another_kind(folder):
    family = (
        "{kind: bellow_bending, inner_radius: 3 mm, average_radius: 7 mm, wall: 1.5 mm, module_length: 10 mm}"
    )
    with pytest.raises(UserError, match="'radius_m' varies .* not a parameter of the study's family"):
        laws(folder, ("{kind: springs, radius: 4.7 mm, length: 8.6 mm}", family))


def test_extrapolation_is_allowed_by_choice_and_said(folder):
    (stages,) = laws(folder, ("radius: 4.7 mm", "radius: 5.8 mm"), overrides=["meta_model.extrapolate=true"])
    assert stages.law.report.details["inside"] is False


def test_a_wrong_number_of_folds_shows_before_any_fit(folder):
    with pytest.raises(UserError, match="folds is 40, and there are 12 designs"):
        laws(folder, overrides=["meta_model.folds=40"])


def test_a_design_on_the_border_is_inside(folder):
    (stages,) = laws(folder, ("radius: 4.7 mm", "radius: 5.5 mm"), ("length: 8.6 mm", "length: 8 mm"))
    assert stages.law.report.details["inside"] is True


def test_scores_stand_in_the_law_s_report(folder):
    (stages,) = laws(folder)
    report = stages.law.report
    assert report.n_heldout == 12 * 16
    assert report.worst_of_range == report.details["scores"]["all"]["worst_of_range"]
    assert set(report.details["coverage"]["all"]) == {f"{level:g}" for level in LEVELS}
    assert report.details["stable"] is True


def test_a_sweep_is_solved_and_then_no_design_again(tmp_path, monkeypatch):
    log = tmp_path / "log"
    monkeypatch.setenv("SPRINGS_LOG", str(log))
    bench.solved(tmp_path, "{radius: [4 mm, 4.5 mm, 5 mm], length: [8 mm, 9 mm]}")
    before = log_of(log).total()
    more = f"plugins: ['{bench.PLUGIN}', '{bench.META_PLUGIN}']"
    path = sweep_study(
        tmp_path, "{radius: [4 mm, 4.5 mm, 5 mm], length: [8 mm, 9 mm]}", "meta_model: stand_in\n"
    )
    path.write_text(path.read_text().replace(f"plugins: ['{bench.PLUGIN}']", more))
    one = api.open_study(path, ["family.radius=4.6 mm", "family.length=8.3 mm"], store=tmp_path / "store")
    (stages,) = laws_of_study(one.bench, one.study)
    assert log_of(log).total() == before
    assert stages.law.report.details["n_designs"] == 6
    assert one.study.unused() == []
    softer = api.open_study(path, ["material.shear_modulus=230 kPa"], store=tmp_path / "store")
    solved = api.meta_model(one).stage.solved
    with pytest.raises(
        UserError, match="material.shear_modulus is 230 kPa, and all solved designs .* 240 kPa"
    ):
        values_of(
            solved.designs.names,
            solved.designs.box,
            solved.designs.fixed,
            softer.study.family,
            softer.study.material,
            False,
        )


def test_a_sweep_that_is_too_small_is_refused_before_it_is_solved(tmp_path, monkeypatch):
    log = tmp_path / "log"
    monkeypatch.setenv("SPRINGS_LOG", str(log))
    path = sweep_study(tmp_path, "{radius: [4 mm, 5 mm], length: [8 mm, 9 mm]}", "meta_model: stand_in\n")
    plugins = f"plugins: ['{bench.PLUGIN}', '{bench.META_PLUGIN}']"
    path.write_text(path.read_text().replace(f"plugins: ['{bench.PLUGIN}']", plugins))
    one = api.open_study(path, store=tmp_path / "store")
    with pytest.raises(UserError, match="at least 4 designs and scored on one more, so 4 are too few"):
        laws_of_study(one.bench, one.study)
    assert not log.exists()


def test_a_sweep_beside_a_table_is_said_to_be_unused():
    study = Study.model_validate(
        {"name": "s", "sweep": {"radius": [1]}, "meta_model": {"kind": "k", "data": "t"}}
    )
    assert study.unused() == ["sweep"]
    assert study.model_copy(update={"meta_model": None}).unused() == ["sweep"]
    beside = study.model_copy(update={"surrogate": study.meta_model})
    assert beside.unused() == ["sweep", "surrogate"]


def test_the_run_folder_gives_the_law_on_another_machine(folder, tmp_path):
    here = opened(folder)
    run = api.simulate(here)
    out = tmp_path / "out"
    out.mkdir()
    write_folder(out, run, {"study": "unseen"})
    away = tmp_path / "away"
    shutil.move(out, away)
    read = read_folder(away, here.bench.registry)
    (design,) = read.designs
    p, u = np.linspace(0, 15e3, 9), np.linspace(-0.1, 0.5, 9)[:, None]
    mine, theirs = run.designs[0].law.law, design.law
    assert np.array_equal(mine.evaluate(p, u).tau, theirs.evaluate(p, u).tau)
    assert np.array_equal(mine.band(p, u), theirs.band(p, u))
    assert design.fit.details["meta_model"] == "stand_in"
    assert json.loads((away / "run.json").read_text())["meta_models"][0]["kind"] == "stand_in"


@pytest.mark.slow
def test_the_page_says_where_the_law_came_from(folder):
    here = opened(folder)
    document = run_document(finished(api.simulate(here), {"study": "unseen"}))
    assert "meta-model" in document.sentence and document.sentence in unescape(page(document).html)


def test_a_notebook_has_laws_scores_and_the_next_design(folder):
    unseen = api.meta_model(opened(folder))
    law = unseen.law({"radius": "5 mm", "length": "9 mm"})
    k, _, _ = bench.springs_law(5e-3, 9e-3)
    assert law.evaluate(np.array([1e4]), np.zeros((1, 1))).tau[0, 0] == pytest.approx(1e4 * k, rel=0.01)
    assert unseen.scores["all"].n_designs == 12
    (proposal,) = unseen.next()
    assert 4e-3 <= proposal.parameters["radius_m"] <= 5.5e-3
    with pytest.raises(UserError, match="family.radius is 9 mm"):
        unseen.law({"radius": "9 mm", "length": "9.5 mm"})
    with pytest.raises(UserError, match="radiuss"):
        unseen.law({"radiuss": "5 mm"})
