"""`pliant`: the entry point. Light, so that Ctrl-C is answered while the rest is still being imported."""

from __future__ import annotations

import sys

from pliant.errors import INTERRUPTED


def main() -> None:
    """Entry point of the `pliant` command."""
    try:
        from pliant.cli.verbs import app

        app()
    except KeyboardInterrupt:
        print("interrupted before anything began.", file=sys.stderr)
        sys.exit(INTERRUPTED)
