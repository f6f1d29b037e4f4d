"""Gymnasium environments of the tasks; importing this package registers them.

    import gymnasium
    import pliant_plugins.envs

    env = gymnasium.make("pliant/TipLoad-v0")

Gymnasium 1 asks no installed package for its environments; "pliant_plugins.envs:pliant/TipLoad-v0" needs no import.
"""

from pliant_plugins.envs.registration import register

register()
