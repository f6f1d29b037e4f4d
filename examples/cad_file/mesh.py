"""A CAD part becomes a mesh file: python examples/cad_file/mesh.py [part.step | part.stl]

Draws half a cell of a finger with tall chambers where no file is given, writes it as part.step, reads that back, names
its surfaces and meshes. Writes finger.msh beside this script. Needs Netgen: pip install 'pliant[ngsolve]'.
"""

import sys
from pathlib import Path

import numpy as np
from netgen.occ import Box, Pnt

from pliant_plugins.families.mesh_file.netgen import mesh_cad

HERE = Path(__file__).parent
LENGTH = 6.0  # mm: from the middle of a chamber to the middle of the gap to the next


def draw(path: Path) -> None:
    """Half a cell: x from mid-chamber to mid-gap, y ≥ 0, the floor at z = 0."""
    solid = Box(Pnt(0, 0, 0), Pnt(5, 8, 14)) + Box(Pnt(0, 0, 0), Pnt(LENGTH, 8, 6))
    hollow = Box(Pnt(0, 0, 2), Pnt(3.5, 6.5, 12.5)) + Box(Pnt(0, 0, 2), Pnt(LENGTH, 2, 4))
    (solid - hollow).WriteStep(str(path))


def surface(points: np.ndarray) -> str:
    """The name of the face that these points lie on."""
    x, y, z = points.T
    if np.ptp(x) < 1e-6 and (x[0] < 1e-6 or x[0] > LENGTH - 1e-6):
        return "base" if x[0] < 1e-6 else "tip"
    if y.max() < 1e-6:
        return "symmetry"
    chamber = x.max() < 3.501 and y.max() < 6.501 and z.min() > 1.999 and z.max() < 12.501
    channel = y.max() < 2.001 and z.min() > 1.999 and z.max() < 4.001
    floor = z.min() > 1.999 and z.max() < 2.001  # of both
    return "cavity" if chamber or channel or floor else "outside"


part = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "part.step"
if not part.is_file():
    draw(part)
print("written", mesh_cad(part, HERE / "finger.msh", largest=1.5, name=surface))
