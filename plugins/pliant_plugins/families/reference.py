"""Reference designs of the families: the examples of the manifest, and what tests and benchmarks solve."""

from __future__ import annotations

from pathlib import Path

FINGER = {
    "inner_radius": "2 mm",
    "average_radius": "6 mm",
    "wall": "1.5 mm",
    "module_length": "11 mm",
}
HELIX_MODULE = {
    "inner_radius": "3.09 mm",
    "average_radius": "5.66 mm",
    "wall": "1.51 mm",
    "module_length": "4.72 mm",
}
EXTENDING = {
    "inner_radius": "5 mm",
    "average_radius": "8 mm",
    "wall": "1.5 mm",
    "module_length": "10 mm",
}
TWO_CHAMBER = {
    "width": "20 mm",
    "height": "20 mm",
    "wall": "2 mm",
    "web": "2 mm",
    "module_length": "10 mm",
}
THREE_CHAMBER = {
    "radius": "10 mm",
    "bore": "2 mm",
    "wall": "1.5 mm",
    "rib": "2 mm",
    "module_length": "10 mm",
}
TENDON_JOINT = {
    "module_length": "28 mm",
    "flexure_length": "5 mm",
    "flexure_thickness": "1 mm",
    "flexure_width": "20 mm",
    "tendon_offset": "6.6 mm",
    "tendon_setback": "11.15 mm",
    "link_height": "18 mm",
    "link_width": "20 mm",
    "link_density": "1290 kg/m^3",
    "closing_angle": "0.92 rad",
    "opening_angle": "0.02 rad",
}
EXAMPLE_MESH = str(Path(__file__).parent / "mesh_file" / "box.msh")
PNEUNET = {
    "module_length": "10 mm",
    "width": "15 mm",
    "height": "14 mm",
    "wall": "1.5 mm",
    "shell": "2 mm",
    "gap": "1 mm",
    "floor": "1.5 mm",
    "bridge": "1.5 mm",
    "channel_width": "2 mm",
    "channel_height": "1.5 mm",
    "layer": "1 mm",
}
WOUND_TUBE = {
    "module_length": "10 mm",
    "radius": "6 mm",
    "wall": "2.5 mm",
    "sleeve": "0.5 mm",
    "thread_angle": "86 deg",
    "thread_spacing": "2 mm",
    "thread_stiffness": "500 N",
    "sheet_angle": "50 deg",
}
