"""stable-baselines3's PPO with the control turned round: it samples and learns, and steps no environment."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import stable_baselines3
import torch
from numpy.typing import NDArray
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecEnv

from pliant.records.design import Array
from pliant_ppo.config import PpoConfig
from pliant_ppo.episode import Numbers, episode_spaces

# Purposes of draws; each has a separate random sequence.
START, CANDIDATE, UPDATE = 0, 1, 2


def packed(array: NDArray[Any]) -> dict[str, Any]:
    """Encode a float array of any shape as JSON values."""
    little = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False)
    return {
        "type": f"f{array.dtype.itemsize}",
        "shape": list(array.shape),
        "bytes": base64.b64encode(little.tobytes()).decode("ascii"),
    }


def unpacked(packet: Mapping[str, Any]) -> NDArray[Any]:
    """Decode the array, writable."""
    raw = np.frombuffer(base64.b64decode(packet["bytes"]), f"<{packet['type']}")
    return raw.astype(packet["type"]).reshape(packet["shape"])


@contextmanager
def _drawn_from(seed: int, purpose: int, number: int) -> Iterator[None]:
    """Seed torch and numpy with (seed, purpose, number), torch on one thread; restore both states on exit."""
    word = int(np.random.SeedSequence((seed, purpose, number)).generate_state(1)[0])
    threads, numpy_state = torch.get_num_threads(), np.random.get_state()
    generator = torch.random.default_generator
    torch_state = generator.get_state()
    try:
        if threads != 1:
            torch.set_num_threads(1)  # sums over threads would depend on their number
        generator.manual_seed(word)
        np.random.seed(word)
        yield
    finally:
        np.random.set_state(numpy_state)
        generator.set_state(torch_state)
        if threads != 1:
            torch.set_num_threads(threads)


@dataclass(frozen=True, eq=False)
class Sample:
    """One draw of the policy.

    Attributes:
        observation: (k,).
        action: (n,) as drawn; beyond ±1 it means ±1.
        value: expectation of the value function.
        log_prob: logarithm of the density of the action.
    """

    observation: Numbers
    action: Numbers
    value: float
    log_prob: float


class Learner:
    """A PPO model: policy, value function and Adam are its own, the buffer is filled from outside.

    Args:
        config: its settings.
        observations: k.
        actions: n.
        seed: decides the network's start, every draw and the order of the updates' mini-batches.
        start: (n,) mean of the untrained policy.
    """

    def __init__(
        self, config: PpoConfig, observations: int, actions: int, seed: int, start: Numbers | None = None
    ) -> None:
        self.seed, self.updates = seed, 0
        with _drawn_from(seed, START, 0):
            self.model = stable_baselines3.PPO(
                "MlpPolicy",
                _Spaces(config.environments, observations, actions),
                learning_rate=config.learning_rate,
                n_steps=config.n_steps,
                batch_size=min(config.batch_size, config.environments * config.n_steps),
                n_epochs=config.epochs,
                gamma=config.gamma,
                gae_lambda=config.gae_lambda,
                clip_range=config.clip_range,
                ent_coef=config.entropy,
                vf_coef=config.value_weight,
                policy_kwargs={"net_arch": list(config.net)},
                device="cpu",
            )
        self.model.set_logger(Logger(None, []))
        if start is not None:
            with torch.no_grad():
                self.model.policy.action_net.bias.copy_(torch.from_numpy(start))

    def sample(self, observation: Numbers, number: int) -> Sample:
        """Return the draw of a candidate; it depends on its number, not on earlier draws."""
        policy = self.model.policy
        policy.set_training_mode(False)
        with _drawn_from(self.seed, CANDIDATE, number), torch.no_grad():
            action, value, log_prob = policy(torch.from_numpy(observation[None]))
        return Sample(observation, action.numpy()[0], float(value), float(log_prob))

    def mean(self, observation: Numbers) -> Numbers:
        """Return the policy's mean action (n,), in [−1, 1]."""
        with _drawn_from(self.seed, CANDIDATE, 0):
            action, _ = self.model.predict(observation, deterministic=True)
        return np.asarray(action, np.float32)

    def learn(self, samples: Sequence[Sample], rewards: Array) -> dict[str, float]:
        """Update the policy from a batch of environments × n_steps episodes, in the order of their draw.

        Returns:
            the values that stable-baselines3 logs for an update, by its names, and the mean reward.
        """
        model, logger, buffer = self.model, self.model.logger, self.model.rollout_buffer
        side = model.n_envs
        with _drawn_from(self.seed, UPDATE, self.updates):
            buffer.reset()
            for first in range(0, len(samples), side):
                row = samples[first : first + side]
                buffer.add(
                    np.stack([s.observation for s in row]),
                    np.stack([s.action for s in row]),
                    rewards[first : first + side],
                    np.ones(side),
                    torch.tensor([s.value for s in row]),
                    torch.tensor([s.log_prob for s in row]),
                )
            # Every step ends its episode, so that the return is the reward.
            buffer.compute_returns_and_advantage(torch.zeros(side), np.ones(side, bool))
            model.train()
        self.updates += 1
        model.num_timesteps += len(samples)
        logger.record("rollout/ep_rew_mean", float(np.mean(rewards)))
        logged = {name: float(value) for name, value in logger.name_to_value.items()}
        logger.dump(model.num_timesteps)
        return logged

    def state(self) -> dict[str, Any]:
        """Return networks, Adam and counters as JSON values."""
        adam = self.model.policy.optimizer.state_dict()["state"]
        return {
            "policy": {k: packed(v.numpy()) for k, v in self.model.policy.state_dict().items()},
            "adam": {str(i): {k: packed(v.numpy()) for k, v in slot.items()} for i, slot in adam.items()},
            "updates": self.updates,
            "steps": self.model.num_timesteps,
            "gradient_steps": self.model._n_updates,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore networks and optimiser from `state`."""
        policy = self.model.policy
        policy.load_state_dict({k: torch.from_numpy(unpacked(v)) for k, v in state["policy"].items()})
        slots = {
            int(i): {k: torch.from_numpy(unpacked(v)) for k, v in slot.items()}
            for i, slot in state["adam"].items()
        }
        policy.optimizer.load_state_dict({**policy.optimizer.state_dict(), "state": slots})
        self.updates = state["updates"]
        self.model.num_timesteps, self.model._n_updates = state["steps"], state["gradient_steps"]


class _Spaces(VecEnv):
    """A placeholder environment with the spaces and the number of environments, all that PPO uses of it."""

    def __init__(self, side: int, observations: int, actions: int) -> None:
        super().__init__(side, *episode_spaces(observations, actions))

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [None] * self.num_envs  # `render_mode` is requested

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs

    def close(self) -> None:
        """Do nothing: no resource is open."""

    def _refused(self, *given: Any, **named: Any) -> Any:
        raise NotImplementedError("this environment only carries spaces; episodes come through `Learner`")

    reset = step_async = step_wait = set_attr = env_method = _refused
