"""Settings of all tests."""

from hypothesis import HealthCheck, settings

# The same examples on every machine and no clock: a loaded machine must not fail a test.
settings.register_profile(
    "pliant", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("pliant")
