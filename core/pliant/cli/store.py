"""`pliant store`: what the folder of cached results holds."""

from __future__ import annotations

from pliant.cli.options import verb
from pliant.cli.session import Session
from pliant.report.store import store_document


@verb()
def store(here: Session) -> None:
    """What the store of cached results holds: artifacts and megabytes of every stage, and the newest of each."""
    here.show(store_document(here.store.expanduser()))
