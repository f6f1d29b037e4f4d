"""A CAD part becomes a mesh file: python examples/cad_file/mesh.py [part.step]

Draws half a cell of a finger with tall chambers where no STEP file is given, writes it as part.step, reads that back,
names the surfaces and meshes. Writes finger.msh beside this script. Needs ngsolve, for Netgen:
pip install 'pliant[ngsolve]'.
"""

import sys
from pathlib import Path

from netgen.occ import Box, OCCGeometry, Pnt

from pliant_plugins.families.mesh_file.netgen import write_mesh

HERE = Path(__file__).parent
LENGTH, CHANNEL_END = 6.0, 6.0  # mm: from the middle of a chamber to the middle of the gap to the next


def draw(path: Path) -> None:
    """Half a cell, x from mid-chamber to mid-gap, y ≥ 0, floor at z = 0."""
    solid = Box(Pnt(0, 0, 0), Pnt(5, 8, 14)) + Box(Pnt(0, 0, 0), Pnt(LENGTH, 8, 6))
    hollow = Box(Pnt(0, 0, 2), Pnt(3.5, 6.5, 12.5)) + Box(Pnt(0, 0, 2), Pnt(CHANNEL_END, 2, 4))
    (solid - hollow).WriteStep(str(path))


step = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "part.step"
if not step.is_file():
    draw(step)
part = OCCGeometry(str(step)).shape
for face in part.faces:
    corners = [vertex.p for vertex in face.vertices]
    x, y, z = zip(*corners, strict=True)
    if max(x) < 1e-6:
        face.name = "base"
    elif min(x) > LENGTH - 1e-6:
        face.name = "tip"
    elif max(y) < 1e-6:
        face.name = "symmetry"
    elif max(x) <= 3.5 + 1e-6 and max(y) <= 6.5 + 1e-6 and min(z) > 2 - 1e-6 and max(z) <= 12.5 + 1e-6:
        face.name = "cavity"  # of the chamber
    elif max(y) <= 2 + 1e-6 and min(z) > 2 - 1e-6 and max(z) <= 4 + 1e-6:
        face.name = "cavity"  # of the channel
    else:
        face.name = "outside"
print("written", write_mesh(part, HERE / "finger.msh", largest=2.5))
