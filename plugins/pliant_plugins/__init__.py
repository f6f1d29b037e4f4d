"""The plugins that ship with Pliant."""
