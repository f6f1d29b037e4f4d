"""Studies with a search for tests: a gripper's finger of four segments, without FEM."""

from pathlib import Path

from pliant.config.loading import load_study
from pliant.registry.discovery import discover
from pliant_search.problem.search_problem import SearchProblem

REGISTRY = discover()
BASE = """\
pliant: 1
name: searched
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 249 kPa, density: 1150 kg/m^3}
fem: {kind: skfem, pressure_max: 16 kPa}
chain:
  segments:
    - {modules: 5}
    - {modules: 5, rotation: 0.85, family: {average_radius: 6.1 mm}}
    - {modules: 6, rotation: 1.44}
    - {modules: 6, rotation: 2.45}
physics: mujoco
effects:
  - {kind: stiffness, factor: 1.1}
task: {kind: grasp, object: egg, extra_weights: 5, pressure: 15 kPa}
"""


def search_study(path: Path, search: str, base: str = BASE):
    """Return the study with a `search` block, written to a file and read."""
    file = path / "searched.yaml"
    file.write_text(
        base + "search:\n" + "\n".join("  " + line for line in search.strip().splitlines()) + "\n"
    )
    return load_study(file, REGISTRY)


def search_problem(path: Path, search: str, base: str = BASE) -> SearchProblem:
    """Return its problem."""
    return SearchProblem.from_study(search_study(path, search, base), REGISTRY)
