"""Random helical designs under random loads, for batches and for counting failures."""

from __future__ import annotations

import math

import numpy as np
from benchmarks.physics.helix import (
    G_M_S2,
    PRESSURE_PA,
    STATED_X,
    STATED_Z,
    SegmentSpec,
    helix_law,
)

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.interfaces.physics import Case
from pliant.pipeline.chain import Segment, build_chain, rigid_rod, rod_module
from pliant.records.law import Domain
from pliant.records.rollout import Inputs
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw
from pliant_plugins.surrogates.polynomial.study import study_law


def random_cases(count: int, seed: int = 0, modules: tuple[int, int] = (6, 60)) -> list[Case]:
    """Designs that differ in everything: number of modules, 1 to 6 segments, pose, law, pressure, tip load."""
    random = np.random.default_rng(seed)
    base = helix_law().laws[1]
    return [_case(random, base, modules) for _ in range(count)]


def _case(random: np.random.Generator, base: PolynomialLaw, modules: tuple[int, int]) -> Case:
    law = _law(random, base)
    specs = _segments(random, int(random.integers(*modules, endpoint=True)), int(random.integers(1, 7)))
    segments = [
        Segment(rod_module(law, s.length_m, s.mass_kg, s.radius_m), s.modules, s.rotation_rad) for s in specs
    ]
    segments.append(Segment(rigid_rod(float(random.uniform(0, 10e-3)) + 1e-3, 0.4e-3)))
    direction = random.normal(size=3)
    config = ChainConfig(modules=1, base=BaseConfig(direction=tuple(float(x) for x in direction)))
    force = np.array([0.0, 0.0, -G_M_S2 * random.choice([0.0, random.uniform(0.0, 0.06)])])
    return Case(build_chain(config, segments), Inputs({"pressure_pa": PRESSURE_PA * random.random()}, force))


def _segments(random: np.random.Generator, modules: int, segments: int) -> list[SegmentSpec]:
    counts = 1 + random.multinomial(modules - segments, np.full(segments, 1 / segments))
    length = float(random.uniform(4e-3, 6e-3))
    rotations = np.concatenate([[0.0], np.cumsum(random.uniform(-math.pi / 2, math.pi / 2, segments - 1))])
    mass = 0.88e-3 * length / 4.72e-3
    return [
        SegmentSpec(int(count), float(turn), length, mass, 5.7e-3)
        for count, turn in zip(counts, rotations, strict=True)
    ]


def _law(random: np.random.Generator, base: PolynomialLaw) -> AxesLaw:
    """The helix's laws, each axis between half and twice as stiff; y's push varies by a third."""
    stiff = np.exp(random.uniform(-math.log(2), math.log(2), 3))
    table = base.coefficients * stiff[1]
    table[1, 0] *= random.uniform(0.7, 1.3)
    y = PolynomialLaw(table, base.actuation_map, base.deformation_map, base.domain, base.odd, axes=("y",))
    everywhere = Domain.unbounded(1)
    x, z = (
        StudyCoefficients(k_n=0.0, m_a=0.0, m_e=stated.m_e * scale, b_e=stated.b_e * scale)
        for stated, scale in ((STATED_X, stiff[0]), (STATED_Z, stiff[2]))
    )
    return AxesLaw((study_law(x, True, everywhere, axis="x"), y, study_law(z, True, everywhere, axis="z")))
