"""Checks of engines that follow histories (`HistoryBackend`), settle batches (`BatchBackend`), write files
(`ExportBackend`) or derive (`Capabilities.gradients`)."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from pliant.interfaces.physics import BatchBackend, Case, ExportBackend, HistoryBackend, Run, Variation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Inputs
from pliant.records.term import LawTerm
from pliant.testing import Subject, agree, require, require_refused
from pliant.testing.physics import (
    ANGLE_RAD,
    NO_GRAVITY,
    PAYLOAD_KG,
    POSITION_M,
    bent_chain,
    capable,
    needs,
    pressed,
    settled_under,
)
from pliant.testing.samples import PRESSURE_PA, chain_numbers, dashpot, linear_law, sample_chain

DIFFERENCE = 1e-3
SLOPE_SHARE = 2e-3
GAIN, STIFFNESS = 8e-7, 0.04
RETARDATION_S, STEP_S = 0.5, 0.01


def _softening(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    """Return the factor of a joint that softens after bending."""
    new[0] = max(old[0], angle)
    return 1.0 - c[0] * old[0]


def _sweep(specimen: str = "A") -> History:
    """Return a run up and down without a clock, under a small side load."""
    levels = PRESSURE_PA * np.array([0.2, 0.6, 1.0, 0.5])
    return History.from_arrays({"pressure_pa": levels}, specimen=specimen, tip_force_n=[0.004, 0.006, 0.0])


def _damaged() -> ChainModel:
    """Return joints with permanent memory of their largest angle."""
    term = LawTerm("elastic", _softening, (0.5,), n_states=1, keeps=True, needs_time=True)
    return sample_chain(modules=2).with_(terms=(term,))


def follows_settled_states(subject: Subject) -> None:
    """`follow` without times gives, sample by sample, what `settle` gives under the same inputs."""
    chain, history = bent_chain(payload=PAYLOAD_KG), _sweep()
    (path,), _ = capable(subject, HistoryBackend).follow(chain, [history])
    require(np.all(path.converged), "a plain chain with a small load did not converge")
    with subject.build().build(chain) as simulation:
        for k in range(len(history)):
            simulation.apply(history.at(k))
            finding = f"joint angles (rad) of sample {k + 1} without a clock"
            agree(path.joint_angles[k], simulation.settle().joint_angles, finding, atol=ANGLE_RAD / 10)


def follows_time(subject: Subject) -> None:
    """time passes in `follow`: a dashpot lets a joint creep as U (1 − exp(−t/T)) after a step."""
    term = LawTerm("moment", dashpot, (RETARDATION_S * STIFFNESS,), needs_time=True)
    chain = sample_chain(linear_law(GAIN, STIFFNESS), modules=1, gravity=NO_GRAVITY).with_(terms=(term,))
    time_s: Array = STEP_S * np.arange(101, dtype=float)
    history = History.from_arrays({"pressure_pa": np.where(time_s > 0, PRESSURE_PA, 0.0)}, time_s)
    (path,), _ = capable(subject, HistoryBackend).follow(chain, [history])
    end = GAIN * PRESSURE_PA / STIFFNESS
    finding = "u (rad) of a damped joint after a step of the pressure: rates, or durations of steps"
    creep = end * (1.0 - np.exp(-time_s / RETARDATION_S))
    agree(path.joint_angles[:, 0, 0], creep, finding, atol=0.02 * end)


def keeps_damage_in_its_specimen(subject: Subject) -> None:
    """damage persists in later runs of the same specimen, and in no other."""
    runs = [_sweep(specimen) for specimen in "ABA"]
    paths = [p.joint_angles for p in capable(subject, HistoryBackend).follow(_damaged(), runs)[0]]
    first, other, again = paths
    agree(other, first, "joint angles (rad) of a virgin specimen after another", atol=1e-9)
    differs = np.abs(again - first).max() > 10 * ANGLE_RAD
    require(differs, "the second run of a damaged specimen is that of a virgin one: `keeps` is ignored")


def differentiates(subject: Subject) -> None:
    """`towards` gives the change of every path to first order, damage of earlier runs included."""
    engine, chain, step = capable(subject, HistoryBackend), _damaged(), 1e-4

    def pressed_by(factor: float) -> tuple[History, ...]:
        return (_sweep().with_actuation(pressure_pa=factor * _sweep().actuation["pressure_pa"]),) * 2

    _, (change,) = engine.follow(chain, pressed_by(1.0), [Variation(chain, pressed_by(1.0 + step))])
    up, down = (engine.follow(chain, pressed_by(factor))[0] for factor in (1.01, 0.99))
    for number, (got, a, b) in enumerate(zip(change, up, down, strict=True), start=1):
        wanted = (a.joint_angles - b.joint_angles) / 0.02
        finding = f"d joint angles (rad) / d pressure factor in run {number}"
        agree(got.joint_angles / step, wanted, finding, rtol=0.01)


def follows_in_threads(subject: Subject) -> None:
    """`follow` gives the same result when called by several threads at once."""
    needs(subject, "threads")
    engine, shares = capable(subject, HistoryBackend), np.linspace(0.3, 1.0, 8)
    chains = [bent_chain(payload=share * PAYLOAD_KG) for share in shares]
    with ThreadPoolExecutor(len(shares)) as pool:
        found = list(pool.map(lambda chain: engine.follow(chain, [_sweep()])[0][0], chains))
    for share, chain, got in zip(shares, chains, found, strict=True):
        (alone,) = capable(subject, HistoryBackend).follow(chain, [_sweep()])[0]
        finding = f"joint angles (rad) with {share:.0%} of the payload, beside other threads"
        agree(got.joint_angles, alone.joint_angles, finding, atol=1e-12)


def names_missing_run_inputs(subject: Subject) -> None:
    """`follow` refuses a history without an input of the chain; the message names run and input."""
    lost = History.from_arrays({"tendon_force_n": np.ones(3)}, run="lost")
    engine, accepted = capable(subject, HistoryBackend), "a run without a pressure was followed"
    pattern = r"(?s)(?=.*lost).*pressure_pa"
    require_refused(
        lambda: engine.follow(sample_chain(modules=1), [lost]), accepted, pattern, "run and input"
    )


def batches_settle_as_one_by_one(subject: Subject) -> None:
    """`settle_batch` gives, case by case and in order, what `settle` gives; chains may differ in length."""
    chains = (sample_chain(modules=2), bent_chain(payload=PAYLOAD_KG), sample_chain(linear_law(), modules=3))
    cases = [
        Case(chain, pressed(share * PRESSURE_PA)) for chain, share in zip(chains, (0.4, 1, 1), strict=True)
    ]
    found = capable(subject, BatchBackend).settle_batch(cases)
    require(len(found) == len(cases), f"{len(cases)} cases gave {len(found)} equilibria")
    for number, (case, got) in enumerate(zip(cases, found, strict=True), start=1):
        alone = settled_under(subject, case.chain, case.inputs)
        require(got.converged == alone.converged, f"case {number} converges in one way only")
        of = f"of case {number} of a batch"
        agree(got.joint_angles, alone.joint_angles, f"joint angles (rad) {of}", atol=ANGLE_RAD)
        agree(got.markers_m, alone.markers_m, f"markers (m) {of}", atol=POSITION_M)


def batches_roll_as_one_by_one(subject: Subject) -> None:
    """`rollout_batch` simulates each history from rest, as `apply` and `step` do sample by sample."""
    time_s: Array = 0.02 * np.arange(4, dtype=float)
    rising, falling = (
        History.from_arrays({"pressure_pa": PRESSURE_PA * np.array(shares)}, time_s)
        for shares in ([0.0, 0.3, 0.6, 1.0], [1.0, 0.5, 0.2, 0.0])
    )
    engine, chain = subject.build(), sample_chain(modules=2)
    found = capable(subject, BatchBackend).rollout_batch([Run(chain, rising), Run(chain, falling)])
    require(len(found) == 2, f"2 runs gave {len(found)} rollouts")
    for got, history in zip(found, (rising, falling), strict=True):
        agree(got.time_s, time_s, "time_s of a rollout", atol=1e-12)
        with engine.build(chain) as simulation:
            for k in range(len(history)):
                simulation.apply(history.at(k))
                simulation.step(0.02 if k else 0.0)
                finding = f"markers (m) of sample {k + 1} of a rollout"
                agree(got.markers_m[k], simulation.markers(), finding, atol=POSITION_M)


def sensitivities_are_differences(subject: Subject) -> None:
    """`sensitivity` is the derivative of the settled answer with respect to inputs, loads and masses."""
    chain, force, moment = bent_chain(payload=PAYLOAD_KG), np.array([0.01, 0.02, 0.0]), 0.001
    with needs(subject, "gradients").build(chain) as simulation:
        simulation.apply(pressed(tip_force_n=force, moment_n_m=moment))
        simulation.settle()
        slopes = simulation.sensitivity()
    x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])

    def loaded(p: float = 0.0, fx: float = 0.0, m: float = 0.0) -> Inputs:
        return pressed(PRESSURE_PA + p, tip_force_n=force + fx * x, moment_n_m=moment + m)

    moved: tuple[tuple[str, tuple[int, ...], float, Callable[[float], tuple[ChainModel, Inputs]]], ...] = (
        ("pressure_pa", (), PRESSURE_PA, lambda d: (chain, loaded(p=d))),
        ("tip_force_n", (0,), 0.02, lambda d: (chain, loaded(fx=d))),
        ("moment_n_m", (), 0.01, lambda d: (chain, loaded(m=d))),
        ("payload_kg", (), 0.004, lambda d: (chain.with_(payload_kg=0.004 + d), loaded())),
        (
            "gravity_m_s2",
            (2,),
            9.81,
            lambda d: (chain.with_(gravity_m_s2=chain.gravity_m_s2 + d * z), loaded()),
        ),
    )
    for name, column, scale, make in moved:
        require(name in slopes.joint_angles, f"no derivative with respect to {name} is given")
        by = DIFFERENCE * scale
        up, down = (settled_under(subject, *make(d)) for d in (by, -by))
        for part in ("joint_angles", "markers_m"):
            got = getattr(slopes, part)[name][(..., *column)]
            wanted = (getattr(up, part) - getattr(down, part)) / (2 * by)
            agree(got, wanted, f"d {part} / d {name} against a central difference", rtol=SLOPE_SHARE)


def exports_a_file(subject: Subject) -> None:
    """`export` writes the requested file and names it first; engines without a format declare none."""
    engine, chain = capable(subject, ExportBackend), bent_chain(payload=PAYLOAD_KG)
    before = chain_numbers(chain)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"chain.{engine.export_format}"
        written = engine.export(chain, path)
        first = bool(written) and written[0] == path
        require(first, f"the files that it names are {written}, not {path} first")
        absent = ", ".join(str(file) for file in written if not file.is_file() or not file.stat().st_size)
        require(not absent, f"it names files that are missing or empty: {absent}")
        beside = all(file.is_relative_to(path.parent) for file in written)
        require(beside, "files are written elsewhere than beside it")
    require(np.array_equal(before, chain_numbers(chain)), "an array of the chain was changed in place")
