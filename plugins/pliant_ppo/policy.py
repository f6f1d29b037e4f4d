"""A learned policy as files, and designs from them.

    from pliant_ppo.policy import SavedPolicy

    policy = SavedPolicy.load("runs/NAME/optimizer")
    policy.design("egg-5")        # {"family.average_radius": 0.0071, ...}, SI
    policy.design((0.0, 0.4))     # of a condition that has these features

`policy.zip` is stable-baselines3's own format. `SavedPolicy` reads its weights alone, as tensors; `PPO.load`, which is
needed to continue learning, also runs the pickles in it: use it only for files that you trust.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from pickle import UnpicklingError
from typing import TYPE_CHECKING, Any

import numpy as np

from pliant.errors import UserError, closest
from pliant_plugins.native import load_torch
from pliant_ppo.episode import Numbers, decode_action, episode_spaces
from pliant_search.optimizer import Space, Value, Variable

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

ZIP, MEANING = "policy.zip", "policy.json"
HOW = (
    "action: one number per variable in this order, clipped to [-1, 1]; real: low at -1, high at 1; integer: the same "
    "rounded, halves up; categorical: equal bins of [-1, 1] in the order of choices; "
    "observation: the context's row of 'observations'"
)


def write_policy(folder: Path, model: Any, space: Space, observations: Numbers) -> list[Path]:
    """Write `policy.zip` by stable-baselines3's `save`, and the contexts, variables and bounds as JSON."""
    folder.mkdir(parents=True, exist_ok=True)
    model.save(folder / ZIP)
    described = space.as_json()
    meaning = {
        "format": 1,
        "action": HOW,
        "variables": described["variables"],
        "contexts": described["contexts"],
        "observations": observations.astype(float).tolist(),
    }
    (folder / MEANING).write_text(json.dumps(meaning, indent=1) + "\n", encoding="utf-8")
    return [folder / ZIP, folder / MEANING]


@dataclass(frozen=True, eq=False)
class SavedPolicy:
    """A policy that a search has left.

    Attributes:
        network: stable-baselines3's policy.
        variables: what an action sets.
        contexts: names of the conditions that it was trained in.
        observations: (c, k) its observation in each.
    """

    network: ActorCriticPolicy
    variables: tuple[Variable, ...]
    contexts: tuple[str, ...]
    observations: Numbers

    @staticmethod
    def load(folder: str | Path) -> SavedPolicy:
        """Read the policy in a folder.

        Raises:
            UserError: a file is missing or damaged.
            MissingDependencyError: torch is not installed.
        """
        for name in (ZIP, MEANING):
            if not (Path(folder) / name).is_file():
                raise UserError(
                    f"'{folder}' has no {name}; name the folder that a search with 'ppo' has written."
                )
        load_torch("a saved policy needs torch")
        try:
            meaning = json.loads((Path(folder) / MEANING).read_text(encoding="utf-8"))
            space = Space.from_json({**meaning, "objectives": 1, "start": {}, "spread": None})
            observations = np.array(meaning["observations"], np.float32)
            network = _network(Path(folder) / ZIP, observations.shape[1], len(space.variables))
        except (ValueError, LookupError, TypeError, RuntimeError, UnpicklingError) as error:
            cause = str(error).partition("\n")[0] or type(error).__name__
            raise UserError(f"the policy in '{folder}' is damaged ({cause}); run the search again.") from None
        return SavedPolicy(
            network, space.variables, tuple(context.name for context in space.contexts), observations
        )

    def design(self, condition: str | Sequence[float] | None = None) -> dict[str, Value]:
        """Return the policy's mean design.

        Args:
            condition: name of a condition, or features (k,) of one that it was not trained in; None where it was
                trained without conditions.

        Raises:
            UserError: an unknown name, or another number of features.
        """
        action, _ = self.network.predict(self._seen(condition), deterministic=True)
        return decode_action(action, self.variables)

    def _seen(self, condition: str | Sequence[float] | None) -> Numbers:
        if isinstance(condition, str):
            if condition not in self.contexts:
                raise UserError(f"unknown condition '{condition}'{closest(condition, self.contexts)}")
            return self.observations[self.contexts.index(condition)]
        if condition is None and len(self.observations) > 1:
            raise UserError(f"name a condition: {', '.join(self.contexts)}.")
        seen = self.observations[0] if condition is None else np.asarray(condition, np.float32)
        if seen.shape != self.observations[0].shape:
            raise UserError(f"{seen.size} features are given; this policy sees {self.observations.shape[1]}.")
        return seen


def _network(path: Path, observations: int, actions: int) -> ActorCriticPolicy:
    """Read the policy in stable-baselines3's file: its weights, and the sizes of its layers."""
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.save_util import load_from_zip_file

    weights = load_from_zip_file(path, load_data=False, device="cpu")[1]["policy"]
    hidden = [
        len(w) for name, w in weights.items() if re.fullmatch(r"mlp_extractor\.policy_net\.\d+\.bias", name)
    ]
    network = ActorCriticPolicy(*episode_spaces(observations, actions), lambda _: 0.0, net_arch=hidden)
    network.load_state_dict(weights)
    return network
