"""Plugins: what a package declares (`component`), the hook it fills (`hookspecs`), how it is found (`discovery`)."""
