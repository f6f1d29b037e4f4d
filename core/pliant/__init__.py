"""Pliant: soft robots from finite elements to fast, honest chain models.

    import pliant

    finger = pliant.open("finger.yaml")
    finger.with_(pressure="20 kPa").simulate().tip
    finger.compare()
    finger.diagnose()

`open` reads a study, `read` measurement files, `fit` makes a joint law of a table.
"""

import sys
import warnings
from importlib import import_module
from typing import Any

__version__ = "0.1.0"
__all__ = ["fit", "open", "read"]


def register_environments() -> None:
    """Call the functions that packages name under the entry point `pliant` of the group `gymnasium.envs`.

    Gymnasium asks nobody for them, so `import pliant` does. Each registers its environments with gymnasium. One that
    fails is a RuntimeWarning, the others go on.
    """
    from importlib.metadata import entry_points

    for entry in entry_points(group="gymnasium.envs", name="pliant"):
        try:
            entry.load()()
        except Exception as error:  # another package's code may fail in any way
            origin = entry.dist.name if entry.dist else entry.value
            warnings.warn(f"environments of {origin} are not there: {error}", RuntimeWarning, stacklevel=2)


# `import gymnasium, pliant` makes gymnasium.make("pliant/Grasp-v0") work; without gymnasium it costs nothing.
if "gymnasium" in sys.modules:
    register_environments()


def __getattr__(name: str) -> Any:
    """The functions of `__all__`, imported when they are first asked for: `import pliant` costs nothing."""
    if name not in __all__:
        raise AttributeError(f"module 'pliant' has no attribute '{name}'")
    study = import_module("pliant.notebook.study")
    return getattr(study, "open_study" if name == "open" else name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
