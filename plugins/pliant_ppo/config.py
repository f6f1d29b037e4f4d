"""Configuration of PPO. No heavy library is imported here."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from pliant_search.optimizer import OptimizerConfig


class PpoConfig(OptimizerConfig):
    """A policy (condition → design) learned by PPO, each candidate being an episode of one step.

    Needs thousands of candidates; use it if one policy shall serve many conditions. The defaults are those of
    the gripper co-design by Yao, Howard, Maiolino, Adv. Intell. Syst. 2026, doi 10.1002/aisy.70406, `epochs` and `net`
    those of stable-baselines3, which the paper leaves open.
    """

    kind: Literal["ppo"] = "ppo"
    learning_rate: float = Field(
        default=1e-4,
        gt=0,
        le=1,
        description="of Adam; the study's is low: some thousands of candidates need 1e-3 or more",
    )
    environments: int = Field(
        default=4,
        ge=1,
        le=1024,
        description="candidates that stand side by side; with n_steps the size of a batch",
    )
    n_steps: int = Field(
        default=8, ge=1, le=65536, description="candidates of each environment between two updates"
    )
    batch_size: int = Field(default=32, ge=2, le=1_000_000, description="candidates of one gradient step")
    epochs: int = Field(default=10, ge=1, le=1000, description="passes over a batch in one update")
    gamma: float = Field(
        default=0.9, ge=0, le=1, description="discount; without effect in episodes of one step"
    )
    gae_lambda: float = Field(
        default=0.9, ge=0, le=1, description="of the advantages; without effect in episodes of one step"
    )
    clip_range: float = Field(default=0.3, gt=0, le=10, description="how far an update may change the policy")
    entropy: float = Field(
        default=0.03, ge=0, le=10, description="weight of the entropy: more keeps the policy wide"
    )
    value_weight: float = Field(default=0.3, ge=0, le=10, description="weight of the value function's error")
    net: tuple[int, ...] = Field(
        default=(64, 64), max_length=8, description="hidden units of the policy and of the value function"
    )
    tensorboard: bool | str = Field(
        default=True,
        description="event files with the result; a folder: there too, while it learns; false: none",
    )

    @model_validator(mode="after")
    def _sizes(self) -> PpoConfig:
        if self.environments * self.n_steps < 2:
            raise ValueError("environments × n_steps is 1; an update needs at least 2 candidates")
        if any(not 1 <= units <= 4096 for units in self.net):
            raise ValueError(f"net is {list(self.net)}; each layer has 1 to 4096 units")
        return self
