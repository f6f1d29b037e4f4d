"""Every family by two finite-element codes: python -m benchmarks.families.second_solver [CASE ...]

skfem (27-node cells, dilatation averaged per cell; at refinement 1, as studies use it, and refined) against ngsolve
(Taylor–Hood of order 3, differentiated energies, its own Newton), which share nothing but the mesh of the family.

States: free at 1/3, 2/3 and all of the largest actuation; there also held at 0 and at half the free angle; the
helical bellow also, at a third of it, held on all three axes. The PneuNet has two materials, 10 : 1, and is solved by
CalculiX too where that is installed (20-node cells with reduced integration, its own assembly and Newton).
Differences are shares of the range: the largest free angle, the effort that holds the joint at 0. Bar: 0.5 % for the
refined cells, on three axes for those of refinement 1.

Prints the table and writes benchmarks/out/second_solver.json.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from benchmarks.output import parser_of, read, write

from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.fem import ModuleSolver
from pliant.records.fem import FemState
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.families.bellow_helical.family import BellowHelical, BellowHelicalConfig
from pliant_plugins.families.bellow_translational.family import BellowTranslational, BellowTranslationalConfig
from pliant_plugins.families.pneunet.family import Pneunet, PneunetConfig
from pliant_plugins.families.reference import EXTENDING, FINGER, HELIX_MODULE, PNEUNET, TENDON_JOINT
from pliant_plugins.families.tendon_joint.family import TendonJoint, TendonJointConfig
from pliant_plugins.fem.config import NgsolveConfig, SkfemConfig
from pliant_plugins.fem.ngsolve.backend import Ngsolve
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

BAR = 0.005
FREE = (1 / 3, 2 / 3, 1.0)
LATERAL_RAD = 0.06  # about x and z in the states of three axes


@dataclass(frozen=True)
class Case:
    """A family's example, its rubber's shear modulus (Pa), the largest actuation (Pa or N), the axes that move.

    `free` are the free states' shares of that actuation, the held states stand at the last; `refined` is the
    refinement of the finer cells; `regions` are moduli (Pa) by region.
    """

    family: ActuatorFamily
    modulus: float
    actuation: float
    axes: tuple[str, ...]
    free: tuple[float, ...] = FREE
    refined: int = 2
    regions: Mapping[str, float] = field(default_factory=dict)


def cases() -> dict[str, Case]:
    """The shipped families; moduli as their own benchmarks fit them."""
    bending = BellowBending(BellowBendingConfig.model_validate(FINGER))
    helical = BellowHelical(BellowHelicalConfig.model_validate(HELIX_MODULE))
    extending = BellowTranslational(BellowTranslationalConfig.model_validate(EXTENDING))
    chamber = Pneunet(PneunetConfig.model_validate(PNEUNET))
    tendon = TendonJoint(TendonJointConfig.model_validate(TENDON_JOINT))
    return {
        "bellow_bending": Case(bending, 248e3, 15e3, ("y",)),
        "bellow_helical": Case(helical, 237e3, 15e3, ("y",)),
        "bellow_translational": Case(extending, 240.5e3, 15e3, ("x",)),
        "tendon_joint": Case(tendon, 71.9e6, 8.0, ("y",)),
        "pneunet": Case(chamber, 200e3, 12e3, ("y",), regions={"layer": 2e6}),  # two materials, 10 : 1
        # the whole ring refined has 1920 cells: minutes for each state
        "bellow_helical_three_axes": Case(helical, 237e3, 15e3, ("x", "y", "z"), free=(1 / 3,), refined=1),
    }


def states_of(case: Case, model: ModuleSolver, half: float | None) -> dict[str, FemState]:
    """The case's states by name; `half` is the angle to hold, half the free one where it is None."""
    found: dict[str, FemState] = {}
    here = model.rest()
    for share in case.free:
        here = found[f"free {share:.2f}"] = model.free(share * case.actuation, here)
    middle = 0.5 * here.angle_rad if half is None else half
    if len(case.axes) == 1:
        found["held 0.5"] = model.constrained(here.actuation, middle, here)
        found["held 0"] = model.constrained(here.actuation, 0.0, found["held 0.5"])
        return found
    turned = {**dict.fromkeys(case.axes, LATERAL_RAD), case.family.main_axis: middle}
    found["held 0.5, lateral"] = model.constrained(here.actuation, turned, here)
    found["held 0"] = model.constrained(here.actuation, dict.fromkeys(case.axes, 0.0), here)
    return found


