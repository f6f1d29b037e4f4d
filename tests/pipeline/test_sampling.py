"""Sampling: which states, resumed without solving anything twice, failures recorded."""

import json

import numpy as np
import pytest

from pliant.errors import NotReachedError
from pliant.execution.progress import Silent
from pliant.interfaces.fem import FemConfig, ModuleSolver, StateNotConvergedError
from pliant.pipeline.sampling.plan import sample as sample_pieces
from pliant.pipeline.sampling.walk import Piece, levels
from pliant.records.fem import FemState

CONFIG = FemConfig(kind="any", sampling="grid", pressure_max_pa=10.0, pressures=4, angles=5, check_states=6)


def sample(solver, config, limit, folder, progress):
    return sample_pieces([Piece("main", solver, ("y",), "y")], config, limit, folder, progress)


class Springs(ModuleSolver):
    """τ = p − 20 u: the free angle at 10 Pa is 0.5 rad."""

    def __init__(self, stop_after=10**9, refuse=lambda p, u: False):
        self.solved = []
        self.stop_after, self.refuse = stop_after, refuse

    def _state(self, p, u, branch):
        if len(self.solved) >= self.stop_after:
            raise KeyboardInterrupt
        if self.refuse(p, u):
            raise StateNotConvergedError("Newton stopped")
        self.solved.append((p, u))
        return FemState.of_one_axis(
            p,
            u,
            p - 20 * u,
            1.0,
            -20.0,
            energy_j=0.0,
            travel=0.0,
            axial_strain=0.0,
            branch=branch,
            status="ok",
            iterations=1,
            wall_s=0.0,
            solution=np.array([p, u]),
        )

    def rest(self):
        return self._state(0.0, 0.0, "free")

    def free(self, actuation, start):
        assert start.actuation <= actuation
        return self._state(actuation, actuation / 20, "free")

    def constrained(self, actuation, angle_rad, start):
        return self._state(actuation, angle_rad, "constrained")

    def deformed_nodes(self, state):
        return np.zeros((1, 3))


class Counting(Silent):
    def __init__(self):
        self.notes = []

    def note(self, text):
        self.notes.append(text)

    def begin(self, title, total, done=0):
        self.total, self.count = total, done
        return self

    def advance(self, steps=1):
        self.count += steps

    def expect(self, total):
        self.total = total


def test_levels_without_a_strategy_mean_the_grid():
    assert FemConfig(kind="any", pressures=4).sampling == "grid"
    assert FemConfig(kind="any").sampling == "adaptive"
    explicit = FemConfig(kind="any", pressures=4, sampling="adaptive")
    assert explicit.sampling == "adaptive"
    assert FemConfig.model_validate(explicit.canonical()) == explicit


def test_levels_include_both_ends():
    points = levels(-1.0, 3.0, 7)
    assert points[0] == pytest.approx(-1.0)
    assert points[-1] == pytest.approx(3.0)
    assert np.all(np.diff(points) > 0)


def test_the_data_cover_the_promised_box(tmp_path):
    solver = Springs()
    sampling = sample(solver, CONFIG, 10.0, tmp_path, Silent())
    fit = [s.state for s in sampling.solved if s.target.role == "fit"]
    pressures, angles = {s.actuation for s in fit}, np.array([s.angle_rad for s in fit])
    assert min(pressures) == 0.0
    assert max(pressures) == pytest.approx(10.0)
    for pressure in pressures:
        here = [s.angle_rad for s in fit if s.actuation == pressure]
        assert min(here) == pytest.approx(-0.5 * 0.5)
        assert max(here) == pytest.approx(1.2 * 0.5)
    assert angles.max() == pytest.approx(0.6)


def test_check_states_lie_inside_and_are_not_fitted(tmp_path):
    sampling = sample(Springs(), CONFIG, 10.0, tmp_path, Silent())
    check = [s.state for s in sampling.solved if s.target.role == "check"]
    fitted = {(s.state.actuation, s.state.angle_rad) for s in sampling.solved if s.target.role == "fit"}
    assert len(check) == 6
    for state in check:
        assert 0 <= state.actuation <= 10
        assert -0.25 <= state.angle_rad <= 0.6
        assert (state.actuation, state.angle_rad) not in fitted


@pytest.mark.parametrize("interrupted_at", [0, 1, 3, 4, 17, 29])
def test_an_interrupted_sampling_solves_nothing_twice(tmp_path, interrupted_at):
    whole = (
        sample(Springs(), CONFIG, 10.0, tmp_path / "whole", Silent())
        if (tmp_path / "whole").mkdir() is None
        else None
    )
    part = tmp_path / "part"
    part.mkdir()
    first = Springs(stop_after=interrupted_at)
    with pytest.raises(KeyboardInterrupt):
        sample(first, CONFIG, 10.0, part, Silent())
    second, bar = Springs(), Counting()
    resumed = sample(second, CONFIG, 10.0, part, bar)
    assert not set(first.solved) & set(second.solved)
    assert bar.count == bar.total
    assert len(resumed.solved) == len(whole.solved)
    for a, b in zip(resumed.solved, whole.solved, strict=True):
        assert (a.state.actuation, a.state.angle_rad) == (b.state.actuation, b.state.angle_rad)


