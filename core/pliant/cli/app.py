"""`pliant`: the entry point. It imports little, so that Ctrl-C is handled while the other modules are imported."""

from __future__ import annotations

from pliant.errors import interrupted_at_start


def main() -> None:
    """Run the `pliant` command."""
    try:
        from pliant.cli.verbs import app

        app()
    except KeyboardInterrupt:
        interrupted_at_start()
