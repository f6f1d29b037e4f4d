"""3MF files (3mf.io, core specification 1.3): one object per material, components of one part, in mm."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM

NAMESPACE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)
COLOURS = ("#D9A441FF", "#3B6EA5FF", "#7A7A7AFF", "#7DA453FF", "#A5483BFF")
DATE = (1980, 1, 1, 0, 0, 0)  # the same content gives the same file


def write_3mf(bodies: Mapping[str, TriangleMesh], path: Path, title: str) -> None:
    """Write bodies by material; all keep their place to each other."""
    materials = "".join(
        f"<base name={quoteattr(name)} displaycolor={quoteattr(COLOURS[k % len(COLOURS)])}/>"
        for k, name in enumerate(bodies)
    )
    objects = [
        f'<object id="{number + 2}" type="model" name={quoteattr(name)} pid="1" pindex="{number}">'
        f"{_mesh(surface)}</object>"
        for number, (name, surface) in enumerate(bodies.items())
    ]
    parts = "".join(f'<component objectid="{number + 2}"/>' for number in range(len(bodies)))
    whole = len(bodies) + 2
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" xmlns="{NAMESPACE}">'
        f'<metadata name="Title">{quoteattr(title)[1:-1]}</metadata>'
        '<metadata name="Application">Pliant</metadata>'
        f'<resources><basematerials id="1">{materials}</basematerials>{"".join(objects)}'
        f'<object id="{whole}" type="model" name={quoteattr(title)}><components>{parts}</components></object>'
        f'</resources><build><item objectid="{whole}"/></build></model>'
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            ("3D/3dmodel.model", text),
        ):
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(entry, content)


def _mesh(surface: TriangleMesh) -> str:
    points = np.round(MM * surface.vertices_m, 8).tolist()
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in points)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in surface.faces.tolist())
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
