"""Fixtures of the command line, for files of this package."""

from tests.cli.conftest import pliant, read, workplace, write

__all__ = ["pliant", "read", "workplace", "write"]
