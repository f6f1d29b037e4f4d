"""Pliant: soft robots from finite elements to fast chain models with a stated error.

    import pliant

    finger = pliant.open("finger.yaml")
    finger.with_(pressure="20 kPa").simulate().tip
    finger.compare()
    finger.diagnose()

`open` reads a study, `read` measurement files. Without a file, `solve` gives FEM data, `fit` a joint law, `Chain` a
robot, `MjcfModel` a MuJoCo model, `Study` any study of blocks; `compare`, `diagnose` and `improve` take each of them.
"""

import sys
import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"
__all__ = ["Chain", "MjcfModel", "Study", "compare", "diagnose", "fit", "improve", "open", "read", "solve"]

if TYPE_CHECKING:
    from collections.abc import Callable

    from pliant.notebook.compose import Chain, compare, diagnose, improve, solve
    from pliant.notebook.compose import ComposedStudy as Study
    from pliant.notebook.session import fit, read
    from pliant.notebook.session import open_study as open

    MjcfModel: Callable[..., Study]

# Public names that differ from the names in their modules.
_NAMES = {"open": "open_study", "Study": "ComposedStudy"}
_SESSION_NAMES = ("fit", "open", "read")
# Names of other packages: the function in their manifest, and the package.
_PACKAGE_NAMES = {"MjcfModel": ("mjcf_model", "pliant_mjcf")}


def register_environments() -> None:
    """Call the functions that packages name under the entry point `pliant` of the group `gymnasium.envs`.

    Gymnasium does not call them, so `import pliant` does. Each registers its environments with gymnasium. One that
    fails gives a RuntimeWarning and does not stop the others.
    """
    from importlib.metadata import entry_points

    for entry in entry_points(group="gymnasium.envs", name="pliant"):
        try:
            entry.load()()
        except Exception as error:  # another package's code may raise anything
            origin = entry.dist.name if entry.dist else entry.value
            warnings.warn(f"environments of {origin} are not there: {error}", RuntimeWarning, stacklevel=2)


# `import gymnasium, pliant` makes gymnasium.make("pliant/Grasp-v0") work; without gymnasium it costs nothing.
if "gymnasium" in sys.modules:
    register_environments()


def __getattr__(name: str) -> Any:
    """Import the functions of `__all__` on first access, so that `import pliant` takes no time."""
    if name not in __all__:
        raise AttributeError(f"module 'pliant' has no attribute '{name}'")
    if name in _PACKAGE_NAMES:
        from pliant.registry.function import package_function

        return package_function(*_PACKAGE_NAMES[name])
    module = import_module("pliant.notebook.session" if name in _SESSION_NAMES else "pliant.notebook.compose")
    return getattr(module, _NAMES.get(name, name))


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
