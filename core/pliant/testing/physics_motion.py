"""Checks of a `PhysicsBackend` that advances inertia (`Capabilities.dynamic`): a pendulum with a law.

One long module hangs with a payload at its tip, is bent a little by pressure, and is released. Small swings are those
of I q̈ + C q̇ + K q = 0 with K the stiffness of law and weight: samples of (q, q̇) at equidistant times follow one
matrix, whose eigenvalues exp((−δ ± iω) t) give the frequency √(δ² + ω²) = √(K/I) and the decay δ = C/(2I). An engine
may have its own damping, so that only the damping added by a law term is compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.config.chain import ChainConfig
from pliant.interfaces.physics import HistoryBackend
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.term import LawTerm
from pliant.testing import Subject, once, require
from pliant.testing.physics import capable, needs
from pliant.testing.samples import PRESSURE_PA, dashpot, linear_law

LENGTH_M, MASS_KG, PAYLOAD_KG = 0.4, 0.02, 0.1
STIFFNESS, BENT_RAD = 0.7, 0.05
SAMPLE_S, SAMPLES = 0.03, 24
FREQUENCY_SHARE, DAMPING_SHARE, GROWTH = 0.05, 0.1, 1e-3
RETARDATION_S = 0.02


@dataclass(frozen=True)
class Swing:
    """Motion of an engine's pendulum.

    Attributes:
        frequency_1_s: √(δ² + ω²).
        decay_1_s: δ.
        energies_j: (n,) kinetic and elastic energy of the samples.
        misfit: largest deviation of the samples from their own linear motion / the largest angle.
    """

    frequency_1_s: float
    decay_1_s: float
    energies_j: Array
    misfit: float


def pendulum(damped: bool) -> ChainModel:
    """Return one joint with a payload and, if damped, a dashpot of retardation time `RETARDATION_S`."""
    law = linear_law(gain=BENT_RAD * STIFFNESS / PRESSURE_PA, stiffness=STIFFNESS)
    module = rod_module(law, LENGTH_M, MASS_KG)
    chain = build_chain(
        ChainConfig.model_validate({"modules": 1, "payload": PAYLOAD_KG}), [Segment(module, 1, 0.0)]
    )
    if not damped:
        return chain
    term = LawTerm("moment", dashpot, (RETARDATION_S * STIFFNESS,), needs_time=True)
    return chain.with_(terms=(term,))


def hanging(chain: ChainModel) -> tuple[float, float]:
    """Return inertia (kg·m²) and stiffness (N·m/rad) of small swings."""
    rest = np.zeros((1, 1))
    loads = Loads.from_inputs(chain, Inputs({"pressure_pa": 0.0}))
    stiffness = float(ChainStatics(chain).balance(rest, loads).stiffness[0, 0])
    return float(mass_matrix(chain, rest)[0, 0]), stiffness


@once
def _swing(subject: Subject, damped: bool = False) -> Swing:
    """Release the pendulum in this engine and return its swing."""
    chain = pendulum(damped)
    inertia, stiffness = hanging(pendulum(False))
    scale = np.sqrt(inertia / stiffness)
    path = []
    with subject.build().build(chain) as simulation:
        simulation.apply(Inputs({"pressure_pa": PRESSURE_PA}))
        simulation.settle()
        simulation.apply(Inputs({"pressure_pa": 0.0}))
        for _ in range(SAMPLES):
            state = simulation.snapshot()
            path.append([state.position[0, 0], scale * state.velocity[0, 0]])
            simulation.step(SAMPLE_S)
    samples = np.array(path)
    largest = float(np.abs(samples[:, 0]).max())
    still = "let go, it stands where it comes to rest: no inertia carries it on. Is the engine quasi-static"
    crosses = largest > 0 and float(samples[1:, 0].min()) < -1e-3 * largest
    require(
        crosses, f"capabilities.dynamic is True, and a pendulum of {PAYLOAD_KG:g} kg does not swing: {still}?"
    )
    step = np.linalg.lstsq(samples[:-1], samples[1:], rcond=None)[0]
    misfit = float(np.abs(samples[1:] - samples[:-1] @ step).max()) / largest
    powers = np.log(np.linalg.eigvals(step).astype(complex)) / SAMPLE_S
    energies = 0.5 * stiffness * np.sum(samples**2, axis=1)
    decay = -float(powers.real.mean())
    return Swing(float(np.sqrt(np.abs(powers[0] * powers[1]))), decay, energies, misfit)


def swings_with_its_period(subject: Subject) -> None:
    """a pendulum with a law swings with √(K/I), of inertia, payload, weight and the law's stiffness."""
    needs(subject, "dynamic")
    inertia, stiffness = hanging(pendulum(False))
    swing, wanted = _swing(subject), float(np.sqrt(stiffness / inertia))
    linear = swing.misfit < FREQUENCY_SHARE
    require(linear, f"small swings are not those of a pendulum: samples leave it by {swing.misfit:.1%}")
    period, theirs = 2 * np.pi / wanted, 2 * np.pi / swing.frequency_1_s
    require(
        abs(theirs / period - 1) <= FREQUENCY_SHARE,
        f"the undamped period is {theirs:.4g} s, not 2π √(I/K) = {period:.4g} s: masses, inertia, the payload, gravity "
        "or the law's stiffness",
    )


def gains_no_energy(subject: Subject) -> None:
    """a released pendulum gains no energy: kinetic and elastic energy never rise, rates are those of angles."""
    needs(subject, "dynamic")
    swing = _swing(subject)
    highest = np.minimum.accumulate(swing.energies_j)
    rise = float((swing.energies_j - highest).max() / swing.energies_j[0])
    allowed = GROWTH + FREQUENCY_SHARE
    require(
        rise <= allowed,
        f"the pendulum's energy rises by {rise:.1%} of its first: the integrator adds energy, or `velocity` is not "
        "the rate of `position`",
    )
    require(swing.decay_1_s >= -GROWTH * swing.frequency_1_s, "the pendulum's swings grow")


def damps_as_the_law_says(subject: Subject) -> None:
    """a dashpot C among the law's terms makes swings decay faster by C/(2I)."""
    needs(subject, "dynamic")
    capable(subject, HistoryBackend)  # which a dashpot needs
    inertia, _ = hanging(pendulum(False))
    wanted = RETARDATION_S * STIFFNESS / (2 * inertia)
    more = _swing(subject, True).decay_1_s - _swing(subject).decay_1_s
    require(
        abs(more / wanted - 1) <= DAMPING_SHARE,
        f"a dashpot adds {more:.4g} 1/s to the decay, not C/(2I) = {wanted:.4g} 1/s: it is left out, counted twice or "
        "given another rate",
    )
