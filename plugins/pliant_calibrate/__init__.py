"""Calibration of a material's constants to laboratory data: table, fit, uncertainty, undetermined constants.

Start at `calibration.calibrate`.
"""
