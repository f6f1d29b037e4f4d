"""Work of the efforts over closed paths in joint space: zero if efforts derive from an energy.

    python -m benchmarks.physics.closed_paths      prints, and writes benchmarks/out/physics_closed_paths.json

An engine's efforts are measured: the chain is put at a point of the path without velocity, weight or damping, one step
of `PULSE_S` is made, and M dq̇/dt, with the mass matrix M of the chain, is the effort that acted on the joints. The
figure therefore includes all operations of an engine between a law and its joints. The quasi-static engine has no
inertia: there the effort is the residual of its statics. In addition to the energy-consistent map, efforts are applied
as torques in the child's frame, as published.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from benchmarks.output import Bar, engine, known, write
from benchmarks.physics.helix import UnmappedLaw, helix, helix_law, inputs, sized_segments

from pliant.interfaces.simulation import Simulation, SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import JointLaw

BAR = 1e-6
MODULES = 4
PATHS = 3
POINTS = 1000
LARGEST_ANGLE_RAD = 0.5
PULSE_S = 1e-7
# Moments of inertia so large that the engines' floors under them vanish; efforts do not depend on them.
INERTIA_KG_M2 = 1e-3 * np.diag([1.0, 1.1, 1.2])
Efforts = Callable[[Array], Array]


def main() -> None:
    law = helix_law()
    laws: dict[str, JointLaw] = {"energy-consistent": law, "as published": UnmappedLaw(law, "child")}
    results: dict[str, dict[str, float]] = {}
    print(f"|work over a closed path| / peak elastic energy, largest of {PATHS} paths of {MODULES} joints")
    print(f"{'':14s}" + "".join(f"{name:>20}" for name in laws))
    energy = ChainStatics(weightless(law))

    def largest(name: str, chain: ChainModel) -> float:
        if name == "quasi-static":
            return max(leak(static_efforts(chain), energy, seed) for seed in range(PATHS))
        with engine(name, joint_damping=0.0).build(chain) as simulation:
            return max(leak(engine_efforts(simulation, chain), energy, seed) for seed in range(PATHS))

    for name in ("quasi-static", "mujoco", *(["pybullet"] if known("pybullet") else [])):
        results[name] = {kind: largest(name, weightless(effort_law)) for kind, effort_law in laws.items()}
        print(f"{name:14s}" + "".join(f"{value:20.1e}" for value in results[name].values()), flush=True)
    worst = max(row["energy-consistent"] for row in results.values())
    bar = Bar("work over closed paths by the peak elastic energy, worst engine", worst, BAR, "")
    write("physics_closed_paths", results, [bar])


def weightless(law: JointLaw) -> ChainModel:
    """Return four modules of the helix, one in each segment, without gravity."""
    chain = helix(law, sized_segments(MODULES))
    bodies = tuple(replace(body, inertia_kg_m2=INERTIA_KG_M2) for body in chain.bodies)
    return chain.with_(gravity_m_s2=np.zeros(3), bodies=bodies)


def static_efforts(chain: ChainModel) -> Efforts:
    """Return the efforts (n, a) at coordinates q (n, a) by the statics of the quasi-static engine."""
    statics, loads = ChainStatics(chain), Loads.from_inputs(chain, inputs(0.0))
    return lambda q: statics.residual(q, loads)


def engine_efforts(simulation: Simulation, chain: ChainModel) -> Efforts:
    """Return the efforts that act on the joints of a dynamics engine: M q̇ / h after one step h from rest."""

    def efforts(q: Array) -> Array:
        simulation.restore(SimulationState(0.0, q, np.zeros_like(q)))
        simulation.apply(inputs(0.0))
        simulation.step(PULSE_S)
        rates = simulation.snapshot().velocity
        return (mass_matrix(chain, q) @ rates.ravel() / PULSE_S).reshape(q.shape)

    return efforts


def leak(efforts: Efforts, energy: ChainStatics, seed: int, points: int = POINTS) -> float:
    """Return |∮ τ dq| over the largest elastic energy along a smooth closed path of three harmonics.

    The trapezoidal rule errs by O(1/points³), because of the kink in the slope of u|u|.
    """
    random = np.random.default_rng(seed)
    sine, cosine = random.normal(size=(3, MODULES, 3)), random.normal(size=(3, MODULES, 3))
    orders = np.arange(1, 4)[:, None]
    phases = orders * 2 * np.pi * np.arange(points) / points
    sines, cosines = np.sin(phases), np.cos(phases)
    path = np.einsum("ht,hna->tna", sines, sine) + np.einsum("ht,hna->tna", cosines, cosine)
    slope = np.einsum("ht,hna->tna", orders * cosines, sine)
    slope = slope - np.einsum("ht,hna->tna", orders * sines, cosine)
    size = LARGEST_ANGLE_RAD / np.abs(path).max()
    work = sum(np.sum(efforts(q) * dq) for q, dq in zip(size * path, size * slope, strict=True))
    peak = max(energy.efforts.potential(q, {"pressure_pa": 0.0}) for q in size * path)
    return float(abs(work) * 2 * np.pi / points / peak)


if __name__ == "__main__":
    main()
