"""Compiled mechanics that engines share: laws as function pointers, efforts, statics of a chain, equilibria.

numba's cache on disk looks only at the file of a function, not at the files of functions that it calls: when
this room is imported, machine code that is older than any of its sources is thrown away (`freshness`).
"""

from pliant_plugins.physics.compiled.freshness import discard_stale

discard_stale()
