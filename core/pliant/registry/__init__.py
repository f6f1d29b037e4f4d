"""Plugins: their declaration (`component`), the hooks that they implement (`hookspecs`), discovery (`discovery`)."""
