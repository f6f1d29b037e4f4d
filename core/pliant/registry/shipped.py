"""What the packages that ship with Pliant register: for messages where the entry point of one is missing."""

from __future__ import annotations

# Package → its verbs, its blocks of a study, and its kinds of an interface that another package registers.
ENTRIES = {
    "pliant_app": ("app",),
    "pliant_bench": ("experiment", "bench"),
    "pliant_calibrate": ("calibrate",),
    "pliant_counts": (),
    "pliant_designs": ("sweep", "meta_model"),
    "pliant_export": ("export",),
    "pliant_learned": (),
    "pliant_mjcf": ("model mjcf",),
    "pliant_ppo": ("optimizer ppo",),
    "pliant_print": ("printer", "solid", "mould"),
    "pliant_search": ("optimize", "search", "optimizer"),
    "pliant_systems": ("model python",),
    "pliant_view": ("render", "view"),
}
PACKAGES = ("pliant", "pliant_plugins", *ENTRIES)
REMEDY = "which is missing in this installation of Pliant: pip install --force-reinstall pliant"


def shipped_in(name: str) -> str:
    """Return the shipped package that registers a verb, block or kind of this name; "" for any other name."""
    return next((package for package, names in ENTRIES.items() if name in names), "")
