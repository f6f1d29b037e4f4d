"""Tools for the meshes and masses of families: 27-node hexahedra, structured grids, masses of a mesh.

Import the modules (`pliant.meshing.grids`), so that a stage's code fingerprint contains only what it uses.
"""
