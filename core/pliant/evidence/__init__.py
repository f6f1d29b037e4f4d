"""The evidence loop: measurements → prediction → comparison → diagnosis → extended model.

Import from the files: each holds one stage.
"""
