"""`pliant`: the entry point. Light, so that Ctrl-C is answered while the rest is still being imported."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pliant.cli.verbs import app as app

INTERRUPTED = 130


def main() -> None:
    """Entry point of the `pliant` command."""
    try:
        from pliant.cli.verbs import app

        app()
    except KeyboardInterrupt:
        print("interrupted before anything began.", file=sys.stderr)
        sys.exit(INTERRUPTED)


def __getattr__(name: str) -> Any:
    if name == "app":
        from pliant.cli.verbs import app

        return app
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