def test_a_state_that_fails_is_a_record_with_its_cause(tmp_path):
    solver = Springs(refuse=lambda p, u: u > 0.55)
    sampling = sample(solver, CONFIG, 10.0, tmp_path, Silent())
    assert len(sampling.failed) >= 4
    assert {f["cause"] for f in sampling.failed} == {"Newton stopped"}
    assert all(f["angle_rad"] > 0.55 for f in sampling.failed)


def test_a_free_branch_that_stops_is_an_error(tmp_path):
    with pytest.raises(
        NotReachedError, match=r"free branch stopped: Newton stopped\. Lower the largest pressure"
    ):
        sample(Springs(refuse=lambda p, u: p > 5), CONFIG, 10.0, tmp_path, Silent())


def interrupted(folder, after=12, **solver):
    first = Springs(stop_after=after, **solver)
    with pytest.raises(KeyboardInterrupt):
        sample(first, CONFIG, 10.0, folder, Silent())
    return first


@pytest.mark.parametrize("file", ["value.json", "arrays.npz"])
@pytest.mark.parametrize("damage", ["truncate", "flip", "delete", "empty"])
def test_a_damaged_finished_state_is_said_and_solved_anew_alone(tmp_path, file, damage):
    first = interrupted(tmp_path)
    path = sorted(tmp_path.glob(f"*/{file}"))[3]
    data = path.read_bytes()
    if damage == "delete":
        path.unlink()
    else:
        middle = len(data) // 2
        broken = {"truncate": data[:middle], "empty": b""}
        path.write_bytes(broken.get(damage, data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]))
    second, bar = Springs(), Counting()
    sample(second, CONFIG, 10.0, tmp_path, bar)
    assert len(set(first.solved) & set(second.solved)) == 1
    assert len(bar.notes) == 1
    assert "damaged" in bar.notes[0]
    assert "solving it anew" in bar.notes[0]
    assert bar.count == bar.total


@pytest.mark.parametrize(
    "text", ["", '{"free 0.', "[]", "7", "\x00\x00", '{"rest": 7}', '{"rest": null}', '{"rest": {}}']
)
def test_a_damaged_list_of_finished_states_is_said_and_solved_anew(tmp_path, text):
    interrupted(tmp_path)
    (tmp_path / "states.json").write_text(text)
    bar = Counting()
    sampling = sample(Springs(), CONFIG, 10.0, tmp_path, bar)
    assert len(sampling.solved) == 4 + 4 * 5 + 6
    assert len(bar.notes) == 1
    assert "damaged" in bar.notes[0]
    assert bar.count == bar.total


def test_a_failed_state_is_not_tried_again_after_an_interruption(tmp_path):
    tried = []

    def refuse(p, u):
        if u > 0.55:
            tried.append((p, u))
        return u > 0.55

    interrupted(tmp_path, after=22, refuse=refuse)
    before = list(tried)
    assert before
    bar = Counting()
    sampling = sample(Springs(refuse=refuse), CONFIG, 10.0, tmp_path, bar)
    assert len(tried) == len(set(tried)) == len(sampling.failed)
    assert {f["cause"] for f in sampling.failed} == {"Newton stopped"}
    assert bar.count == bar.total


def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path, monkeypatch):
    from pliant.errors import UserError
    from pliant.pipeline.sampling import walk as saved

    def full(folder, value):
        raise OSError(28, "No space left on device")

    interrupted(tmp_path)
    kept = json.loads((tmp_path / "states.json").read_text())
    with monkeypatch.context() as patch:
        patch.setattr(saved, "write_value", full)
        with pytest.raises(UserError, match="No space left on device"):
            sample(Springs(), CONFIG, 10.0, tmp_path, Silent())
    assert json.loads((tmp_path / "states.json").read_text()) == kept


def test_the_free_branch_ends_at_its_first_failure(tmp_path):
    tried = []

    def refuse(p, u):
        tried.append(p)
        return p > 2

    with pytest.raises(NotReachedError):
        sample(Springs(refuse=refuse), CONFIG, 10.0, tmp_path, Silent())
    assert sum(p > 2 for p in tried) == 1


def test_a_module_that_stays_straight_is_an_error(tmp_path):
    class Straight(Springs):
        def free(self, actuation, start):
            return self._state(actuation, 0.0, "free")

    with pytest.raises(NotReachedError, match="does not bend"):
        sample(Straight(), CONFIG, 10.0, tmp_path, Silent())
