"""Mistakes of the record, not of the physics: units, signs, exchanged columns, gravity, payloads, clocks, rest pose.

Each is a discrete correction of what the file or the study says. It is judged by the model at equilibrium, on a small
part of the readings, before any effect is asked.
"""
