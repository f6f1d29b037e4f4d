"""Pliant: soft robots from finite elements to fast, honest chain models."""

import sys

from pliant.environments import register_environments

__version__ = "0.1.0"

# `import gymnasium, pliant` makes gymnasium.make("pliant/Grasp-v0") work; without gymnasium it costs nothing.
if "gymnasium" in sys.modules:
    register_environments()
