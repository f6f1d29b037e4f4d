"""A study whose law comes from a meta-model: by its parameters alone, inside the range, readable elsewhere."""

import json
import shutil

import numpy as np
import pytest
from tests.pliant_designs import meta_bench as bench
from tests.pliant_designs.sweep_bench import solved as log_of
from tests.pliant_designs.sweep_bench import study as sweep_study

from pliant import api
from pliant.config.study import study_model
from pliant.errors import UserError
from pliant.pipeline.run_folder import read_folder, write_folder
from pliant.pipeline.study import build_study_laws
from pliant.registry.discovery import discover
from pliant_designs.error_bars import LEVELS
from pliant_designs.solved_designs import design_values

RADIUS, LENGTH = 4.7e-3, 8.6e-3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a table, a study and a store that keeps the fitted model."""
    place = tmp_path_factory.mktemp("unseen")
    bench.unseen(place)
    return place


def opened(folder, *changes, overrides=()):
    return bench.opened(folder, *changes, data=folder / "fem.csv", overrides=overrides)


def laws(folder, *changes, overrides=()):
    one = opened(folder, *changes, overrides=overrides)
    return build_study_laws(one.context, one.study)


def test_the_law_for_an_unseen_design_is_close_and_its_band_covers_the_truth(folder):
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
    (stages,) = build_study_laws(one.context, one.study)
    assert log_of(log).total() == before
    assert stages.law.report.details["n_designs"] == 6
    assert one.study.unused() == []
    softer = api.open_study(path, ["material.shear_modulus=230 kPa"], store=tmp_path / "store")
    solved = api.meta_model(one).stage.solved
    with pytest.raises(
        UserError, match="material.shear_modulus is 230 kPa, and all solved designs .* 240 kPa"
    ):
        design_values(
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
        build_study_laws(one.context, one.study)
    assert not log.exists()


def test_a_sweep_beside_a_table_is_said_to_be_unused():
    study = study_model({}, discover()).model_validate(
        {"name": "s", "sweep": {"radius": [1]}, "meta_model": {"kind": "k", "data": "t"}}
    )
    assert study.unused() == ["sweep"]
    assert study.model_copy(update={"meta_model": None}).unused() == ["sweep"]
    beside = study.model_copy(update={"surrogate": study.block("meta_model")})
    assert beside.unused() == ["sweep", "surrogate"]


def test_the_run_folder_gives_the_law_on_another_machine(folder, tmp_path, monkeypatch):
    here = opened(folder)
    run = api.simulate(here)
    out = tmp_path / "out"
    out.mkdir()
    write_folder(out, run, {"study": "unseen"})
    away = tmp_path / "away"
    shutil.move(out, away)
    read = read_folder(away, here.context.registry)
    (design,) = read.designs
    p, u = np.linspace(0, 15e3, 9), np.linspace(-0.1, 0.5, 9)[:, None]
    mine, theirs = run.designs[0].law.law, design.law
    assert np.array_equal(mine.evaluate(p, u).tau, theirs.evaluate(p, u).tau)
    assert np.array_equal(mine.band(p, u), theirs.band(p, u))
    assert design.fit.details["meta_model"] == "stand_in"
    assert json.loads((away / "run.json").read_text())["meta_models"][0]["kind"] == "stand_in"
    for name in ("law_sources", "blocks"):  # as without the package
        monkeypatch.setattr(f"pliant.pipeline.run_folder.{name}", dict)
    with pytest.raises(UserError, match="belongs to the package pliant_designs"):
        read_folder(away, here.context.registry)


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


def test_nothing_is_fitted_twice_and_a_table_counts_by_its_content(folder, tmp_path):
    first = api.meta_model(opened(folder)).stage
    moved = bench.unseen(tmp_path, data=shutil.copy(folder / "fem.csv", tmp_path / "moved.csv"))
    again = [opened(folder, overrides=[f"meta_model.extrapolate={word}"]) for word in ("false", "true")]
    for one in (*again, api.open_study(moved, store=folder / "store")):
        stage = api.meta_model(one).stage
        assert stage.artifact.cached and stage.artifact.key == first.artifact.key
    other = api.meta_model(opened(folder, overrides=["meta_model.folds=3"])).stage
    assert other.artifact.key != first.artifact.key and (first.parts, other.parts) == (12, 3)


CHAIN = "chain: {modules: 2, gravity: [0, 0, 0]}"
STATED = "{kind: polynomial, form: study, coefficients: {k_n: 2e-6, m_a: 0, b_a: 0, m_e: 0.1, b_e: 0.05}}"


def test_segments_with_two_designs_have_two_laws_and_one_with_a_surrogate_keeps_its_own(folder):
    segments = (
        f"{{modules: 1}}, {{modules: 1, family: {{radius: 5.2 mm}}}}, {{modules: 1, surrogate: {STATED}}}"
    )
    stages = laws(folder, (CHAIN, f"chain: {{segments: [{segments}], gravity: [0, 0, 0]}}"))
    gains = [s.law.law.evaluate(np.array([1e4]), np.zeros((1, 1))).dtau_dp[0, 0] for s in stages]
    assert gains == pytest.approx([2e-6 * (4.7 / 5) ** 2, 2e-6 * (5.2 / 5) ** 2, 2e-6], rel=0.01)
    assert len({s.law.key for s in stages}) == 3
    assert [s.design.shared is None for s in stages] == [False, False, True]
    assert stages[2].law.artifact is None


SPRINGS = "{kind: springs, radius: 4.7 mm, length: 8.6 mm}"
BELLOW = (
    "{kind: bellow_bending, inner_radius: 3 mm, average_radius: 7 mm, wall: 1.5 mm, module_length: 10 mm}"
)


@pytest.mark.parametrize(
    ("change", "overrides", "sentence"),
    [
        (("4.7 mm", "6 mm"), [], "family.radius is 6 mm, outside the meta-model's range 4 mm to 5.5"),
        (("8.6 mm", "7.9 mm"), [], "family.length is 7.9 mm, outside .* range 8 mm to 10 mm"),
        ((SPRINGS, BELLOW), [], "'radius_m' varies .* not a parameter of the study's family"),
        (("name: unseen", "name: other"), ["meta_model.folds=40"], "folds is 40, and there are 12 designs"),
    ],
)
def test_a_design_for_which_the_model_does_not_hold(folder, change, overrides, sentence):
    with pytest.raises(UserError, match=sentence):
        laws(folder, change, overrides=overrides)


def test_scores_stand_in_the_law_s_report_and_whether_the_design_is_inside(folder):
    on_the_border = [("radius: 4.7 mm", "radius: 5.5 mm"), ("length: 8.6 mm", "length: 8 mm")]
    (stages,) = laws(folder, *on_the_border)
    report = stages.law.report
    assert report.n_heldout == 12 * 16
    assert report.worst_of_range == report.details["scores"]["all"]["worst_of_range"]
    assert set(report.details["coverage"]["all"]) == {f"{level:g}" for level in LEVELS}
    assert (report.details["stable"], report.details["inside"]) == (True, True)
    (stages,) = laws(folder, ("radius: 4.7 mm", "radius: 5.8 mm"), overrides=["meta_model.extrapolate=true"])
    assert stages.law.report.details["inside"] is False
