"""Actuator families against published figures."""
