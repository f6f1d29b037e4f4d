"""A study's search as episodes of one step: of a stand-in with known scores, then of a study."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import pliant_plugins.envs  # noqa: E402, F401 - registers them
from pliant.errors import UserError  # noqa: E402
from pliant_search.optimizer import Context, Space, Trial, Variable  # noqa: E402

NAME = "pliant_plugins.envs:pliant/Design-v0"  # processes without further imports find it by this name
VARIABLES = (Variable("a", "real", 0.0, 1.0), Variable("n", "integer", 2, 6))
BEST = (0.2, 0.8)


@dataclass
class StandInProblem:
    """Two conditions with different optima of `a`; the branch's `k` is an offset."""

    conditions: tuple[Context, ...] = (Context("egg", (0.0, 1.0)), Context("can", (1.0, 0.5)))
    until: str | None = "score <= 0.1"

    def branches(self):
        return ({"k": 1}, {"k": 2})

    def space(self, contextual=False):
        return Space(VARIABLES, contexts=self.conditions if contextual else ())

    def reached(self, values, metrics):
        return metrics["score"] <= 0.1


class StandInEvaluator:
    def evaluate(self, values, context=-1):
        trial = Trial(-1, values, context)
        if values["n"] > 5:
            return trial.refused({"n <= 5": values["n"] - 5.0})
        if values["a"] < 0.05:
            return trial.failed("it did not settle")
        score = abs(values["a"] - BEST[context]) + values["k"] - 1
        return replace(trial.scored(score, 7.0), metrics={"score": score})


def opened(study):
    if study != "gripper.yaml":
        raise UserError(f"'{study}' is no study.")
    return StandInProblem(), StandInEvaluator()


def opened_unnamed(study):
    return StandInProblem((Context(""),), None), StandInEvaluator()


def made(**settings):
    return gymnasium.make(NAME, **{"study": "gripper.yaml", "opened": opened, **settings})


def action(a, n):
    return np.array([2 * a - 1, (n - 4) / 2], np.float32)


def test_the_checkers_have_no_remark():
    from gymnasium.utils.env_checker import check_env

    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made().unwrapped, skip_render_check=True)
        checker.check_env(made().unwrapped)


@pytest.mark.parametrize(("condition", "seen", "best"), [("egg", [0.0, 1.0], 0.2), ("can", [1.0, 0.5], 0.8)])
def test_an_episode_is_one_design_in_one_condition(condition, seen, best):
    env = made()
    observed, info = env.reset(options={"condition": condition})
    assert observed.tolist() == seen
    assert info == {"condition": condition}
    observed, reward, ended, truncated, info = env.step(action(0.5, 3))
    assert observed.tolist() == seen
    assert (ended, truncated) == (True, False)
    assert reward == pytest.approx(-0.3)
    assert info["values"] == {"k": 1, "a": pytest.approx(0.5), "n": 3}
    assert (info["status"], info["is_success"]) == ("ok", False)
    assert info["metrics"]["score"] == pytest.approx(0.3)
    env.reset(options={"condition": condition})
    *_, info = env.step(action(best + 0.05, 3))
    assert info["is_success"]


def test_refused_and_failed_designs_get_the_failed_reward():
    env = made(failed_reward=-5.0)
    env.reset(seed=0)
    _, reward, ended, _, info = env.step(action(0.5, 6))
    assert (reward, ended, info["status"], info["cause"]) == (-5.0, True, "refused", "n <= 5")
    assert info["violation"] == 1.0
    env.reset(options={"condition": "egg"})
    _, reward, _, _, info = env.step(action(0.0, 3))
    assert (reward, info["status"], info["cause"]) == (-5.0, "failed", "it did not settle")
    assert not info["is_success"]


def test_a_seed_decides_the_conditions_and_both_come():
    def conditions(seed):
        env = made()
        return [env.reset(seed=seed if i == 0 else None)[1]["condition"] for i in range(20)]

    assert conditions(1) == conditions(1)
    assert conditions(1) != conditions(2)
    assert set(conditions(1)) == {"egg", "can"}


def test_a_branch_is_a_separate_search():
    env = made(branch=1)
    env.reset(options={"condition": "egg"})
    _, reward, _, _, info = env.step(action(0.2, 3))
    assert (info["values"]["k"], reward) == (2, pytest.approx(-1.0))


