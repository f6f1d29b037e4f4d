"""`pliant`: the entry point. Light, so that Ctrl-C is answered while the rest is still being imported."""

from __future__ import annotations

from pliant.errors import interrupted_at_start


def main() -> None:
    """Entry point of the `pliant` command."""
    try:
        from pliant.cli.verbs import app

        app()
    except KeyboardInterrupt:
        interrupted_at_start()
