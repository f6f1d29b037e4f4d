"""Drivers of benches: simulated, serial, socket, files."""
