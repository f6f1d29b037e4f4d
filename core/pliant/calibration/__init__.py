"""Constants of a material from bench data: read the table, fit, say how sure and what the data cannot tell.

Start at `calibration.calibrate`.
"""
