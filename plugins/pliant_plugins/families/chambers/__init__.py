"""Modules of several chambers: tubes of one cross-section, wound so that their outline keeps its shape."""
