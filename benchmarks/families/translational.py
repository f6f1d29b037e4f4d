"""The translational bellow: extension of a whole module under pressure: python -m benchmarks.families.translational

The published figures are not among the reference files, so that this prints ours: r 5, R 8, t 1.5, l 10 mm at the
moduli that fit the bending bellow, on the default mesh and on one twice as fine. Writes
benchmarks/out/family_translational.json.
"""

from __future__ import annotations

import time
from typing import Any

from benchmarks.families.published_y import solver_of
from benchmarks.output import Bar, write

from pliant_plugins.families.bellow_translational.family import BellowTranslational, BellowTranslationalConfig
from pliant_plugins.manifest import EXTENDING

PRESSURES = (2e3, 4e3, 7.5e3, 10e3, 12.5e3, 15e3)
MODULI = (240e3, 240.5e3, 249e3)


def extensions(mu_pa: float, refinement: int = 1) -> dict[str, Any]:
    """Free extensions (m) by pressure, status at the last, stiffness and thrust area at rest."""
    family = BellowTranslational(BellowTranslationalConfig.model_validate(EXTENDING))
    solver = solver_of(family.problem(refinement), mu_pa)
    state = rest = solver.rest()
    found = {}
    for pressure in PRESSURES:
        state = solver.free(pressure, state)
        found[pressure] = state.angle_rad
    at_rest = {"stiffness_n_m": -rest.dmoment_du, "thrust_m2": rest.dmoment_dp}
    solved = {
        "shear_modulus_pa": mu_pa,
        "refinement": refinement,
        "extension_m": found,
        "status": state.status,
    }
    return solved | at_rest


def main() -> None:
    begun = time.perf_counter()
    print("    μ kPa  mesh  7.5 kPa  15 kPa (mm)  N/mm at rest  mm² at rest")
    rows = [extensions(mu) for mu in MODULI] + [extensions(MODULI[0], refinement=2)]
    for row in rows:
        at = row["extension_m"]
        print(
            f"    {row['shear_modulus_pa'] / 1e3:5.1f}  × {row['refinement']}   {1e3 * at[7.5e3]:7.4f}  "
            f"{1e3 * at[15e3]:7.4f}      {row['stiffness_n_m'] / 1e3:8.5f}     {1e6 * row['thrust_m2']:7.2f}   "
            f"{row['status']}"
        )
    coarse, fine = rows[0]["extension_m"][15e3], rows[-1]["extension_m"][15e3]
    bar = Bar("default mesh against twice as fine, 15 kPa", 100 * abs(coarse / fine - 1), 1.0, "%", True)
    write("family_translational", {"rows": rows, "wall_s": time.perf_counter() - begun}, [bar])


if __name__ == "__main__":
    main()
