"""A printer's least wall as a constraint of a search: as a key, and as the wall measured on each candidate's solid."""

from __future__ import annotations

import pytest
from tests.search import evaluation_bench as bench

from pliant.errors import UserError
from pliant_search.evaluate.evaluator import Evaluator

TUBE = """\
pliant: 1
name: walls
family:
  kind: fibre_reinforced
  module_length: 20 mm
  radius: 6 mm
  wall: 3 mm
  sleeve: 1 mm
  thread_angle: 87 deg
  thread_spacing: 1 mm
  thread_stiffness: 100 N
  sheet_angle: 45 deg
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 2e-6, m_a: 0, b_a: 0, m_e: 0, b_e: 0.04}}
chain: {modules: 1, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 10 kPa, steps: 1}
printer: {min_wall: 0.8 mm}
"""
SEARCH = """\
variables: {family.wall: {low: 1.4 mm, high: 4 mm}}
constraints: [CONSTRAINT]
objective: family.wall
"""


def evaluated(folder, constraint, wall_m):
    one, problem = bench.opened(folder, TUBE, SEARCH.replace("CONSTRAINT", f'"{constraint}"'))
    name = problem.variables[0].name
    return Evaluator(one.context, problem).evaluate({name: wall_m})


def test_the_measured_wall_is_a_metric_of_a_candidate_that_a_formula_names(tmp_path):
    thick = evaluated(tmp_path, "thinnest_wall >= printer.min_wall", 3e-3)
    assert thick.state == "ok" and thick.violation == 0.0
    assert thick.metrics["thinnest_wall_m"] == pytest.approx(1e-3, rel=0.01)  # the sheet
    thin = evaluated(tmp_path, "thinnest_wall >= printer.min_wall", 1.5e-3)
    assert thin.violation > 0.0  # the liner under the sheet has 0.5 mm
    assert thin.metrics["thinnest_wall_m"] == pytest.approx(0.5e-3, rel=0.01)


def test_without_the_name_no_solid_is_made(tmp_path):
    trial = evaluated(tmp_path, "family.wall >= printer.min_wall", 3e-3)
    assert trial.state == "ok" and "thinnest_wall_m" not in trial.metrics


def test_the_printer_s_key_needs_its_block(tmp_path):
    text = TUBE.replace("printer: {min_wall: 0.8 mm}\n", "")
    with pytest.raises(UserError, match=r"no 'printer' block"):
        bench.opened(tmp_path, text, SEARCH.replace("CONSTRAINT", '"family.wall >= printer.min_wall"'))
