"""A search over designs of two chambers: their laws are a meta-model's of two pressures, known in closed form."""

from itertools import product

import numpy as np
import pytest
from tests.search import evaluation_bench as bench

from pliant import api
from pliant.records.law import Domain
from pliant.testing.samples import OpposedLaw
from pliant_designs.samples import free_angles
from pliant_search.evaluate.evaluator import Evaluator
from pliant_search.problem.study_setter import changed
from pliant_search.verify.direct_fem import default_fem

HEIGHTS_M, WALLS_M = (16e-3, 19e-3, 22e-3), (1.5e-3, 2e-3, 2.5e-3)
TOP_PA = 40e3
STUDY = """\
pliant: 1
name: opposed
family: {kind: two_chamber, width: 20 mm, height: 19 mm, wall: 2 mm, web: 2 mm, module_length: 10 mm}
material: {kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}
meta_model: {kind: regression, folds: 3, data: TABLE}
chain: {modules: 3, gravity: [0, 0, 0]}
physics: quasistatic
optimizer: cmaes
task: {kind: free_bending, inputs: {pressure_1_pa: 30 kPa, pressure_2_pa: 10 kPa}}
"""
SEARCH = """\
variables:
  family.height: {low: 16 mm, high: 22 mm}
  family.wall: {low: 1.5 mm, high: 2.5 mm}
objective: {maximize: bend_angle}
constraints: ["family.height + 4*family.wall <= 26 mm"]
budget: 160
verify: null
"""


def true_law(height_m, wall_m):
    """Return a law whose g grows with the height and whose stiffness grows with wall, height and pressures."""
    h, t = height_m / 19e-3, wall_m / 2e-3
    inputs = np.tile([0.0, TOP_PA], (2, 1))
    return OpposedLaw(Domain(inputs, np.array([[-0.4, 0.4]])), 6e-7 * h**2, 0.12 * t * h, 3e-7 * h, 0.1 * t)


def free_angle(height_m, wall_m, p1=30e3, p2=10e3):
    return free_angles(true_law(height_m, wall_m), np.array([[p1, p2]]))[0, 0]


def table(path):
    """Return states of nine designs as a sweep writes them."""
    random = np.random.default_rng(4)
    places = np.vstack([list(product((0.0, 1.0), repeat=3)), random.random((16, 3))])
    rows = [
        "pressure_1_pa,pressure_2_pa,angle_rad,moment_n_m,role,height_m,wall_m,width_m,web_m,module_length_m,design"
    ]
    for number, (height, wall) in enumerate(product(HEIGHTS_M, WALLS_M)):
        p, u = TOP_PA * places[:, :2], 0.4 * (2 * places[:, 2:] - 1)
        tau = true_law(height, wall).evaluate(p, u).tau
        for k, state in enumerate(np.hstack([p, u, tau])):
            told = ",".join(repr(float(value)) for value in state)
            role = "check" if k % 8 == 7 and k >= 8 else "fit"
            rows.append(f"{told},{role},{height},{wall},0.02,0.002,0.01,{number}")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    tmp_path = tmp_path_factory.mktemp("opposed")
    return bench.opened(tmp_path, STUDY.replace("TABLE", str(table(tmp_path / "fem.csv"))), SEARCH)


def test_a_candidate_bends_as_its_closed_form_says(opened):
    one, problem = opened
    evaluator = Evaluator(one.context, problem)
    for height, wall in ((17e-3, 1.7e-3), (18.5e-3, 1.6e-3)):
        found = evaluator.evaluate({"family.height": height, "family.wall": wall})
        assert found.state == "ok", found.cause
        assert found.metrics["bend_angle_rad"] == pytest.approx(3 * free_angle(height, wall), rel=5e-3)


@pytest.mark.slow
def test_the_search_finds_the_best_design_in_closed_form(opened):
    """Thin walls bend most, and the constraint then bounds the height: h = 26 mm − 4 · 1.5 mm."""
    one, _ = opened
    best = api.optimize(one, workers=1).best[0]
    grid = [
        (h, t)
        for h in np.linspace(16e-3, 22e-3, 61)
        for t in np.linspace(1.5e-3, 2.5e-3, 41)
        if h + 4 * t <= 26e-3
    ]
    most = max(3 * abs(free_angle(h, t)) for h, t in grid)
    assert abs(best.metrics["bend_angle_rad"]) == pytest.approx(most, rel=0.01)
    assert best.values["family.wall"] == pytest.approx(1.5e-3, rel=0.02)


def test_the_check_by_fem_is_as_wide_as_the_table_and_the_inputs(opened):
    """One largest pressure for both chambers: the table's 40 kPa, or 5 % above the largest of a task."""
    one, _ = opened
    wider = changed(one.context.registry, one.study, {"task.inputs.pressure_2_pa": 50e3})
    assert default_fem(one.context, [one.study]).pressure_max_pa == pytest.approx(TOP_PA)
    fem = default_fem(one.context, [one.study, wider])
    assert fem.actuation_max("pressure_1_pa, pressure_2_pa") == pytest.approx([52.5e3, 52.5e3])
