"""Sampling of a module's states: `plan` applies the strategy that the config names and keeps the solved states."""
