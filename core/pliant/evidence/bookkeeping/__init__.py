"""Bookkeeping mistakes of a recording: units, signs, exchanged columns, gravity, payloads, clocks, rest pose.

Each is a discrete correction of the file or the study. The model at equilibrium judges it on a small part of the
readings, before any effect is considered.
"""
