"""A trained policy: without gains it is open-loop inverse statics, and training lowers the selected objective."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")
pytest.importorskip("cma")

from benchmarks.control import STUDY  # noqa: E402

import pliant_plugins.envs  # noqa: E402, F401 - registers them
from pliant_plugins.envs.baselines import Nominal, OpenLoop, score  # noqa: E402
from pliant_plugins.envs.control import MeasuredEnv  # noqa: E402
from pliant_search.envs.trained import FEATURES, Episode, LinearResidual, train  # noqa: E402
from pliant_search.optimizers.cmaes.optimizer import Cmaes  # noqa: E402
from pliant_search.optimizers.config import CmaesConfig  # noqa: E402

NONE = np.zeros(len(FEATURES))


@pytest.fixture
def env(tmp_path: Path) -> MeasuredEnv:
    (tmp_path / "study.yaml").write_text(STUDY)
    made = gymnasium.make(
        "pliant/Track-v0", study=tmp_path / "study.yaml", worlds=4, delay_s=0.05, episode_s=1.5
    )
    found: MeasuredEnv = made.unwrapped
    return found


def test_without_gains_it_is_open_loop(env: MeasuredEnv) -> None:
    both = [score(env, one, range(2), world=1) for one in (LinearResidual(env, NONE), OpenLoop(env))]
    np.testing.assert_array_equal(*both)


def test_an_integral_takes_away_the_offset(env: MeasuredEnv) -> None:
    """At rest in a robot that is not the nominal one, only the integral's gain is needed."""

    def left(gains: Any) -> float:
        policy = LinearResidual(env, gains)
        _, info = env.reset(seed=1, options={"world": 2, "path_m": np.tile([[0.02, 0.0, -0.08]], (2, 1))})
        policy.begin(info)
        tips = []
        for _ in range(120):
            info = env.step(policy.act(info).astype(np.float32))[4]
            tips.append(info["tip_m"])
        reading = np.mean(tips[-40:], axis=0) - info["target_m"]
        slope = policy._model.aim(info["target_m"]).per_m
        return float(np.abs(slope @ reading).max())

    with_sum = NONE.copy()
    with_sum[list(FEATURES).index("sum")] = 0.1
    assert left(with_sum) < 0.25 * left(NONE)


def test_training_lowers_the_error_and_repeats(env: MeasuredEnv) -> None:
    episodes, model = [Episode(env, k, k) for k in range(3)], Nominal(env)
    shares = 0.5 + 0.3 * np.sin(4.0 * env.control_s * np.arange(env.steps + 1))
    options: dict[str, Any] = {
        "skip": 5,
        "path_m": np.array([model.tip_m(np.array([one])) for one in shares]),
    }

    def trained(candidates: int) -> Any:
        policy = LinearResidual(env, NONE, model)
        optimizer = Cmaes(CmaesConfig(kind="cmaes"))
        return train(policy, episodes, candidates=candidates, optimizer=optimizer, **options)

    def worst(policy: LinearResidual) -> float:
        return max(score(env, policy, range(k, k + 1), world=k, **options)[0] for k in range(3))

    one, again = trained(27), trained(9)
    np.testing.assert_array_equal(one.errors_m[:9], again.errors_m)
    # the first candidate is the unchanged policy
    assert one.errors_m[0] == pytest.approx(worst(LinearResidual(env, NONE, model)))
    assert worst(one.policy) == pytest.approx(one.errors_m.min())
    assert one.errors_m.min() < 0.8 * one.errors_m[0]