def test_without_conditions_a_constant_is_seen():
    env = made(opened=opened_unnamed)
    observed, info = env.reset()
    assert observed.tolist() == [1.0]
    assert info == {"condition": ""}
    *_, info = env.step(action(0.5, 3))
    assert "is_success" not in info


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"study": "griper.yaml"}, "'griper.yaml' is no study"),
        ({"branch": 2}, "branch is 2; this search has 2, counted from 0"),
        ({"failed_reward": float("nan")}, "failed_reward is nan"),
    ],
)
def test_wrong_arguments(settings, says):
    with pytest.raises(UserError, match=says):
        made(**settings)


def test_wrong_options():
    env = made()
    with pytest.raises(UserError, match="unknown option 'weight'; this environment takes condition"):
        env.reset(options={"weight": 3})
    with pytest.raises(UserError, match="unknown condition 'eg'; did you mean 'egg'"):
        env.reset(options={"condition": "eg"})


STUDY = """
pliant: 1
name: reach
surrogate:
  kind: polynomial
  form: study
  odd: true
  axis: y
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 8, module_length: 11 mm, module_mass: 2 g, module_radius: 7 mm}
physics: {kind: quasistatic}
task: {kind: follow_shape, pressure: 15 kPa, target: {radius: 18 mm, height: 60 mm}}
search:
  variables:
    task.pressure: {low: 2 kPa, high: 15 kPa}
    modules: {key: chain.modules, low: 4, high: 8}
  constraints: [modules <= 7]
  objective: rmse
  until: rmse <= 100 mm
  conditions:
    wide: {task.target.radius: 30 mm}
    narrow: {task.target.radius: 10 mm}
"""


@pytest.fixture
def study(tmp_path, monkeypatch):
    monkeypatch.setenv("PLIANT_STORE", str(tmp_path / "store"))
    (tmp_path / "reach.yaml").write_text(STUDY, encoding="utf-8")
    return tmp_path / "reach.yaml"


def test_the_reward_is_what_a_simulation_with_the_design_says(study):
    from pliant import api

    env = gymnasium.make(NAME, study=study)
    for condition, radius in (("wide", "30 mm"), ("narrow", "10 mm")):
        env.reset(options={"condition": condition})
        _, reward, _, _, info = env.step(np.array([0.2, 0.0], np.float32))
        assert (info["status"], info["values"]["modules"]) == ("ok", 6)
        changes = [
            f"task.pressure={info['values']['task.pressure']} Pa",
            "chain.modules=6",
            f"task.target.radius={radius}",
        ]
        run = api.simulate(api.open_study(study, changes, store=study.parent / "store"))
        assert reward == pytest.approx(-run.engines[0].result.metrics["rmse_m"], rel=1e-6)
        assert info["metrics"]["rmse_m"] == pytest.approx(-reward)
        assert info["is_success"]
    _, reward, _, _, info = env.step(np.array([0.2, 1.0], np.float32))
    assert (reward, info["status"], info["cause"]) == (-1.0, "refused", "modules <= 7")


@pytest.mark.slow
def test_separate_processes_step_a_study(study):
    """Fresh processes, which build the problem themselves, give the results of this process."""
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import SubprocVecEnv

    alone = gymnasium.make(NAME, study=study)
    envs = make_vec_env(NAME, 2, seed=0, env_kwargs={"study": study}, vec_env_cls=SubprocVecEnv)
    try:
        assert envs.reset().shape == (2, 1)
        actions = np.array([[0.2, 0.0], [-0.5, -1.0]], np.float32)
        _, rewards, ended, infos = envs.step(actions)
    finally:
        envs.close()
    assert ended.all()
    for action_, reward, info in zip(actions, rewards, infos, strict=True):
        alone.reset(options={"condition": info["condition"]})
        _, expected, *_ = alone.step(action_)
        assert info["status"] == "ok"
        assert reward == pytest.approx(expected, rel=1e-6)


def test_a_study_without_a_search_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("PLIANT_STORE", str(tmp_path / "store"))
    (tmp_path / "plain.yaml").write_text(STUDY.partition("search:")[0], encoding="utf-8")
    with pytest.raises(UserError, match="search"):
        gymnasium.make(NAME, study=tmp_path / "plain.yaml")


def test_an_optimizer_policy_continues_in_the_environment(tmp_path):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    from pliant_ppo.config import PpoConfig
    from pliant_ppo.optimizer import Ppo

    optimizer = Ppo(PpoConfig(tensorboard=False))
    optimizer.start(StandInProblem().space(contextual=True), 0)
    optimizer.export(tmp_path)
    model = PPO.load(tmp_path / "policy.zip", env=made())
    model.learn(8)
    assert model.num_timesteps == 8
