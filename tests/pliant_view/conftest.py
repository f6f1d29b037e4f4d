"""Fixtures of the command line, for the verbs of this package."""

from tests.cli.conftest import pliant, read, workplace, write

__all__ = ["pliant", "read", "workplace", "write"]
