"""Measured hardware: what the evidence loop makes of recordings that nobody simulated."""
