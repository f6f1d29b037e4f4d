"""Gymnasium environments of installed packages: gymnasium asks nobody for them, so `import pliant` does."""

from __future__ import annotations

import warnings
from importlib.metadata import entry_points

GROUP = "gymnasium.envs"


def register_environments() -> None:
    """Call the functions that packages name under the entry point `pliant` of the group `gymnasium.envs`.

    Each registers its environments with gymnasium. One that fails is a RuntimeWarning, the others go on.
    """
    for entry in entry_points(group=GROUP, name="pliant"):
        try:
            entry.load()()
        except Exception as error:  # another package's code may fail in any way
            origin = entry.dist.name if entry.dist else entry.value
            warnings.warn(f"environments of {origin} are not there: {error}", RuntimeWarning, stacklevel=2)
