"""Small meta-model for checks and tests of the pipeline: one least-squares fit of an energy.

    Π(p, u; x) = Σ_jk c_jk p^a_j u^b_j ψ_k(x),  τ = −∂Π/∂u

with all terms up to degree 4 in u, those with p up to degree 2, and ψ the quadratic terms of the scaled parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import TRUSTED, IntArray
from pliant.records.law import Domain, JointKind, LawRecord
from pliant.testing.samples import EnergyLaw, slope_columns
from pliant_designs.meta_model import (
    DesignLaws,
    FittedMetaModel,
    MetaModel,
    MetaModelConfig,
    enough_designs,
)
from pliant_designs.records import Parameter, SolvedDesigns


def energy_powers(n_axes: int) -> IntArray:
    """Return (j, 1 + a) powers of p and of each u of the energy's terms."""
    found = [
        (a, *b)
        for a in (0, 1)
        for b in product(range(5), repeat=n_axes)
        if 1 <= sum(b) <= (2 if a else 4) and (a or sum(b) > 1)
    ]
    return np.array(found)


@dataclass(frozen=True, eq=False)
class StandInLaws(DesignLaws):
    """Coefficients `terms` (j, k), ranges of u `boxes` (2 a, k), and the inverse `spread` of ψᵀψ of the designs."""

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]
    terms: Array
    boxes: Array
    spread: Array
    top: float
    joint: JointKind
    axes: tuple[str, ...]
    actuation_name: str

    def law(self, values: Array) -> EnergyLaw:
        psi = design_columns(self.box, np.atleast_2d(values))[0]
        domain = Domain(np.array([0.0, self.top]), (self.boxes @ psi).reshape(-1, 2))
        powers = energy_powers(len(self.axes))
        terms = self.terms @ psi / self.top ** powers[:, 0]  # they were fitted in p / top
        return EnergyLaw(terms, powers, domain, self.joint, self.axes, self.actuation_name)

    def doubt(self, values: Array) -> Array:
        psi = design_columns(self.box, values)
        doubts: Array = np.sqrt(1 + np.einsum("ni,ij,nj->n", psi, self.spread, psi))
        return doubts

    def gain(self, candidates: Array, over: Array) -> Array | None:
        """Return the relative reduction of the mean variance by one more row of ψ (Fedorov 1972)."""
        at, all_of = design_columns(self.box, candidates), design_columns(self.box, over)
        across = all_of @ self.spread @ at.T
        own = np.einsum("ni,ij,nj->n", at, self.spread, at)
        before = np.einsum("ni,ij,nj->n", all_of, self.spread, all_of).mean()
        gains: Array = (across**2).mean(axis=0) / (1 + own) / before
        return gains

    def record(self) -> LawRecord:
        arrays = {name: getattr(self, name) for name in ("box", "terms", "boxes", "spread")}
        values = {name: value for name, value in vars(self).items() if name not in arrays}
        lists = {"names": list(self.names), "axes": list(self.axes), "fixed": dict(self.fixed)}
        return LawRecord("stand_in", {**values, **lists}, arrays)


def design_columns(box: Array, values: Array) -> Array:
    """Return (n, k) constant, linear and quadratic terms of parameters scaled to [−1, 1] on the box."""
    x = (np.asarray(values, float) - box.mean(axis=1)) / (np.ptp(box, axis=1) / 2)
    pairs = [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i + 1)]
    return np.stack([np.ones(len(x)), *x.T, *pairs], axis=1)


class StandInMetaModelConfig(MetaModelConfig):
    """Config of the stand-in meta-model, without settings."""

    kind: Literal["stand_in"] = "stand_in"


class StandInMetaModel(MetaModel):
    """Meta-model fitted to efforts only; slopes are not used."""

    config: StandInMetaModelConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        enough_designs(designs, self.fewest, self.config.kind)
        psi = design_columns(designs.box, designs.values)
        first = designs.data[0]
        top = max(float(one.actuation.max()) for one in designs.data)
        powers = energy_powers(len(first.axes))
        rows, efforts, boxes = [], [], []
        for one, own in zip(designs.data, psi, strict=True):
            keep = (one.role == "fit") & np.isin(one.status, TRUSTED)
            q, u = one.actuation[keep] / top, one.deformation[keep]
            boxes.append(np.stack([u.min(axis=0), u.max(axis=0)], axis=1).ravel())
            for k in range(u.shape[1]):
                columns = -slope_columns(powers, q, u, (k,))
                rows.append((columns[:, :, None] * own).reshape(len(q), -1))
                efforts.append(one.tau[keep, k])
        terms = np.linalg.lstsq(np.concatenate(rows), np.concatenate(efforts), rcond=1e-10)[0]
        ranges = np.asarray(np.linalg.lstsq(psi, np.stack(boxes), rcond=None)[0].T, float)
        spread = np.asarray(np.linalg.inv(psi.T @ psi + 1e-6 * np.eye(psi.shape[1])), float)
        laws = StandInLaws(
            designs.names,
            designs.box,
            dict(designs.fixed),
            terms.reshape(len(powers), -1),
            ranges,
            spread,
            top,
            first.joint,
            first.axes,
            first.actuation_name,
        )
        return FittedMetaModel(laws, {"designs": len(designs)})

    def load(self, record: LawRecord) -> DesignLaws:
        values: dict[str, Any] = {**record.values, **record.arrays}
        return StandInLaws(**values | {name: tuple(values[name]) for name in ("names", "axes")})
