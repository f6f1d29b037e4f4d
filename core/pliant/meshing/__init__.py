"""What families build their meshes and masses with: 27-node hexahedra, structured grids, masses of a mesh.

Import the files themselves (`pliant.meshing.grids`), so that a stage's code fingerprint holds only what it uses.
"""
