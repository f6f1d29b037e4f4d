"""Gymnasium environments of the tasks; importing this package registers them.

    import gymnasium
    import pliant

    env = gymnasium.make("pliant/TipLoad-v0")

Gymnasium 1 asks no installed package for its environments, so `import pliant` registers them where gymnasium was
imported before it; the name "pliant_plugins.envs:pliant/TipLoad-v0" needs no import at all.
"""

from pliant_plugins.envs.registration import register

register()
