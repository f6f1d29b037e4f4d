"""`pliant store`: what the folder of cached results holds."""

from __future__ import annotations

from pliant.cli.options import DEFAULT_STORE, JsonFile, Quiet, StoreFolder
from pliant.cli.session import session
from pliant.report.store import store_document


def store(store: StoreFolder = DEFAULT_STORE, json: JsonFile = None, quiet: Quiet = False) -> None:
    """What the store of cached results holds: artifacts and megabytes of every stage, and the newest of each."""
    with session("store", json, quiet) as here:
        here.show(store_document(store.expanduser()))