def compare(
    case: Case, truth: dict[str, FemState], other: dict[str, FemState]
) -> dict[str, dict[str, float]]:
    """Differences of u and τ by state, as shares of the range; slopes as shares of the largest."""
    turn = max(abs(s.angle_rad) for s in truth.values())
    effort = float(np.abs(truth["held 0"].tau).max())
    rows = {}
    for name, a in truth.items():
        b = other[name]
        rows[name] = {
            "u": float(np.abs(b.deformation - a.deformation).max() / turn),
            "tau": float(np.abs(b.tau - a.tau).max() / effort),
            "dtau_du": float(np.abs(b.dtau_du - a.dtau_du).max() / np.abs(a.dtau_du).max()),
            "energy": abs(b.energy_j / a.energy_j - 1),
        }
    return rows


def rubber(modulus_pa: float) -> NeoHookean:
    """A neo-Hookean rubber at its default ν."""
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=modulus_pa))


def calculix() -> Any:
    """CalculiX of contrib/pliant-calculix, or None where the package or its program is not installed."""
    try:
        from pliant_calculix.backend import Calculix
        from pliant_calculix.config import CalculixConfig
    except ImportError:
        return None
    return Calculix(CalculixConfig()) if shutil.which("ccx") else None


def run(name: str, case: Case) -> dict[str, Any]:
    """Solve one case by every code and print its table."""
    wanted = {"ngsolve": 1, "skfem × 1": 1}
    if case.refined > 1:
        wanted[f"skfem × {case.refined}"] = case.refined
    solved, seconds, half = {}, {}, None
    limits = {"pressure_max_pa": 15e3, "tendon_force_max_n": 8.0}
    material = rubber(case.modulus).with_regions({name: rubber(mu) for name, mu in case.regions.items()})
    if case.regions and calculix() is not None:
        wanted["calculix × 2"] = 2
    for label, refinement in wanted.items():
        backend: Any = Skfem(SkfemConfig(**limits))
        if label == "ngsolve":
            backend = Ngsolve(NgsolveConfig(order=3, **limits))
        elif label.startswith("calculix"):
            backend = calculix()
        begun = time.perf_counter()
        solver = backend.solver(case.family.problem(refinement, case.axes), material)
        solved[label] = states_of(case, solver, half)
        seconds[label] = time.perf_counter() - begun
        half = 0.5 * solved["ngsolve"][f"free {case.free[-1]:.2f}"].angle_rad
    truth = solved.pop("ngsolve")
    differences = {label: compare(case, truth, states) for label, states in solved.items()}
    print(f"{name}: {len(truth)} states, " + ", ".join(f"{k} {s:.0f} s" for k, s in seconds.items()))
    for state, a in truth.items():
        apart = {label: rows[state] for label, rows in differences.items()}
        cells = (
            f"{label}: Δu {d['u']:.3%}  Δτ {d['tau']:.3%}  Δ∂τ/∂u {d['dtau_du']:.2%}"
            for label, d in apart.items()
        )
        print(f"  {state:18s} u {a.angle_rad:.6g}  τ {a.moment_n_m:.6g}  {'   '.join(cells)}", flush=True)
    judged = [label for label in differences if label != "skfem × 1" or case.refined == 1]
    each = {label: max(max(r["u"], r["tau"]) for r in differences[label].values()) for label in judged}
    worst = max(each.values())
    for label, far in each.items():
        verdict = "met" if far <= BAR else "missed"
        print(f"  worst of {label}: {far:.3%} of the range, bar {BAR:.1%}: {verdict}")
    states = {
        name: {"u": s.deformation.tolist(), "tau": s.tau.tolist(), "energy_j": s.energy_j, "status": s.status}
        for name, s in truth.items()
    }
    found = {"worst_of_range": worst, "met": worst <= BAR, "wall_s": seconds}
    stated = {"modulus_pa": case.modulus, "actuation": case.actuation}
    return {**stated, "states": states, "differences": differences, **found}


def main() -> None:
    known = cases()
    parser = parser_of(__doc__)
    parser.add_argument("cases", nargs="*", help=f"of {', '.join(known)}; by default all")
    chosen = parser.parse_args().cases or list(known)
    if unknown := [name for name in chosen if name not in known]:
        parser.error(f"unknown case '{unknown[0]}'; known: {', '.join(known)}")
    for name in chosen:
        done = read("second_solver").get("cases", {})
        write("second_solver", {"bar": BAR, "cases": {**done, name: run(name, known[name])}})


if __name__ == "__main__":
    main()
