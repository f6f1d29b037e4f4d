"""STEP files (ISO 10303-21, AP214): each connected body as a faceted B-rep, one plane face per triangle, millimetres.

A CAD program reads it as a solid of planes, not as cylinders and tori; there is no feature history.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('faceted boundary representation'),'2;1');
FILE_NAME('{name}','',(''),(''),'Pliant','Pliant','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('automotive design');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT('{name}','{name}','',(#3));
#5=PRODUCT_DEFINITION_FORMATION('','',#4);
#6=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#7=PRODUCT_DEFINITION('design','',#5,#6);
#8=PRODUCT_DEFINITION_SHAPE('','',#7);
#9=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#10=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#11=(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT());
#12=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-06),#9,'distance_accuracy_value','');
#13=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#12))\
GLOBAL_UNIT_ASSIGNED_CONTEXT((#9,#10,#11))REPRESENTATION_CONTEXT('',''));
#14=SHAPE_DEFINITION_REPRESENTATION(#8,#15);
"""
FIRST = 16


def write_step(bodies: Mapping[str, Sequence[TriangleMesh]], path: Path, name: str) -> None:
    """Write the connected pieces of each body.

    Raises:
        UserError: a piece is inside out, which is a closed hollow.
    """
    safe = "".join(c for c in name if c.isascii() and (c.isalnum() or c in " ._-")) or "robot"
    breps: list[int] = []
    number = FIRST
    lines = [HEAD.format(name=safe)]
    for label, pieces in bodies.items():
        for piece in pieces:
            a, b, c = (piece.vertices_m[piece.faces[:, k]] for k in range(3))
            if np.einsum("ki,ki->", a, np.cross(b, c)) < 0:
                raise UserError(
                    f"STEP: the body '{label}' has a closed hollow, which a faceted B-rep cannot have; write 3MF."
                )
            for line in _piece(piece, number, label):
                lines.append(line)
                number += 1
            breps.append(number - 1)
    items = ",".join(f"#{brep}" for brep in breps)
    lines.append(
        f"#15=FACETED_BREP_SHAPE_REPRESENTATION('{safe}',({items}),#13);\nENDSEC;\nEND-ISO-10303-21;\n"
    )
    path.write_text("".join(lines), encoding="ascii")


def _piece(piece: TriangleMesh, first: int, label: str) -> Iterator[str]:
    """Yield the entities of a closed surface, numbered from `first` on; the last one is its B-rep."""
    number = first
    points = MM * piece.vertices_m
    for x, y, z in points.tolist():
        yield f"#{number}=CARTESIAN_POINT('',({x:.9f},{y:.9f},{z:.9f}));\n"
        number += 1
    corners = points[piece.faces]
    along = corners[:, 1] - corners[:, 0]
    normal = np.cross(along, corners[:, 2] - corners[:, 0])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    faces = []
    for (i, j, k), n, d in zip((piece.faces + first).tolist(), normal.tolist(), along.tolist(), strict=True):
        yield f"#{number}=POLY_LOOP('',(#{i},#{j},#{k}));\n"
        yield f"#{number + 1}=FACE_OUTER_BOUND('',#{number},.T.);\n"
        yield f"#{number + 2}=DIRECTION('',({n[0]:.12f},{n[1]:.12f},{n[2]:.12f}));\n"
        yield f"#{number + 3}=DIRECTION('',({d[0]:.12f},{d[1]:.12f},{d[2]:.12f}));\n"
        yield f"#{number + 4}=AXIS2_PLACEMENT_3D('',#{i},#{number + 2},#{number + 3});\n"
        yield f"#{number + 5}=PLANE('',#{number + 4});\n"
        yield f"#{number + 6}=FACE_SURFACE('',(#{number + 1}),#{number + 5},.T.);\n"
        faces.append(number + 6)
        number += 7
    shell = ",".join(f"#{face}" for face in faces)
    yield f"#{number}=CLOSED_SHELL('',({shell}));\n"
    yield f"#{number + 1}=FACETED_BREP('{label}',#{number});\n"
