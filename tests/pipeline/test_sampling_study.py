"""The published study's grids: dead loads in steps, equilibria under them exact, numbers of the preset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from tests.pipeline.analytic import Analytic, bellow, helix

from pliant.errors import UserError
from pliant.execution.progress import Silent
from pliant.interfaces.fem import FemConfig, StateNotConvergedError
from pliant.interfaces.study_loads import STUDY_LOADS, StudyLoads
from pliant.pipeline.sampling.plan import sample
from pliant.pipeline.sampling.strategies import loads_of, steps
from pliant.pipeline.sampling.walk import Piece

LOADS = {"y": StudyLoads(actuation_step=0.25, effort_high=0.4, effort_step=0.1)}


@dataclass
class Problem:
    axes: tuple[str, ...] = ("y",)
    joint: str = "revolute"
    actuation: str = "pressure_pa"


def config(**changes: object) -> FemConfig:
    return FemConfig.model_validate({"kind": "any", "pressure_max_pa": 1.0, "sampling": "study", **changes})


def run(solver, folder, loads=LOADS, **changes: object):
    return sample([Piece("main", solver, ("y",), "y")], config(**changes), 1.0, folder, Silent(), loads)


@pytest.mark.parametrize("effort", [-0.2, 0.0, 0.3])
@pytest.mark.parametrize("actuation", [0.0, 0.7])
def test_a_loaded_state_carries_its_load(actuation, effort):
    solver = Analytic(bellow(0))
    state = solver.loaded(actuation, effort, solver.rest())
    assert state.moment_n_m == pytest.approx(effort, abs=1e-9)
    assert state.actuation == actuation


def test_a_load_on_one_axis_leaves_the_others_free():
    solver = Analytic(helix(), ("x", "y", "z"))
    state = solver.loaded(0.8, {"z": 0.1}, solver.free(0.8, solver.rest()), ("x", "y", "z"))
    np.testing.assert_allclose(state.tau, [0.0, 0.0, 0.1], atol=1e-9)
    with pytest.raises(UserError, match="one axis is loaded at a time, not x, z"):
        solver.loaded(0.8, {"x": 0.1, "z": 0.1}, solver.rest(), ("x", "y", "z"))


def test_a_load_that_has_no_equilibrium_is_not_reached():
    solver = Analytic(bellow(0), refuse=lambda p, u: u[0] < -0.3)
    with pytest.raises(StateNotConvergedError):
        solver.loaded(0.0, 5.0, solver.rest())


def test_every_level_gets_its_ladder_until_the_box_ends(tmp_path):
    sampling = run(Analytic(bellow(0)), tmp_path, check_states=3)
    free = [s.state for s in sampling.solved if s.target.branch == "free"]
    assert [s.actuation for s in free] == [0.0, 0.25, 0.5, 0.75, 1.0]
    low = -0.5 * max(s.angle_rad for s in free)
    for p in (0.0, 0.25, 0.5, 0.75, 1.0):
        ladder = [s.state for s in sampling.solved if s.target.effort and s.state.actuation == p]
        moments = [s.moment_n_m for s in ladder]
        np.testing.assert_allclose(moments, 0.1 * np.arange(1, len(moments) + 1), atol=1e-8)
        assert all(s.angle_rad >= low for s in ladder[:-1])
        assert ladder[-1].angle_rad < low or len(ladder) == 4
    assert sum(s.target.role == "check" for s in sampling.solved) == 3


def test_a_ladder_ends_where_a_load_fails(tmp_path):
    sampling = run(Analytic(bellow(0), refuse=lambda p, u: u[0] < -0.02), tmp_path, check_states=0)
    failed = [(f["actuation"], f["effort"]["y"]) for f in sampling.failed]
    assert failed
    assert len({p for p, _ in failed}) == len(failed)


def test_other_axes_have_their_own_ladders(tmp_path):
    axes = ("x", "y", "z")
    other = StudyLoads(
        actuation_low=0.5, actuation_step=0.5, effort_low=-0.1, effort_high=0.1, effort_step=0.05
    )
    full = Analytic(helix(), axes)
    main = Analytic(bellow(0))
    pieces = [Piece("main", main, ("y",), "y"), Piece("full", full, axes, "y")]
    loads = {**LOADS, "x": other, "z": other}
    sampling = sample(pieces, config(coupling_states=0), 1.0, tmp_path, Silent(), loads)
    for axis in ("x", "z"):
        k = axes.index(axis)
        states = [s.state for s in sampling.solved if s.target.explored == axis]
        assert {s.actuation for s in states} == {0.5, 1.0}
        assert {round(float(s.tau[k]), 9) for s in states} == {-0.1, -0.05, 0.05, 0.1}


def test_steps_are_numbers_as_people_write_them():
    assert steps(0.0, 0.02, 0.0006)[-1] == 0.0198
    assert steps(-0.006, 0.006, 0.0002)[[0, 30, -1]].tolist() == [-0.006, 0.0, 0.006]
    assert len(steps(0.0, 15e3, 500.0)) == 31


def test_the_preset_has_the_numbers_of_the_published_table():
    gripper = STUDY_LOADS["pressure_pa", 1, "revolute"]["y"]
    assert (gripper.actuation_step, gripper.effort_high, gripper.effort_step) == (500.0, 0.02, 0.0006)
    helical = STUDY_LOADS["pressure_pa", 3, "spherical"]
    assert (helical["y"].actuation_step, helical["y"].effort_low) == (500.0, -0.006)
    assert (helical["x"].actuation_low, helical["z"].actuation_step) == (5e3, 2.5e3)
    tendon = STUDY_LOADS["tendon_force_n", 1, "revolute"]["y"]
    assert (tendon.actuation_step, tendon.effort_high, tendon.effort_step) == (0.5, 0.05, 0.0025)


def test_loads_come_from_the_config_or_the_preset_or_are_asked_for():
    own = config(study_loads={"y": {"actuation_step": "1 kPa", "effort_high": "5 mN*m", "effort_step": 1e-3}})
    assert loads_of(own, Problem())["y"].actuation_step == 1e3
    assert loads_of(own, Problem())["y"].effort_high == pytest.approx(5e-3)
    assert loads_of(config(), Problem())["y"].effort_high == 0.02
    with pytest.raises(UserError, match="no loads for axis x of a prismatic joint"):
        loads_of(config(), Problem(("x",), "prismatic"))
    with pytest.raises(UserError, match="the module has no axis 'y', only x"):
        loads_of(own, Problem(("x",), "prismatic"))
