"""How long a study's straight chain is, before any law is made."""

from __future__ import annotations

from pliant.config.chain import ChainConfig, SegmentConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.pipeline.study import Design, segment_designs
from pliant.pipeline.workbench import Workbench


def chain_length_m(bench: Workbench, study: Study) -> float:
    """Length of the study's chain at rest, from its families or rods alone.

    Raises:
        UserError: no chain, or a module without a length.
        InvalidDesignError: a family that cannot be built.
    """
    chain: ChainConfig = study.need("chain", "a chain's length")
    segments = chain.as_segments()
    lengths = [
        None if design is None else _module_length_m(bench, chain, segment, design)
        for segment, design in zip(segments, segment_designs(study), strict=True)
    ]
    total, like = 0.0, next(length for length in lengths if length is not None)
    for segment, length in zip(segments, lengths, strict=True):
        like = length or like
        total += like * (segment.modules or 0) if segment.rigid is None else segment.rigid.along_m(like)
    return total


def _module_length_m(bench: Workbench, chain: ChainConfig, segment: SegmentConfig, design: Design) -> float:
    if design.family is not None:
        return float(bench.build("family", design.family).module_length_m)
    own = segment.module_length_m
    length = chain.module_length_m if own is None else own
    if length is None:
        raise UserError("a chain without a 'family' block needs 'chain.module_length', for example '11 mm'.")
    return length
