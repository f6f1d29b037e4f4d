"""Modules of several chambers: laws of several pressures against direct FEM, engines under nine of them.

(a) Two opposed chambers: one law τ(p₁, p₂, u) against direct FEM at unseen pressures and moments, compared with a sum
of two laws of one chamber, with the elasticity in both and in one of them. (b) Three chambers: the law of three
pressures and three angles on states that no fit has seen, by the number of states. (c) Three segments of three
chambers, eight modules each, nine pressures, gravity and a force at the tip: engines, and the time of a cold
quasi-static solve. (d) and (e) The same two where the extension is a coordinate of the joint: three pressures, two
bends, twist, extension.

    python -m benchmarks.families.several_chambers [--quick]
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import Bar, make_parser, write

from pliant.config.chain import ChainConfig
from pliant.errors import PliantError
from pliant.execution.progress import Silent
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.fem import ModuleSolver
from pliant.interfaces.physics import Case
from pliant.pipeline.chain import Segment, build_chain, family_module
from pliant.pipeline.dataset import as_data, build_piece, module_problems
from pliant.pipeline.sampling.plan import sample
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.fem import FemDataset, FemState, ModuleData
from pliant.records.law import JointLaw
from pliant.records.rollout import Inputs
from pliant.registry.discovery import discover
from pliant_plugins.families.reference import THREE_CHAMBER, TWO_CHAMBER
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

MATERIAL = NeoHookean(
    NeoHookeanConfig.model_validate(
        {"kind": "neo_hookean", "shear_modulus": "240 kPa", "density": "1150 kg/m^3"}
    )
)
TOP_PA = 40e3
OF_TWO = {"pressure_max": TOP_PA, "max_states": 60, "check_states": 0}
OF_THREE = {"pressure_max": TOP_PA, "max_states": 96, "check_states": 24, "lateral_angle": 0.15}
UNSEEN, SEED = 24, 7
COUNTS = (32, 48, 64)  # of states to fit, in addition to all of them
MODULES, SEGMENTS = 8, 3
TIP_N = np.array([0.02, -0.01, 0.015])
REPEATS = 200
POLYNOMIAL = Polynomial(PolynomialConfig(kind="polynomial"))


def family(kind: str, design: dict[str, Any]) -> ActuatorFamily:
    """Return the shipped example of a family."""
    component = discover().get("family", kind)
    built: ActuatorFamily = component.build(component.config_model().model_validate({"kind": kind, **design}))
    return built


def solved(built: ActuatorFamily, fem: dict[str, Any]) -> tuple[ModuleData, ModuleSolver, dict[str, float]]:
    """Return the data of a family as in the FEM stage, the solver, wall and processor seconds."""
    config = SkfemConfig.model_validate({"kind": "skfem", **fem})
    backend, problems = Skfem(config), module_problems(built, 1)
    pieces = [build_piece(name, one, backend.checked_solver(one, MATERIAL)) for name, one in problems.items()]
    begun = (time.perf_counter(), time.process_time())
    with tempfile.TemporaryDirectory() as folder:
        found = sample(pieces, config, config.actuation_max(built.actuation), Path(folder), Silent())
    spent = {"wall_s": time.perf_counter() - begun[0], "cpu_s": time.process_time() - begun[1]}
    return as_data(built, problems, pieces, found), pieces[0].solver, spent


def two_chambers() -> tuple[dict[str, Any], list[Bar]]:
    """Run part (a)."""
    data, solver, spent = solved(family("two_chamber", TWO_CHAMBER), OF_TWO)
    checked = replace(data, role=np.where(np.arange(len(data)) % 12 == 5, "check", data.role))
    law = POLYNOMIAL.fit_module(checked).law
    size = float(np.ptp(data.tau))
    one, once = one_chamber(solver, float(np.abs(data.deformation).max())), []
    random, misses, apart = np.random.default_rng(SEED), [], []
    start = solver.rest()
    for p1, p2, share in random.uniform([0, 0, -1], [TOP_PA, TOP_PA, 1], (UNSEEN, 3)):
        levels, moment = np.array([p1, p2]), 0.3 * share * size
        state = loaded(solver, levels, moment, start)
        if state is None or not np.all(law.domain.excess(levels[None], state.deformation[None]) == 0):
            continue
        u = state.deformation[None]
        misses.append(float(law.evaluate(levels[None], u).tau[0, 0]) - moment)
        sides = [one.evaluate(np.array([p]), s * u).tau[0, 0] * s for p, s in ((p1, 1.0), (p2, -1.0))]
        rest = [one.evaluate(np.zeros(1), s * u).tau[0, 0] * s for s in (1.0, -1.0)]
        apart.append(float(sum(sides)) - moment)
        once.append(float(sum(sides) - sum(rest) / 2) - moment)
    scores = {
        name: {"worst": float(np.abs(m).max()) / size, "rms": float(np.sqrt(np.mean(np.square(m)))) / size}
        for name, m in (("law", misses), ("sum of two laws", apart), ("the same, elasticity once", once))
    }
    print(f"(a) two chambers, {len(data)} states, torque range {1e3 * size:.1f} mN·m, {len(misses)} unseen")
    for name, score in scores.items():
        print(f"    {name}: worst {100 * score['worst']:.3g} %, RMS {100 * score['rms']:.3g} % of the range")
    bar = Bar(
        "opposed chambers, worst at unseen (p₁, p₂, M) / torque range", 100 * scores["law"]["worst"], 0.5, "%"
    )
    return {"n_states": len(data), "n_unseen": len(misses), "range_n_m": size, **scores, **spent}, [bar]


def loaded(solver: ModuleSolver, levels: Array, moment: float, start: FemState) -> FemState | None:
    """Solve direct FEM under pressures and a moment; return None without an equilibrium."""
    try:
        return solver.loaded(levels, moment, solver.free(levels, start))
    except PliantError:
        return None


def one_chamber(solver: ModuleSolver, reach: float) -> JointLaw:
    """Return the law of the first chamber alone, the other at zero, over the same box."""
    rows, start = [], solver.rest()
    for p in np.linspace(0.0, TOP_PA, 5):
        for u in np.linspace(-reach, reach, 7):
            rows.append(solver.constrained(np.array([p, 0.0]), float(u), start))
    columns = {
        "actuation": [s.actuation[0] for s in rows],
        "angle_rad": [s.angle_rad for s in rows],
        "moment_n_m": [s.moment_n_m for s in rows],
        "dmoment_dp": [s.dtau_dp[0, 0] for s in rows],
        "dmoment_du": [s.dmoment_du for s in rows],
        "energy_j": [s.energy_j for s in rows],
        "travel": [s.travel[0] for s in rows],
    }
    n = len(rows)
    words = {"branch": np.full(n, "constrained"), "status": np.array([s.status for s in rows])}
    roles = np.where(np.arange(n) % 6 == 4, "check", "fit")
    arrays = {name: np.array(column, float) for name, column in columns.items()}
    design = family("two_chamber", TWO_CHAMBER).design
    return POLYNOMIAL.fit(FemDataset(design, "y", "pressure_pa", **arrays, **words, role=roles)).law


def three_chambers(design: dict[str, Any], fem: dict[str, Any]) -> tuple[dict[str, Any], JointLaw, list[Bar]]:
    """Run parts (b), (d)."""
    data, _, spent = solved(family("three_chamber", design), fem)
    what = "with extension" if design.get("extends") else "three chambers"
    fitted = np.flatnonzero(data.role == "fit")
    # Free states and corners come first, and span the box.
    rows = []
    for count in (*COUNTS, len(fitted)):
        if count > len(fitted):
            continue
        chosen = np.sort(np.concatenate([fitted[:count], np.flatnonzero(data.role == "check")]))
        begun = (time.perf_counter(), time.process_time())
        try:
            found = POLYNOMIAL.fit_module(data.rows(chosen))
        except PliantError as error:
            rows.append({"n_states": count, "cause": str(error)})
            continue
        cost = {"fit_wall_s": time.perf_counter() - begun[0], "fit_cpu_s": time.process_time() - begun[1]}
        details = found.report.details
        rows.append(
            {
                "n_states": count,
                "worst_of_range": found.report.worst_of_range,
                "left_out_rmse_of_range": details["left_out_rmse_of_range"],
                "degrees": [details["actuation_degree"], details["degree"]],
                "terms": details["terms"],
                "n_heldout": found.report.n_heldout,
                **cost,
            }
        )
    print(f"{what}: {len(data)} states in {spent['wall_s']:.0f} s ({spent['cpu_s']:.0f} s of processor)")
    for row in rows:
        print(
            "    " + ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items())
        )
    worst, cpu = 100 * rows[-1]["worst_of_range"], spent["cpu_s"] + rows[-1]["fit_cpu_s"]
    bars = [
        Bar(f"{what}, worst at states left out / range of its axis", worst, 1.0, "%"),
        Bar(f"{what}, processor time of a design, states and fit", cpu, 300.0, "s"),
    ]
    return {"rows": rows, **spent}, found.law, bars


def arm(law: JointLaw, design: dict[str, Any]) -> ChainModel:
    """Build a hanging chain of three segments of eight modules, each segment with three separate inputs."""
    built, segments = family("three_chamber", design), []
    for number in range(SEGMENTS):
        own = tuple(Actuator(f"pressure_{3 * number + k}_pa") for k in (1, 2, 3))
        segments.append(Segment(family_module(law, built, 1150.0), MODULES, actuators=own))
    return build_chain(ChainConfig(modules=MODULES), segments)


def engines(law: JointLaw, design: dict[str, Any]) -> tuple[dict[str, Any], list[Bar]]:
    """Run parts (c), (e)."""
    chain, what = arm(law, design), ", with extension" if design.get("extends") else ""
    shares = np.array([0.7, 0.1, 0.0, 0.0, 0.8, 0.3, 0.2, 0.0, 0.6])
    levels = {a.input: float(s) * TOP_PA for a, s in zip(chain.actuators, shares, strict=True)}
    case, registry, found = Case(chain, Inputs(levels, TIP_N)), discover(), {}
    for kind in ("quasistatic", "mujoco", "pybullet"):
        try:
            component = registry.get("physics", kind)
            backend = component.build(component.config_model()(kind=kind))
        except PliantError as error:
            print(f"    {kind}: {error}")
            continue
        if law.joint not in backend.capabilities.joints:
            print(f"    {kind}: has no {law.joint} joints")
            continue
        (one,) = backend.settle_batch([case])
        found[kind] = one
        if kind == "quasistatic":
            times = []
            for _ in range(REPEATS):
                with backend.build(chain) as simulation:
                    simulation.apply(case.inputs)
                    begun = time.perf_counter()
                    settled = simulation.settle()
                    times.append(time.perf_counter() - begun)
    first = found["quasistatic"]
    apart = {
        kind: 1e3 * float(np.linalg.norm(one.markers_m - first.markers_m, axis=1).max())
        for kind, one in found.items()
        if kind != "quasistatic"
    }
    milliseconds = 1e3 * float(np.median(times)), 1e3 * min(times)
    print(
        f"engines{what}: {chain.n_joints} joints, nine pressures: tip {np.round(1e3 * first.tip_m, 2)} mm, "
        f"apart {apart} mm"
    )
    print(
        f"    cold solve {milliseconds[0]:.3g} ms (median), {milliseconds[1]:.3g} ms (least) of {REPEATS}, "
        f"{settled.iterations} iterations, {len(first.outside_domain)} places outside the law's box"
    )
    bars = [
        Bar(f"engines{what}, farthest marker apart", max(apart.values(), default=0.0), 0.01, "mm"),
        Bar(f"cold quasi-static solve{what}, least of many", milliseconds[1], 1.0, "ms"),
    ]
    return {
        "apart_mm": apart,
        "cold_ms_median": milliseconds[0],
        "cold_ms_least": milliseconds[1],
        "converged": {kind: one.converged for kind, one in found.items()},
        "tip_m": first.tip_m.tolist(),
        "outside": len(first.outside_domain),
    }, bars


def main() -> None:
    quick = make_parser(__doc__, "half the states of (b) and (d)").parse_args().quick
    begun = time.perf_counter()
    two, bars = two_chambers()
    fem = {**OF_THREE, "max_states": 48, "check_states": 12} if quick else OF_THREE
    results: dict[str, Any] = {"two_chambers": two}
    for name, design in (("", THREE_CHAMBER), ("_extending", {**THREE_CHAMBER, "extends": True})):
        results[f"three_chambers{name}"], law, more = three_chambers(design, fem)
        results[f"engines{name}"], last = engines(law, design)
        bars += [*more, *last]
    write(
        "family_several_chambers",
        {**results, "wall_s": time.perf_counter() - begun},
        bars,
    )


if __name__ == "__main__":
    main()
