"""Reach and Track: measurements, robots drawn from evidence, and controllers that compensate for the model's errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

from benchmarks.control import STUDY  # noqa: E402

import pliant_plugins.envs  # noqa: E402, F401 - registers them
from pliant.errors import UserError  # noqa: E402
from pliant_plugins.envs.baselines import (  # noqa: E402
    Nominal,
    OpenLoop,
    Predictive,
    ProportionalIntegral,
    score,
)
from pliant_plugins.envs.control import MeasuredEnv  # noqa: E402


def made(folder: Path, name: str = "Reach", **settings: Any) -> MeasuredEnv:
    (folder / "study.yaml").write_text(STUDY)
    env = gymnasium.make(f"pliant/{name}-v0", study=folder / "study.yaml", **settings)
    found: MeasuredEnv = env.unwrapped
    return found


def tips(env: MeasuredEnv, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the true and measured positions of the tip in an episode of full actuation."""
    _, info = env.reset(seed=3, options=options)
    infos = [info]
    while len(infos) <= env.steps:
        infos.append(env.step(np.ones(len(env.inputs), np.float32))[4])
    return np.array([one["tip_m"] for one in infos]), np.array([one["measured_tip_m"] for one in infos])


def test_the_tip_is_seen_late_and_with_noise(tmp_path: Path) -> None:
    true, seen = tips(made(tmp_path, delay_s=0.1, noise_m=0.0, episode_s=0.5))
    np.testing.assert_array_equal(seen[2:], true[:-2])
    true, seen = tips(made(tmp_path, noise_m=1e-3, episode_s=4.0))
    assert (seen - true).std() == pytest.approx(1e-3, rel=0.15)
    # of the study's posterior: 0.01 rad of a bend that is uniform along 88 mm
    assert made(tmp_path).noise_m == pytest.approx(0.01 * 0.088 / 2)


def test_a_seed_decides_the_robot_and_robots_differ(tmp_path: Path) -> None:
    settings = {"worlds": 3, "noise_m": 0.0, "episode_s": 0.5}
    one, other = made(tmp_path, **settings), made(tmp_path, **settings)
    np.testing.assert_array_equal(tips(one)[0], tips(other)[0])
    ends = [tips(one, world=k)[0][-1] for k in (-1, 0, 1, 2)]
    apart = [np.linalg.norm(a - b) for k, a in enumerate(ends) for b in ends[:k]]
    assert min(apart) > 1e-4
    with pytest.raises(UserError, match="option 'world' is 3"):
        one.reset(options={"world": 3})


def test_the_nominal_model_inverts_itself(tmp_path: Path) -> None:
    model = Nominal(made(tmp_path))
    for share in (0.15, 0.5, 0.93):
        found = model.shares(model.tip_m(np.array([share])))
        assert found == pytest.approx([share], abs=1e-6)
        step = 1e-3
        rise = model.tip_m(np.array([share + step])) - model.tip_m(np.array([share - step]))
        np.testing.assert_allclose(model.tip_slopes(np.array([share]))[:, 0], rise / (2 * step), atol=2e-3)


def test_feedback_leaves_no_offset_where_the_model_is_wrong(tmp_path: Path) -> None:
    """At the end of a long reach in a robot that is not the nominal one."""
    env = made(tmp_path, worlds=4, noise_m=0.0, episode_s=6.0)

    def left(controller: Any) -> float:
        _, info = env.reset(seed=1, options={"world": 2})
        controller.begin(info)
        for _ in range(env.steps):
            info = env.step(controller.act(info).astype(np.float32))[4]
        return float(info["error_m"])

    open_loop = left(OpenLoop(env))
    assert open_loop > 5e-4
    assert left(ProportionalIntegral(env)) < 0.2 * open_loop
    assert left(Predictive(env)) < 0.2 * open_loop


def test_a_path_is_followed_better_by_the_model_than_by_nothing(tmp_path: Path) -> None:
    env = made(tmp_path, "Track", episode_s=2.0)

    class Still:
        def begin(self, info: Any) -> None: ...

        def act(self, info: Any) -> np.ndarray:
            return np.zeros(1)

    still, driven = (score(env, one, range(2)) for one in (Still(), OpenLoop(env)))
    assert (driven < 0.5 * still).all()
    seen, info = env.reset(seed=0, options={"path_m": np.tile(info_tip(env), (3, 1))})
    np.testing.assert_array_equal(info["ahead_m"], np.tile(info_tip(env), (3, 1)))
    assert env.observation_space.contains(seen)


def info_tip(env: MeasuredEnv) -> np.ndarray:
    return np.asarray(env.chain.base_position_m) + [0.02, 0.0, -0.08]


def test_without_evidence_there_is_one_robot(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="the study states no uncertainty"):
        gymnasium.make("pliant/Track-v0", worlds=2)
    with pytest.raises(UserError, match="neither may be negative"):
        gymnasium.make("pliant/Reach-v0", delay_s=-1.0)


def test_several_robots_move_beside_each_other(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    settings = {"study": tmp_path / "study.yaml", "worlds": 2, "episode_s": 0.2}
    envs = gymnasium.make_vec("pliant/Track-v0", num_envs=3, **settings)
    seen, info = envs.reset(seed=[1, 1, 2])
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2]) and info["ahead_m"].shape == (3, 3, 3)
    envs.close()
