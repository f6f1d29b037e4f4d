"""Adaptive sampling reaches the error that it states, with fewer states than a grid, and always ends."""

from __future__ import annotations

import numpy as np
import pytest
from tests.pipeline.analytic import Analytic, Counting, Potential, bellow, line
from tests.pipeline.analytic import sampled as run

from pliant.errors import NotReachedError
from pliant.pipeline.sampling.adaptive import Box, interpolated, law_view
from pliant.pipeline.sampling.plan import Sampling

LIMIT = 1.0


def fitted(sampling: Sampling):
    return [s for s in sampling.solved if s.target.role == "fit" and s.state.status == "ok"]


def actual_error(potential: Potential, sampling: Sampling) -> float:
    """Return the largest error of the process on a dense grid over the box, as a share of the effort's range there."""
    states = fitted(sampling)
    angles = [s.state.angle_rad for s in states]
    box = Box("y", "main", (0.0, LIMIT), (min(angles), max(angles)))
    p, u = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 41), np.linspace(min(angles), max(angles), 41)))
    true = np.array([potential.law(a, np.array([b]))[0][0] for a, b in zip(p, u, strict=True)])
    tau, _ = interpolated(law_view(states, "y", ("y",)), box)(p, u)
    return float(np.abs(tau - true).max() / np.ptp(true))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("error", [1e-3, 1e-4])
def test_the_stated_error_is_met_and_honest(tmp_path, seed, error):
    sampling = run(Analytic(bellow(seed)), tmp_path, error=error)
    verdict = sampling.summary["axes"]["y"]
    assert verdict["reached"]
    assert verdict["stated_error"] <= error
    assert actual_error(bellow(seed), sampling) <= 2 * error
    assert verdict["check_error"] <= 2 * error


def test_half_the_grid_states_know_the_law_better(tmp_path):
    adaptive = run(Analytic(bellow(1)), tmp_path / "a", error=1e-4)
    grid = run(Analytic(bellow(1)), tmp_path / "g", sampling="grid", pressures=4, angles=5)
    assert len(fitted(adaptive)) < len(fitted(grid))
    assert actual_error(bellow(1), adaptive) < 1e-4


def test_each_new_state_is_recorded_as_a_prediction_test(tmp_path):
    sampling = run(Analytic(bellow(0)), tmp_path)
    verdict = sampling.summary["axes"]["y"]
    efforts = [s.state.moment_n_m for s in fitted(sampling)]
    assert len(verdict["tests"]) >= 2
    for test in verdict["tests"]:
        (state,) = [
            s.state
            for s in sampling.solved
            if (s.state.actuation, s.state.angle_rad) == (test["actuation"], test["deformation"])
        ]
        assert test["found"] == state.moment_n_m
        assert abs(test["found"] - test["foretold"]) == pytest.approx(
            test["miss"] * np.ptp(efforts), rel=0.2, abs=1e-12
        )
    assert max(test["miss"] for test in verdict["tests"][-2:]) <= 1e-3


def test_the_box_has_its_corners(tmp_path):
    sampling = run(Analytic(bellow(0)), tmp_path)
    largest = max(s.state.angle_rad for s in sampling.solved if s.target.branch == "free")
    places = {(s.state.actuation, round(s.state.angle_rad / largest, 9)) for s in fitted(sampling)}
    assert {(0.0, -0.5), (LIMIT, -0.5), (0.0, 1.2), (LIMIT, 1.2), (0.0, 0.0)} <= places


@pytest.mark.parametrize("after", [0, 5, 12])
def test_an_interrupted_sampling_solves_nothing_twice(tmp_path, after):
    whole = run(Analytic(bellow(2)), tmp_path / "whole")
    first = Analytic(bellow(2), stop_after=after)
    with pytest.raises(KeyboardInterrupt):
        run(first, tmp_path / "part")
    second, bar = Analytic(bellow(2)), Counting()
    resumed = run(second, tmp_path / "part", bar)
    assert not set(first.solved) & set(second.solved)
    assert bar.count == bar.total == len(whole.solved)
    assert [s.target for s in resumed.solved] == [s.target for s in whole.solved]
    assert resumed.summary == whole.summary


@pytest.mark.parametrize(
    "refuse",
    [
        lambda p, u: p > 0.5 and u[0] < -0.05,
        lambda p, u: u[0] > 0.35,
        lambda p, u: u[0] < -1e-3,
        lambda p, u: p < 0.3 and u[0] > 0.2,
    ],
)
def test_states_that_fail_are_avoided_and_recorded(tmp_path, refuse):
    def beside_the_free_branch(p, u):
        return bool(refuse(p, u)) and abs(bellow(0).law(p, u)[0][0]) > 1e-6

    solver = Analytic(bellow(0), refuse=beside_the_free_branch)
    sampling = run(solver, tmp_path, max_states=40)
    failed = [(f["actuation"], f["angle_rad"]) for f in sampling.failed]
    assert 1 <= len(failed) <= 20
    assert len(set(failed)) == len(failed)
    assert {f["cause"] for f in sampling.failed} == {"Newton stopped"}
    assert sampling.summary["axes"]["y"]["reached"]


def test_the_box_ends_near_where_convolutions_touch(tmp_path):
    border = -0.1
    solver = Analytic(bellow(0), touches=lambda p, u: u[0] < border)
    sampling = run(solver, tmp_path)
    angles = [s.state.angle_rad for s in sampling.solved if s.target.role == "fit" and s.state.status == "ok"]
    full = 0.5 * max(s.state.angle_rad for s in sampling.solved if s.target.branch == "free")
    assert border <= min(angles) <= border + full / 8
    beyond = [s for s in sampling.solved if s.state.angle_rad < min(angles)]
    assert 1 <= len(beyond) <= 3
    assert sampling.summary["axes"]["y"]["reached"]


def test_what_cannot_be_reached_in_max_states_is_said(tmp_path):
    sampling = run(Analytic(bellow(3)), tmp_path, error=1e-7, max_states=13, check_states=0)
    verdict = sampling.summary["axes"]["y"]
    assert not verdict["reached"]
    assert verdict["stated_error"] > 1e-7
    assert len(fitted(sampling)) == 13


def test_free_steps_grow_on_a_straight_curve(tmp_path):
    sampling = run(Analytic(line(1.0, 0.4)), tmp_path)
    free = [s.state.actuation for s in sampling.solved if s.target.branch == "free"]
    assert free[-1] == LIMIT
    assert np.all(np.diff(np.diff(free)) >= -1e-12)
    assert len(free) <= 6


def test_free_steps_shrink_where_the_solver_needs_it_and_leave_no_failure(tmp_path):
    solver = Analytic(bellow(0))
    free = solver.free

    def cautious(actuation, start):
        solver.refuse = lambda p, u: actuation - start.actuation > 0.07
        try:
            return free(actuation, start)
        finally:
            solver.refuse = lambda p, u: False

    solver.free = cautious
    sampling = run(solver, tmp_path)
    assert sampling.failed == ()
    reached = [s.state.actuation for s in sampling.solved if s.target.branch == "free"]
    assert reached[-1] == LIMIT
    assert max(np.diff(reached)) <= 0.07


def test_a_free_branch_that_stops_is_an_error(tmp_path):
    solver = Analytic(bellow(0), refuse=lambda p, u: p > 0.6)
    with pytest.raises(NotReachedError, match="free branch stopped: Newton stopped"):
        run(solver, tmp_path)
    assert 0.58 <= max(p for p, _ in solver.solved) <= 0.6
