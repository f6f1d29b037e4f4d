"""One study of each shipped family, and the wall that its parameters state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sin
from pathlib import Path

MM = 1e-3


@dataclass(frozen=True)
class Printed:
    """A study to print.

    Attributes:
        family: the block, as text.
        walls_m: thinnest wall by material as the parameters state it.
        region: a region of another material; "" without one.
        drive: the key of the largest actuation.
    """

    family: str
    walls_m: Mapping[str, float]
    region: str = ""
    drive: str = "pressure_max: 15 kPa"


HALF_RIB_RAD = 1.5 / (3.5 + 8.5)  # of the three chambers: a rib is a sector, thinnest at the bore's wall
DESIGNS: Mapping[str, Printed] = {
    "bellow_bending": Printed(
        "{kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}",
        {"body": 1.5 * MM},
    ),
    "bellow_helical": Printed(
        "{kind: bellow_helical, inner_radius: 3.09 mm, average_radius: 5.66 mm, wall: 1.51 mm, module_length: 4.72 mm}",
        {"body": 1.51 * MM},
    ),
    "bellow_translational": Printed(
        "{kind: bellow_translational, inner_radius: 3 mm, average_radius: 6 mm, wall: 1 mm, module_length: 8 mm}",
        {"body": 1.0 * MM},
    ),
    "pneunet": Printed(
        "{kind: pneunet, module_length: 10 mm, width: 15 mm, height: 14 mm, wall: 1.5 mm, shell: 2 mm, gap: 1 mm, "
        "floor: 1.5 mm, bridge: 1.5 mm, channel_width: 2 mm, channel_height: 1.5 mm, layer: 1 mm}",
        {"body": 1.5 * MM, "layer": 1.0 * MM},
        region="layer",
    ),
    "two_chamber": Printed(
        "{kind: two_chamber, width: 12 mm, height: 12 mm, wall: 1.5 mm, web: 1.2 mm, module_length: 10 mm}",
        {"body": 1.2 * MM},
    ),
    "three_chamber": Printed(
        "{kind: three_chamber, radius: 10 mm, bore: 2 mm, wall: 1.5 mm, rib: 1.5 mm, module_length: 12 mm}",
        {"body": 2 * 3.5 * MM * sin(HALF_RIB_RAD)},
    ),
    "fibre_reinforced": Printed(
        "{kind: fibre_reinforced, module_length: 20 mm, radius: 6 mm, wall: 3 mm, sleeve: 1 mm, thread_angle: 87 deg, "
        "thread_spacing: 1 mm, thread_stiffness: 100 N, sheet_angle: 45 deg}",
        {"body": 2.0 * MM, "sheet": 1.0 * MM},
        region="sheet",
    ),
    "tendon_joint": Printed(
        "{kind: tendon_joint, module_length: 29 mm, flexure_length: 6 mm, flexure_thickness: 2 mm, "
        "flexure_width: 12 mm, tendon_offset: 4 mm, tendon_setback: 3 mm, link_height: 14 mm, link_width: 14 mm, "
        "link_density: 1200 kg/m^3, closing_angle: 80 deg, opening_angle: 30 deg}",
        {"body": 2.0 * MM},
        drive="tendon_force_max: 2 N",
    ),
}


def study_text(name: str, modules: int = 3) -> str:
    """Return the study of a family as a file's text."""
    one = DESIGNS[name]
    region = (
        f", regions: {{{one.region}: {{kind: neo_hookean, shear_modulus: 2 MPa, density: 1300 kg/m^3}}}}"
        if one.region
        else ""
    )
    return (
        f"pliant: 1\nname: {name}\nfamily: {one.family}\n"
        f"material: {{kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3{region}}}\n"
        f"fem: {{kind: skfem, {one.drive}}}\nchain: {{modules: {modules}}}\n"
    )


def mesh_file_text(file: Path, modules: int = 3) -> str:
    """Return the study of a module from a mesh file, as `examples/cad_file` has it."""
    return (
        "pliant: 1\nname: mesh_file\n"
        f"family: {{kind: mesh_file, file: '{file}', unit: mm, part: half, symmetry: symmetry, line_height: 1 mm}}\n"
        "material: {kind: neo_hookean, shear_modulus: 120 kPa, density: 1070 kg/m^3}\n"
        f"fem: {{kind: skfem, pressure_max: 8 kPa}}\nchain: {{modules: {modules}}}\n"
    )
