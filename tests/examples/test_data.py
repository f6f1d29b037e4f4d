"""The data sets of examples/data: they can be read, agree with their provenance, and agree with the FEM."""

import json
from pathlib import Path

import numpy as np
import pytest

from pliant import api
from pliant.fem_tables.reading import read_table
from pliant.pipeline.dataset import MAIN, module_problems
from pliant.pipeline.study import build_study_laws

DATA = Path(__file__).parents[2] / "examples/data"
FAMILIES = ("bellow_bending", "bellow_helical", "bellow_translational", "tendon_joint")
TRUSTED = ("ok", "passed_through")


def table(family):
    return read_table(DATA / f"{family}.csv", "y" if family == "bellow_helical" else None)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_table_reads_back_with_both_branches(family):
    data = table(family)
    trusted = data.rows(np.isin(data.status, TRUSTED))
    free, held = trusted.rows(trusted.branch == "free"), trusted.rows(trusted.branch == "constrained")
    assert len(free) >= 5
    assert len(held) >= 8
    assert np.abs(free.moment_n_m).max() < 1e-6 * np.ptp(data.moment_n_m)
    assert np.all(trusted.dmoment_du < 0)
    assert (DATA / f"{family}.csv").stat().st_size < 100_000


@pytest.mark.parametrize("family", FAMILIES)
def test_the_provenance_equals_the_study_next_to_it(family):
    told = json.loads((DATA / f"{family}.json").read_text())
    study = api.open_study(DATA / "fem" / f"{family}.yaml").study
    for block in ("family", "material", "fem"):
        now = json.loads(json.dumps(getattr(study, block).canonical()))
        assert {name: now[name] for name in told[block]} == told[block]
    rows = (DATA / f"{family}.csv").read_text().splitlines()
    assert told["states"]["solved"] == len(rows) - 1
    assert told["states"]["failed"] == 0


@pytest.mark.parametrize("family", FAMILIES)
def test_the_study_beside_it_has_its_family_and_fits_a_law(family, tmp_path):
    opened = api.open_study(DATA / f"{family}.yaml", store=tmp_path)
    made = api.open_study(DATA / "fem" / f"{family}.yaml").study
    assert opened.study.family == made.family
    assert opened.study.material == made.material
    (stages,) = build_study_laws(opened.context, opened.study)
    assert stages.law.law.joint == opened.context.build("family", made.family).joint
    assert stages.law.report.worst_of_range < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_solving_three_states_again_gives_the_same_numbers(family):
    opened = api.open_study(DATA / "fem" / f"{family}.yaml")
    study, context = opened.study, opened.context
    problem = module_problems(context.build("family", study.family), study.fem.refinement)[MAIN]
    solver = context.build("fem", study.fem).solver(problem, context.build("material", study.material))
    data = table(family)
    free, held = (np.flatnonzero(data.branch == branch) for branch in ("free", "constrained"))
    state = solver.rest()
    for row in (free[1], free[-1]):
        state = solver.free(data.actuation[row], state)
        assert state.angle_rad == pytest.approx(data.angle_rad[row], rel=1e-6)
        assert state.dmoment_du == pytest.approx(data.dmoment_du[row], rel=1e-6)
    near = held[np.argmax(data.actuation[held] * data.angle_rad[held])]
    state = solver.constrained(data.actuation[near], data.angle_rad[near], state)
    assert state.moment_n_m == pytest.approx(data.moment_n_m[near], rel=1e-6)
    assert state.dmoment_dp == pytest.approx(data.dmoment_dp[near], rel=1e-6)
