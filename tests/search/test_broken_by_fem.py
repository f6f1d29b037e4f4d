"""A best design that breaks a constraint by direct FEM is not called verified, and the next valid one is taken."""

import json
from pathlib import Path

import pytest
from tests.command import called
from tests.pliant_designs import meta_bench
from tests.search.test_verification import SPRINGS

from pliant import api
from pliant.fem_tables.reading import read_designs_table
from pliant_search import stage
from pliant_search.evaluate.evaluator import build_search_problem
from pliant_search.report.document import search_document
from pliant_search.stage import search_study
from pliant_search.verify.check import converged
from pliant_search.verify.next_best import next_best

ENGINE, ANGLE = "quasistatic", "max_joint_angle_rad"
LIMIT = float(meta_bench.free_angle(4.81e-3, 8.6e-3, 10e3))
# The few designs make the law 0.04 % off, and FEM finds a larger angle than the search.
SEARCH = (
    "search: {{variables: {{family.radius: {{low: 4.75 mm, high: 4.85 mm}}}}, objective: '-max_joint_angle_rad', "
    "constraints: ['max_joint_angle_rad <= {limit!r}'], budget: 40, seed: 1, verify: {{others: {others}}}}}\n"
)


def searched(folder, others):
    """Return the springs with the angle pressed against its limit; the search itself is done once."""
    block = SEARCH.format(limit=LIMIT, others=others)
    changes = (
        ("physics: quasistatic", f"{block}{SPRINGS}\nphysics: quasistatic"),
        ("radius: 4.7", "radius: 4.8"),
    )
    few = meta_bench.table(folder, radii=(4e-3, 4.7e-3, 5.5e-3))
    opened = meta_bench.opened(folder, *changes, data=few)
    return opened, api.optimize(opened, workers=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("broken")


@pytest.fixture(scope="module")
def refused(folder):
    return searched(folder, others=0)


def test_a_broken_constraint_is_said_everywhere(refused):
    opened, result = refused
    document = search_document(opened.study.canonical(), result, engine=ENGINE)
    assert result.verification.verified[ENGINE][ANGLE] > LIMIT
    assert not converged(result, opened.study, ENGINE)
    assert document.sentence.startswith("No design is confirmed: by direct FEM the best one breaks")
    assert not any("Verified by direct FEM" in text for _, text in document.answers)
    assert document.data["verified"]["broken"][ENGINE]


def test_the_next_design_that_holds_is_the_best_one(refused, folder):
    opened, result = searched(folder, others=3)
    assert result.verification.verified[ENGINE][ANGLE] <= LIMIT
    assert dict(result.refused_by_check[0].values) == dict(refused[1].best[0].values)
    assert not result.verification.broken and converged(result, opened.study, ENGINE)


def test_candidates_hold_with_the_error_that_fem_showed(refused):
    opened, result = refused
    check = result.verification
    ratio = check.verified[ENGINE][ANGLE] / check.predicted[ENGINE][ANGLE]
    proposed = list(next_best(build_search_problem(opened.context, opened.study), result, check, ENGINE))
    assert proposed and all(ratio * design.metrics[ANGLE] <= LIMIT for design in proposed)


WIDE = (4e-3, 5.5e-3)  # two radii: the law is a quarter of its range off between them


def going_on(folder, rounds, others=0):
    """Return the springs whose law is far off, and a search that continues with the FEM of the refused design."""
    block = SEARCH.format(limit=LIMIT, others=f"{others}, rounds: {rounds}")
    changes = (
        ("physics: quasistatic", f"{block}{SPRINGS}\nphysics: quasistatic"),
        ("radius: 4.7", "radius: 4.8"),
    )
    place = folder / "wide"
    place.mkdir(exist_ok=True)
    opened = meta_bench.opened(place, *changes, data=meta_bench.table(place, radii=WIDE))
    return opened, search_study(opened.context, opened.study, workers=1)


def test_the_search_continues_with_the_fem_from_its_refused_best_design(folder):
    opened, alone = going_on(folder, rounds=0)
    assert alone.value.verification.broken[ENGINE] and not alone.value.rounds
    opened, made = going_on(folder, rounds=2)
    result = made.value
    (first,) = result.rounds  # one was enough
    assert dict(first.best.values) == dict(alone.value.best[0].values)
    assert first.worst_of_range > 0.2 and first.broken
    angle = result.verification.verified[ENGINE][ANGLE]
    assert 0.999 * LIMIT < angle <= LIMIT and not result.verification.broken
    assert converged(result, opened.study, ENGINE)
    radii = {one.design.parameters["radius_m"] for one in read_designs_table(Path(first.table))}
    assert radii > set(WIDE) and len(radii) == 3
    assert any(radius == pytest.approx(first.best.values["family.radius"]) for radius in radii)


def test_rounds_are_said_and_found_again(folder):
    opened, made = going_on(folder, rounds=2)
    document = search_document(opened.study.canonical(), made.value, engine=ENGINE)
    (said,) = document.data["rounds"]
    assert made.cached and said["broken"] and said["evaluations"] > 0
    assert said["design"] == {"family.radius_m": made.value.rounds[0].best.values["family.radius"]}
    assert "by direct FEM its best design broke a constraint" in document.sentence
    assert any("of the range off" in point for point in document.points)
    assert any(line.startswith("round    1: ") for line in document.brief)
    assert any("Verified by direct FEM" in text for _, text in document.answers)


def test_an_interrupted_round_goes_on(folder, tmp_path, monkeypatch):
    """The first search and its check are in the store; only the second one is repeated, with the same result."""
    _, whole = going_on(folder, rounds=2)
    asked, result = [], stage.Search.result

    def interrupted(self):
        asked.append(self)
        found = result(self)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return found

    monkeypatch.setattr(stage.Search, "result", interrupted)
    with pytest.raises(KeyboardInterrupt):
        going_on(tmp_path, rounds=2)
    _, made = going_on(tmp_path, rounds=2)
    assert len(asked) == 3 and asked[2].before
    assert made.value.best[0].values == whole.value.best[0].values


def test_the_study_with_the_best_design_has_the_meta_model_from_its_round(folder, monkeypatch):
    monkeypatch.chdir(folder)
    going_on(folder, rounds=2)
    place = folder / "wide"
    called("optimize", place / "unseen.yaml", "--out", place / "run", "--store", place / "store").done()
    called(
        "simulate", place / "run" / "best.yaml", "--json", place / "best.json", "--store", place / "store"
    ).done()
    told = json.loads((place / "run" / "optimize.json").read_text())
    simulated = json.loads((place / "best.json").read_text())["metrics"][ANGLE]
    assert simulated == pytest.approx(told["best"]["metrics"][ANGLE], rel=1e-6)
    assert simulated == pytest.approx(told["verified"][ANGLE], rel=1e-3)
    assert "designs.csv" in (place / "run" / "best.yaml").read_text()


def leaning_on(folder, verify):
    """Return the largest angle of the springs whose law is far off between two radii; no constraint is broken."""
    block = (
        "search: {variables: {family.radius: {low: 4.75 mm, high: 4.85 mm}}, objective: '-max_joint_angle_rad', "
        f"budget: 40, seed: 1, verify: {{{verify}}}}}\n"
    )
    changes = (
        ("physics: quasistatic", f"{block}{SPRINGS}\nphysics: quasistatic"),
        ("radius: 4.7", "radius: 4.8"),
    )
    place = folder / "leaning"
    place.mkdir(exist_ok=True)
    opened = meta_bench.opened(place, *changes, data=meta_bench.table(place, radii=WIDE))
    return opened, search_study(opened.context, opened.study, workers=1).value


def test_a_search_whose_law_misses_fem_goes_on_with_that_fem(folder):
    opened, alone = leaning_on(folder, "rounds: 0")
    assert not alone.rounds and not alone.verification.broken
    (said,) = (note for note in alone.verification.notes if "leans on extrapolation" in note)
    assert "misses FEM by 25 % of its range" in said
    opened, result = leaning_on(folder, "rounds: 2")
    first, (law,) = result.rounds[0], result.verification.laws
    assert first.leaning and not first.broken
    assert first.worst_of_range > 0.2 and law["worst_of_range"] < 0.03
    assert not any("misses FEM" in note for note in result.verification.notes)
    document = search_document(opened.study.canonical(), result, engine=ENGINE)
    assert "leant on extrapolation" in document.sentence
    assert any("leans on extrapolation" in line for line in document.brief)


def test_an_accepted_error_is_no_cause(folder):
    _, result = leaning_on(folder, "rounds: 1, law_error: 0.9")
    causes = [cause for one in result.rounds for cause in one.leaning]
    assert not any("misses FEM" in cause for cause in (*causes, *result.verification.notes))
