"""Sampling: choice of states, resumption without repeated solutions, recorded failures and damage, loads."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pipeline.analytic import (
    Analytic,
    Counting,
    Potential,
    bellow,
    config,
    full_and_main,
    helix,
    line,
    power,
)
from tests.pipeline.analytic import sampled as sample

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.fem import FemConfig, StateNotConvergedError
from pliant.interfaces.study_loads import STUDY_LOADS, StudyLoads
from pliant.pipeline.sampling import walk
from pliant.pipeline.sampling.strategies import axis_loads, steps
from pliant.pipeline.sampling.walk import levels

# τ = p − 20 u up to 10 Pa: the free angle there is 0.5 rad.
GRID = {"sampling": "grid", "pressure_max_pa": 10.0, "pressures": 4, "angles": 5, "check_states": 6}
N_GRID = 4 + 4 * 5 + 6


def springs(**solver) -> Analytic:
    return Analytic(line(20.0), **solver)


def beyond(u_max: float):
    return lambda p, u: u[0] > u_max


def test_levels_without_a_strategy_mean_the_grid():
    assert FemConfig(kind="any", pressures=4).sampling == "grid"
    assert FemConfig(kind="any").sampling == "adaptive"
    explicit = FemConfig(kind="any", pressures=4, sampling="adaptive")
    assert explicit.sampling == "adaptive"
    assert FemConfig.model_validate(explicit.canonical()) == explicit
    points = levels(-1.0, 3.0, 7)
    assert points[[0, -1]] == pytest.approx([-1.0, 3.0]) and np.all(np.diff(points) > 0)


def test_the_data_cover_the_promised_box_and_check_states_lie_inside(tmp_path):
    sampling = sample(springs(), tmp_path, **GRID)
    fit = [s.state for s in sampling.solved if s.target.role == "fit"]
    for pressure in {s.actuation for s in fit}:
        here = [s.angle_rad for s in fit if s.actuation == pressure]
        assert (min(here), max(here)) == pytest.approx((-0.5 * 0.5, 1.2 * 0.5))
    assert {0.0, 10.0} <= {s.actuation for s in fit}
    check = [s.state for s in sampling.solved if s.target.role == "check"]
    assert len(check) == 6
    for state in check:
        assert 0 <= state.actuation <= 10 and -0.25 <= state.angle_rad <= 0.6
        assert (state.actuation, state.angle_rad) not in {(s.actuation, s.angle_rad) for s in fit}


@pytest.mark.parametrize("interrupted_at", [0, 4, 17])
def test_an_interrupted_sampling_solves_nothing_twice(tmp_path, interrupted_at):
    whole = sample(springs(), tmp_path / "whole", **GRID)
    first, second, bar = springs(stop_after=interrupted_at), springs(), Counting()
    with pytest.raises(KeyboardInterrupt):
        sample(first, tmp_path / "part", **GRID)
    resumed = sample(second, tmp_path / "part", bar, **GRID)
    assert not set(first.solved) & set(second.solved)
    assert bar.count == bar.total
    assert [s.target for s in resumed.solved] == [s.target for s in whole.solved]
    assert [s.state.angle_rad for s in resumed.solved] == [s.state.angle_rad for s in whole.solved]


def interrupted(folder, after=12, **solver):
    first = springs(stop_after=after, **solver)
    with pytest.raises(KeyboardInterrupt):
        sample(first, folder, **GRID)
    return first


@pytest.mark.parametrize("file", ["value.json", "arrays.npz"])
@pytest.mark.parametrize("damage", ["truncate", "flip", "delete", "empty"])
def test_a_damaged_finished_state_is_said_and_solved_anew_alone(tmp_path, file, damage):
    first = interrupted(tmp_path)
    path = sorted(tmp_path.glob(f"*/{file}"))[3]
    data = path.read_bytes()
    middle = len(data) // 2
    flipped = data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]
    path.write_bytes({"truncate": data[:middle], "empty": b"", "flip": flipped, "delete": b""}[damage])
    if damage == "delete":
        path.unlink()
    second, bar = springs(), Counting()
    sample(second, tmp_path, bar, **GRID)
    assert len(set(first.solved) & set(second.solved)) == 1
    assert len(bar.notes) == 1 and "solving it anew" in bar.notes[0]
    assert bar.count == bar.total


DAMAGED = ["", '{"free 0.', "[]", "7", "\x00\x00", '{"rest": 7}', '{"rest": null}', '{"rest": {}}']


@pytest.mark.parametrize("text", DAMAGED)
def test_a_damaged_list_with_finished_states_is_reported_and_solved_again(tmp_path, text):
    interrupted(tmp_path)
    (tmp_path / "states.json").write_text(text)
    bar = Counting()
    assert len(sample(springs(), tmp_path, bar, **GRID).solved) == N_GRID
    assert len(bar.notes) == 1 and "damaged" in bar.notes[0]
    assert bar.count == bar.total


def test_a_failed_state_is_a_record_and_not_tried_again_after_an_interruption(tmp_path):
    first, second, bar = (
        interrupted(tmp_path, 22, refuse=beyond(0.55)),
        springs(refuse=beyond(0.55)),
        Counting(),
    )
    sampling = sample(second, tmp_path, bar, **GRID)
    tried = first.refused + second.refused
    assert first.refused and len(tried) == len(set(tried)) == len(sampling.failed) >= 4
    assert {f["cause"] for f in sampling.failed} == {"Newton stopped"}
    assert all(f["angle_rad"] > 0.55 for f in sampling.failed)
    assert bar.count == bar.total


def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path, monkeypatch):
    def full(folder, value):
        raise OSError(28, "No space left on device")

    interrupted(tmp_path)
    kept = json.loads((tmp_path / "states.json").read_text())
    monkeypatch.setattr(walk, "write_value", full)
    with pytest.raises(UserError, match="No space left on device"):
        sample(springs(), tmp_path, **GRID)
    assert json.loads((tmp_path / "states.json").read_text()) == kept


def test_the_free_branch_ends_at_its_first_failure(tmp_path):
    solver = springs(refuse=lambda p, u: p > 2)
    with pytest.raises(NotReachedError, match="free branch stopped: Newton stopped"):
        sample(solver, tmp_path, **GRID)
    assert len(solver.refused) == 1


def test_a_module_that_stays_straight_is_an_error(tmp_path):
    with pytest.raises(NotReachedError, match="does not bend"):
        sample(Analytic(line(20.0, gain=0.0)), tmp_path, **GRID)


TOUCHING_RAD = 0.3


@pytest.mark.parametrize(
    ("self_contact", "limits", "statuses"),
    [
        ("stop", (-np.inf, np.inf), {"ok", "self_contact"}),
        ("pass", (-np.inf, np.inf), {"ok", "passed_through"}),
        ("pass", (-0.2, 0.4), {"ok", "passed_through", "self_contact"}),
    ],
)
def test_data_end_where_convolutions_touch_or_let_them_pass_but_never_rigid_parts(
    tmp_path, self_contact, limits, statuses
):
    """τ = p − 20 u − 5 u³: the free branch goes to 0.48 rad, beyond the limit of rigid parts; the box ends at it."""
    cubic = Potential(*line(20.0).terms, (5 / 4, (power(0), power(4))))
    solver = Analytic(cubic, touches=beyond(TOUCHING_RAD))
    solved = sample(solver, tmp_path, limits=limits, pressure_max_pa=10.0, self_contact=self_contact).solved
    kept = [s.state.angle_rad for s in solved if s.state.trusted and s.state.branch == "constrained"]
    assert {one.state.status for one in solved} == statuses
    if self_contact == "stop":
        assert max(kept) <= TOUCHING_RAD
    elif np.isinf(limits[0]):
        assert max(kept) > 0.5
    else:
        assert (min(kept), max(kept)) == limits


LOADS = {"y": StudyLoads(actuation_step=0.25, effort_high=0.4, effort_step=0.1)}


@pytest.mark.parametrize("effort", [-0.2, 0.0, 0.3])
@pytest.mark.parametrize("actuation", [0.0, 0.7])
def test_a_loaded_state_carries_its_load(actuation, effort):
    solver = Analytic(bellow(0))
    state = solver.loaded(actuation, effort, solver.rest())
    assert (state.moment_n_m, state.actuation) == (pytest.approx(effort, abs=1e-9), actuation)


def test_a_load_on_one_axis_leaves_the_others_free_and_may_not_be_reached():
    solver = Analytic(helix(), ("x", "y", "z"))
    state = solver.loaded(0.8, {"z": 0.1}, solver.free(0.8, solver.rest()), ("x", "y", "z"))
    np.testing.assert_allclose(state.tau, [0.0, 0.0, 0.1], atol=1e-9)
    with pytest.raises(UserError, match="one axis is loaded at a time, not x, z"):
        solver.loaded(0.8, {"x": 0.1, "z": 0.1}, solver.rest(), ("x", "y", "z"))
    solver = Analytic(bellow(0), refuse=lambda p, u: u[0] < -0.3)
    with pytest.raises(StateNotConvergedError):
        solver.loaded(0.0, 5.0, solver.rest())


def test_every_level_gets_its_ladder_until_the_box_ends_or_a_load_fails(tmp_path):
    sampling = sample(Analytic(bellow(0)), tmp_path / "all", None, LOADS, sampling="study", check_states=3)
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
    failing = Analytic(bellow(0), refuse=lambda p, u: u[0] < -0.02)
    failed = sample(failing, tmp_path / "some", None, LOADS, sampling="study", check_states=0).failed
    at = [f["actuation"] for f in failed if f["effort"]]
    assert at and len(set(at)) == len(at)


def test_other_axes_have_their_own_ladders(tmp_path):
    other = StudyLoads(
        actuation_low=0.5, actuation_step=0.5, effort_low=-0.1, effort_high=0.1, effort_step=0.05
    )
    loads = {**LOADS, "x": other, "z": other}
    sampling, _, _ = full_and_main(helix(), tmp_path, loads=loads, sampling="study", coupling_states=0)
    for k, axis in ((0, "x"), (2, "z")):
        states = [s.state for s in sampling.solved if s.target.explored == axis]
        assert {s.actuation for s in states} == {0.5, 1.0}
        assert {round(float(s.tau[k]), 9) for s in states} == {-0.1, -0.05, 0.05, 0.1}


def test_loads_have_the_published_table_numbers_and_those_in_the_config_go_first():
    gripper = STUDY_LOADS["pressure_pa", 1, "revolute"]["y"]
    assert (gripper.actuation_step, gripper.effort_high, gripper.effort_step) == (500.0, 0.02, 0.0006)
    helical = STUDY_LOADS["pressure_pa", 3, "spherical"]
    assert (helical["y"].actuation_step, helical["y"].effort_low) == (500.0, -0.006)
    assert (helical["x"].actuation_low, helical["z"].actuation_step) == (5e3, 2.5e3)
    tendon = STUDY_LOADS["tendon_force_n", 1, "revolute"]["y"]
    assert (tendon.actuation_step, tendon.effort_high, tendon.effort_step) == (0.5, 0.05, 0.0025)
    assert steps(0.0, 0.02, 0.0006)[-1] == 0.0198
    assert steps(-0.006, 0.006, 0.0002)[[0, 30, -1]].tolist() == [-0.006, 0.0, 0.006]
    problem = SimpleNamespace(axes=("y",), joint="revolute", actuation="pressure_pa")
    slider = SimpleNamespace(axes=("x",), joint="prismatic", actuation="pressure_pa")
    stated = {"y": {"actuation_step": "1 kPa", "effort_high": "5 mN*m", "effort_step": 1e-3}}
    own = axis_loads(config(study_loads=stated), problem)["y"]
    assert (own.actuation_step, own.effort_high) == (1e3, pytest.approx(5e-3))
    assert axis_loads(config(), problem)["y"].effort_high == 0.02
    with pytest.raises(UserError, match="no loads for axis x of a prismatic joint"):
        axis_loads(config(), slider)
    with pytest.raises(UserError, match="the module has no axis 'y', only x"):
        axis_loads(config(study_loads=stated), slider)
