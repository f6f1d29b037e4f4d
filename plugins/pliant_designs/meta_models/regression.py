"""`regression`: a common form whose numbers are regressed on the design's parameters by one of three regressors."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.law import JointLaw, LawRecord
from pliant_designs.meta_model import DesignLaws, FittedMetaModel, MetaModel, enough_designs
from pliant_designs.meta_models.common_form import FormLaws
from pliant_designs.meta_models.common_form_fit import fit_common_form
from pliant_designs.meta_models.common_form_scales import ParameterMap
from pliant_designs.meta_models.config import RegressionConfig
from pliant_designs.records import SolvedDesigns

DEGREES = (1, 2, 3, 4)
RIDGES = tuple(10.0**power for power in range(-9, 1, 2))
GAUSSIAN_WIDTHS = (0.5, 0.8, 1.2, 1.8, 2.7, 4.0)


@dataclass(frozen=True, eq=False)
class LinearSmoother:
    """z = centre + features(s) · weights: products of Legendre polynomials, or Gaussians about the solved designs.

    Attributes:
        kind: "polynomial" or "kernel_ridge".
        width: of the Gaussians.
        exponents: (f, d) degrees of the products.
        places: (n, d) centres of the Gaussians.
        centre: (q,); weights: (f, q) or (n, q).
    """

    kind: str
    width: float
    exponents: NDArray[np.int64]
    places: Array
    centre: Array
    weights: Array

    def mean(self, places: Array) -> Array:
        """Return (m, q) predicted targets at places (m, d)."""
        return self.centre + self.features(places) @ self.weights

    def features(self, places: Array) -> Array:
        """Return (m, f) features at places (m, d)."""
        if self.kind == "polynomial":
            return legendre_products(places, self.exponents)
        return gaussians(places, self.places, self.width)


def fit_polynomial(places: Array, targets: Array) -> tuple[LinearSmoother, Array]:
    """Choose degree and ridge by the leave-one-design-out error; return the fit and these errors (n, q)."""
    centre = targets.mean(axis=0)
    found = []
    for exponents in _degrees(places.shape[1], len(places)):
        x = legendre_products(places, exponents)
        degree = exponents.sum(axis=1).astype(float)
        for ridge in RIDGES:
            # High degrees are held more: they swing between the designs.
            gram = x.T @ x + ridge * len(x) * np.diag((1 + degree) ** 4)
            weights = np.linalg.solve(gram, x.T @ (targets - centre))
            hat = np.einsum("nf,fn->n", x, np.linalg.solve(gram, x.T))
            missed = (centre + x @ weights - targets) / np.maximum(1 - hat, 1e-6)[:, None]
            found.append((LinearSmoother("polynomial", 0.0, exponents, places[:0], centre, weights), missed))
    return min(found, key=lambda one: float(np.sum(one[1] ** 2)))


def fit_kernel_ridge(places: Array, targets: Array) -> tuple[LinearSmoother, Array]:
    """Choose width and ridge by the leave-one-design-out error; return the fit and these errors (n, q)."""
    centre = targets.mean(axis=0)
    none = np.zeros((0, places.shape[1]), np.int64)
    found = []
    for width in GAUSSIAN_WIDTHS:
        kernel = gaussians(places, places, width)
        for ridge in RIDGES:
            inverse = np.linalg.inv(kernel + ridge * np.eye(len(kernel)))
            weights = inverse @ (targets - centre)
            missed = -weights / np.diagonal(inverse)[:, None]
            found.append((LinearSmoother("kernel_ridge", width, none, places, centre, weights), missed))
    return min(found, key=lambda one: float(np.sum(one[1] ** 2)))


def gaussians(one: Array, two: Array, width: float) -> Array:
    """Return (m, n) exp(−|s − s'|² / (2 width²)) of places (m, d) and (n, d)."""
    apart = np.sum((one[:, None] - two[None]) ** 2, axis=2)
    return np.exp(-apart / (2 * width**2))


def legendre_products(places: Array, exponents: NDArray[np.int64]) -> Array:
    """Return (m, f) products of Legendre polynomials in each scaled parameter."""
    out = np.ones((len(places), len(exponents)))
    for i, degrees in enumerate(exponents.T):
        table = np.polynomial.legendre.legvander(places[:, i], int(degrees.max(initial=0)))
        out *= table[:, degrees]
    return out


def _degrees(d: int, designs: int) -> Iterator[NDArray[np.int64]]:
    """Yield products of total degree 1, 2 … while there are enough designs to determine them."""
    for degree in DEGREES:
        every = np.array([e for e in np.ndindex(*([degree + 1] * d)) if sum(e) <= degree], np.int64)
        if degree == 1 or len(every) < designs:
            yield every


# Bounds of the kernel's widths on the box [−1, 1] (narrower ones chase noise), of noise and of the plane's size.
WIDTHS = (1.0, 30.0)
NOISE = (1e-7, 0.5)
TREND = (1e-3, 1e3)
SEED = 0
LARGEST = 1e-10
# Noise below this share of the other sizes drowns posterior variances in rounding.
JITTER = 1e-7


@dataclass(frozen=True, eq=False)
class GaussianProcesses:
    """One process for each of q targets z, of n places s (n, d), with the kernel

        k(s, s') = a κ(r) + b (1 + s·s') + c δ,   r² = Σ_i (s_i − s'_i)² / ℓ_i²,

    κ = exp(−r²/2), or Matérn's (1 + √5 r + 5 r²/3) exp(−√5 r) where that explains the targets better. The second
    term is a plane of unknown slope; c is what the states left undetermined (Rasmussen and Williams, Gaussian
    Processes for Machine Learning, 2006, ch. 2, 4, 5).

    Attributes:
        places: (n, d); targets: (n, q).
        centre, scale: (q,) mean and deviation by which targets are standardised.
        widths: (q, d) ℓ; sizes: (q, 3) a, b, c; rough: (q,) whether κ is Matérn's.
    """

    places: Array
    targets: Array
    centre: Array
    scale: Array
    widths: Array
    sizes: Array
    rough: NDArray[np.bool_]
    _inverse: Array = field(init=False, repr=False)
    _dual: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.places)
        kernel = self.kernel(self.places, self.places) + self.sizes[:, 2, None, None] * np.eye(n)
        inverse = np.linalg.inv(kernel)
        object.__setattr__(self, "_inverse", (inverse + np.swapaxes(inverse, 1, 2)) / 2)
        standard = (self.targets - self.centre) / self.scale
        object.__setattr__(self, "_dual", np.einsum("tij,jt->ti", self._inverse, standard))

    @staticmethod
    def fit(places: Array, targets: Array) -> GaussianProcesses:
        """Fit widths and sizes by the largest marginal likelihood, from one fixed start (scikit-learn)."""
        centre, scale = targets.mean(axis=0), targets.std(axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        found = [_likeliest(places, column) for column in ((targets - centre) / scale).T]
        widths, sizes, rough = (np.array(part) for part in zip(*found, strict=True))
        return GaussianProcesses(places, targets, centre, scale, widths, sizes, rough.astype(bool))

    def kernel(self, one: Array, two: Array) -> Array:
        """Return (q, m, l) covariance of the standardised targets at places (m, d) and (l, d), without noise."""
        apart = (one[:, None] - two[None]) ** 2
        square = np.einsum("mld,td->tml", apart, self.widths**-2.0)
        found = np.exp(-square / 2)
        if self.rough.any():
            r = np.sqrt(5 * square[self.rough])
            found[self.rough] = (1 + r + r**2 / 3) * np.exp(-r)
        a, b = self.sizes[:, 0, None, None], self.sizes[:, 1, None, None]
        return a * found + b * (1 + one @ two.T)

    def mean(self, places: Array) -> Array:
        """Return (m, q) predicted targets at places (m, d)."""
        standard = np.einsum("tmi,ti->mt", self.kernel(places, self.places), self._dual)
        return self.centre + self.scale * standard

    def variance(self, places: Array) -> Array:
        """Return (m, q) variance of the targets at places (m, d), noise included, in the targets' units."""
        across = self.kernel(places, self.places)
        explained = np.einsum("tmi,tmi->mt", across @ self._inverse, across)
        prior = np.stack([np.diagonal(k) for k in self.kernel(places, places)], axis=1)
        return self.scale**2 * (np.maximum(prior - explained, 0.0) + self.sizes[:, 2])

    def left_out(self) -> Array:
        """Return (n, q) leave-one-design-out predictions minus targets (Rasmussen and Williams, eq. 5.12)."""
        own = np.diagonal(self._inverse, axis1=1, axis2=2)
        return -(self._dual / own).T * self.scale

    def gain(self, candidates: Array, over: Array) -> Array:
        """Return (m,) share of the squared error over places (k, d), all targets, that each candidate would remove.

        A target's variance at o falls by cov(o, c)² / (var(c) + noise), both given the solved designs (Cohn, Neural
        Networks 9, 1996; Sacks et al., Statistical Science 4, 1989); widths and sizes stay as they are.
        """
        to_c, to_o = self.kernel(candidates, self.places), self.kernel(over, self.places)
        solved = to_c @ self._inverse
        across = self.kernel(over, candidates) - to_o @ np.swapaxes(solved, 1, 2)
        prior = np.stack([np.diagonal(k) for k in self.kernel(candidates, candidates)])
        own = np.maximum(prior - np.einsum("tmi,tmi->tm", to_c, solved), 0.0) + self.sizes[:, 2, None]
        removed = np.einsum("t,tm->m", self.scale**2, np.sum(across**2, axis=1) / own)
        return np.clip(removed / max(float(self.variance(over).sum()), 1e-300), 0.0, 1.0)


def _likeliest(places: Array, column: Array) -> tuple[Array, Array, bool]:
    """Return widths (d,), sizes (3,) and whether Matérn's kernel is more likely than the other."""
    if not np.any(column):
        return np.full(places.shape[1], WIDTHS[1]), np.array([LARGEST, LARGEST, NOISE[0]]), False
    fits = [_fitted(places, column, rough) for rough in (False, True)]
    best = max(range(2), key=lambda i: (fits[i].log_marginal_likelihood_value_, -i))
    kernel = fits[best].kernel_
    stationary, plane, noise = kernel.k1.k1, kernel.k1.k2, kernel.k2
    widths = np.broadcast_to(stationary.k2.length_scale, places.shape[1]).astype(float)
    large, slope = stationary.k1.constant_value, plane.k1.constant_value
    sizes = np.array([large, slope, max(noise.noise_level, JITTER * (large + slope))])
    return widths, sizes, bool(best)


def _fitted(places: Array, column: Array, rough: bool) -> Any:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, Matern, WhiteKernel

    start = np.full(places.shape[1], 2.0)
    shape = Matern(start, WIDTHS, nu=2.5) if rough else RBF(start, WIDTHS)
    plane = ConstantKernel(1.0, TREND) * DotProduct(1.0, "fixed")
    kernel = ConstantKernel(1.0, TREND) * shape + plane + WhiteKernel(1e-3, NOISE)
    with warnings.catch_warnings():
        # Widths at their bounds are meant: a parameter without effect gets the widest.
        warnings.simplefilter("ignore")
        return GaussianProcessRegressor(kernel, alpha=0.0, random_state=SEED).fit(places, column)


KIND = "regression"
# Arrays of a record, and those that are no floating-point numbers.
INPUTS = ("low", "high", "logarithmic")
PROCESS = ("places", "targets", "centre", "scale", "widths", "sizes", "rough")
SMOOTHER = ("exponents", "places", "centre", "weights")
KINDS = {"logarithmic": bool, "rough": bool, "exponents": np.int64}


@dataclass(frozen=True, eq=False)
class RegressionLaws(FormLaws):
    """Targets of a common form as functions of the design's parameters.

    Attributes:
        inputs: the map to the regressor's scaled parameters.
        processes: Gaussian processes of the targets: the mean where no other regressor is given, always the doubt.
        smoother: the regressor that gives the mean instead.
    """

    inputs: ParameterMap
    processes: GaussianProcesses
    smoother: LinearSmoother | None = None

    def targets(self, values: Array) -> Array:
        """Return (m, q) targets of designs (m, d)."""
        places = self.inputs(np.asarray(values, float))
        return self.processes.mean(places) if self.smoother is None else self.smoother.mean(places)

    def law(self, values: Array) -> JointLaw:
        """Return the law of one design (d,), stable in its box."""
        return self.form.law(values, self.targets(np.asarray(values, float)[None])[0])

    def doubt(self, values: Array) -> Array:
        """Return (m,) deviation of the effort that the processes expect, as a share of its mean size."""
        variance = self.processes.variance(self.inputs(np.asarray(values, float)))
        return np.sqrt(variance.sum(axis=1))

    def gain(self, candidates: Array, over: Array) -> Array:
        """Return (m,) expected share of the mean squared error over `over` (k, d) that solving each would remove."""
        return self.processes.gain(
            self.inputs(np.asarray(candidates, float)), self.inputs(np.asarray(over, float))
        )

    def record(self) -> LawRecord:
        """Form, inputs, processes and regressor as numbers."""
        parts: dict[str, tuple[Any, tuple[str, ...]]] = {
            "inputs": (self.inputs, INPUTS),
            "process": (self.processes, PROCESS),
        }
        values: dict[str, Any] = {}
        if self.smoother is not None:
            values["smoother"] = {"kind": self.smoother.kind, "width": self.smoother.width}
            parts["smoother"] = (self.smoother, SMOOTHER)
        arrays = {
            f"{part}_{name}": getattr(owner, name) for part, (owner, names) in parts.items() for name in names
        }
        return self.build_record(KIND, arrays, **values)

    @staticmethod
    def from_record(record: LawRecord) -> RegressionLaws:
        """Return the model of a record; laws are identical bit for bit."""

        def read(part: str, names: tuple[str, ...]) -> dict[str, Any]:
            return {
                name: np.asarray(record.arrays[f"{part}_{name}"], KINDS.get(name, float)) for name in names
            }

        smoother = None
        if (told := record.values.get("smoother")) is not None:
            smoother = LinearSmoother(str(told["kind"]), float(told["width"]), **read("smoother", SMOOTHER))
        return RegressionLaws(
            **FormLaws.shared_fields(record),
            inputs=ParameterMap(**read("inputs", INPUTS)),
            processes=GaussianProcesses(**read("process", PROCESS)),
            smoother=smoother,
        )


class Regression(MetaModel):
    """Gaussian processes, kernel ridge or polynomials, whichever misses the efforts of left-out designs least."""

    several_actuations = True
    config: RegressionConfig

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        """Fit the common form of all designs, then every requested regressor; `auto` uses the best of them."""
        enough_designs(designs, self.fewest, KIND)
        form, targets = fit_common_form(designs)
        inputs = ParameterMap.from_designs(designs.values, self.config.inputs == "logarithm")
        places = inputs(designs.values)
        processes = GaussianProcesses.fit(places, targets)
        others = {
            "kernel_ridge": fit_kernel_ridge(places, targets),
            "polynomial": fit_polynomial(places, targets),
        }
        errors = {"gaussian_process": _size(processes.left_out())}
        errors |= {name: _size(missed) for name, (_, missed) in others.items()}
        chosen: str = self.config.regressor
        if chosen == "auto":
            chosen = min(errors, key=lambda name: errors[name])
        smoother = others[chosen][0] if chosen in others else None
        laws = RegressionLaws(
            designs.names, designs.box, dict(designs.fixed), form, inputs, processes, smoother
        )
        return FittedMetaModel(laws, {**form.details, "regressor": chosen, "left_out": errors})

    def load(self, record: LawRecord) -> DesignLaws:
        """Return the model of a record."""
        return RegressionLaws.from_record(record)


def _size(missed: Array) -> float:
    """Return root mean square of the effort's error, as a share of its mean size, over designs left out."""
    return float(np.sqrt(np.mean(np.sum(missed**2, axis=1))))
