"""A config module that imports a library that only its implementation needs."""

import sqlite3

from tests.conformance.broken.material import SolidConfig

LIMIT = sqlite3.SQLITE_LIMIT_LENGTH


class HeavyConfig(SolidConfig):
    """The same config, expensive to import."""
