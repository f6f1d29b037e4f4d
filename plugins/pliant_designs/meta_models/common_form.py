"""Laws of many designs in one form, so that designs differ by a short vector of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from pliant.records.actuation import Levels
from pliant.records.design import Array
from pliant.records.law import Domain, JointKind, JointLaw, LawRecord
from pliant_designs.meta_model import DesignLaws
from pliant_designs.meta_models.common_form_scales import ParameterMap, Trends
from pliant_designs.meta_models.common_form_stable import StabilityGrid
from pliant_designs.records import Parameter
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis, Exponents
from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw
from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw, lower_terms, shifted

ARRAYS = ("centre", "directions", "reference", "solved", "extent", "margin", "spread")
PREFIX = "form_"
TRENDS = ("sizes", "edges")
TREND_PARTS = ("coefficients", "weights", "widths", "places")


@dataclass(frozen=True, eq=False)
class CommonForm:
    """Π(p, u; design) = E(s) Σ_t c_t x^{e_t0} Π_k v_k^{e_tk} with x = p / p_max and v_k = u_k / u_k(s).

    Of m > 1 actuations each has its x_j = a_j / a_j,max, and its exponent.

    The reaches u_k(s) and the energy E(s) are power laws of the design's parameters s, or near them, so that the
    coefficients vary little; they are c = centre + directions · z with the design's targets z (q,) in the order of
    their size: a principal-component basis of the fitted coefficients, scaled so that |Δz| is the root mean square of
    the effort's change, as a share of its mean size.

    Attributes:
        parameters: the map to scaled parameters.
        sizes: logarithms of reaches and energy over s.
        exponents: (t, m + k); centre: (t,); directions: (t, q).
        reference: (n, q) stable targets of the solved designs, at `solved` (n, d).
        edges: low and high v of the trusted states by axis, over s; extent: (k, 2) of all.
        margin: (k,) scaled stiffness at rest.
        spread: (q,) deviation of the targets over the solved designs.
        actuation: (2,) lowest and highest of the data; (m, 2) of several.
        details: details of the fit; not recorded.
    """

    parameters: ParameterMap
    sizes: Trends
    exponents: Exponents
    centre: Array
    directions: Array
    reference: Array
    solved: Array
    edges: Trends
    extent: Array
    margin: Array
    spread: Array
    actuation: Array
    axes: tuple[str, ...]
    main: int
    joint: JointKind
    actuation_name: str
    details: Mapping[str, Any] = field(default_factory=dict)
    _grid: StabilityGrid = field(init=False, repr=False)

    def __post_init__(self) -> None:
        box = np.vstack([self.scaled_actuation, self.extent])
        grid = StabilityGrid.from_box(self.exponents, box, self.main, self.margin)
        object.__setattr__(self, "_grid", grid.transformed(np.column_stack([self.centre, self.directions])))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the targets."""
        return tuple(f"component_{i + 1}" for i in range(self.directions.shape[1]))

    @property
    def largest_actuation(self) -> Levels:
        """p_max, the scale of the actuation; (m,) of several."""
        return np.abs(self.actuation).max(axis=-1)

    @property
    def scaled_actuation(self) -> Array:
        """`actuation` in its scale."""
        return np.asarray((self.actuation.T / self.largest_actuation).T)

    @cached_property
    def _lower(self) -> Exponents:
        return lower_terms(self.exponents)

    def sizes_at(self, places: Array) -> Array:
        """Return (m, k + 1) reach of each axis, and energy, at scaled parameters (m, d)."""
        return np.exp(self.sizes(places))

    def reach(self, values: Array) -> Array:
        """Return (m, k) reach of each axis of designs (m, d), rad or m."""
        return self.sizes_at(self.parameters(values))[:, :-1]

    def effort(self, values: Array) -> Array:
        """Return (m,) mean sizes of the main effort of designs (m, d), N·m or N: the size of one unit of |z|."""
        sizes = self.sizes_at(self.parameters(values))
        return sizes[:, -1] / sizes[:, self.main]

    def energy(self, values: Array) -> Array:
        """Return (m,) energy that scales the law of designs (m, d)."""
        return self.effort(values) * self.reach(values)[:, self.main]

    def domain(self, values: Array) -> Domain:
        """Return the box of a design (d,), where similar designs have trusted states."""
        place = self.parameters(values[None])
        return Domain(self.actuation, self._box(place) * self.sizes_at(place)[0, :-1, None])

    def law(self, values: Array, targets: Array) -> JointLaw:
        """Return the law of a design (d,) with targets (q,): stable, on the box of similar designs."""
        place = self.parameters(np.asarray(values, float)[None])
        sizes, box = self.sizes_at(place)[0], self._box(place)
        lifted = self._stable(place[0], np.asarray(targets, float), box)
        coefficients = sizes[-1] * (self.centre + self.directions @ lifted)
        reach = sizes[:-1]
        domain = Domain(self.actuation, box * reach[:, None])
        common = {"axes": self.axes, "joint": self.joint, "actuation_name": self.actuation_name}
        if np.ndim(self.actuation) > 1:
            maps = np.column_stack([domain.box.mean(axis=1), np.ptp(domain.box, axis=1) / 2])
            scale = np.concatenate([self.largest_actuation, reach])
            moved = shifted(coefficients, self.exponents, self._lower, maps / scale[:, None])
            return SeveralLaw(self._lower, moved, maps, domain, **common)  # type: ignore[arg-type]
        x_map, u_map = np.array([0.0, self.largest_actuation]), np.column_stack([np.zeros(len(reach)), reach])
        if len(self.axes) > 1:
            basis = EnergyBasis(self.exponents, x_map, u_map)
            return EnergyPolynomialLaw(basis, coefficients, domain, **common)  # type: ignore[arg-type]
        i, j = self.exponents.T
        table = np.zeros((i.max() + 1, j.max()))
        table[i, j - 1] = -coefficients * j / reach[0]
        return PolynomialLaw(table, x_map, u_map[0], domain, **common)  # type: ignore[arg-type]

    def _stable(self, place: Array, targets: Array, box: Array) -> Array:
        """Return targets with a stable law, moved as little as possible in the mean effort.

        Where no such targets are found near, moved toward those of the solved designs nearby.
        """
        keep = self._grid.inside(box)
        own = np.concatenate([[1.0], targets])
        if self._grid.stable(self._grid.at(own, keep)):
            return targets
        found = self._grid.nearest_targets(targets, keep)
        if found is not None:
            return found
        away = np.sum((self.solved - place) ** 2, axis=1)
        weights = np.exp(-2 * (away - away.min()))
        nearby = np.concatenate([[1.0], weights @ self.reference / weights.sum()])
        return self._grid.blended(own, nearby, keep)[1:]

    def _box(self, place: Array) -> Array:
        """Return (k, 2) scaled deformations of designs like one at (1, d)."""
        k = len(self.axes)
        found = self.edges(place).reshape(k, 2)
        return np.clip(found, self.extent[:, :1], self.extent[:, 1:])

    def record(self) -> tuple[dict[str, Any], dict[str, Array]]:
        """Return values and arrays from which `from_record` makes the same form; array names start with `form_`."""
        values = {
            "actuation": self.actuation.tolist(),
            "axes": list(self.axes),
            "main": self.main,
            "joint": self.joint,
            "actuation_name": self.actuation_name,
            "sizes_degree": self.sizes.degree,
            "edges_degree": self.edges.degree,
        }
        arrays = {name: np.asarray(getattr(self, name)) for name in ARRAYS}
        arrays |= {
            "exponents": self.exponents,
            "low": self.parameters.low,
            "high": self.parameters.high,
            "logarithmic": self.parameters.logarithmic,
        }
        for name in TRENDS:
            arrays |= {f"{name}_{part}": getattr(getattr(self, name), part) for part in TREND_PARTS}
        return values, {PREFIX + name: array for name, array in arrays.items()}

    @staticmethod
    def from_record(values: Mapping[str, Any], arrays: Mapping[str, Array]) -> CommonForm:
        """Return the form of a record."""

        def read(name: str) -> Array:
            return np.asarray(arrays[PREFIX + name], float)

        fields: dict[str, Any] = {
            "parameters": ParameterMap(
                read("low"), read("high"), np.asarray(arrays[PREFIX + "logarithmic"], bool)
            ),
            "exponents": np.asarray(arrays[PREFIX + "exponents"], np.int64),
            "actuation": np.asarray(values["actuation"], float),
            "axes": tuple(values["axes"]),
            "main": int(values["main"]),
            "joint": values["joint"],
            "actuation_name": str(values["actuation_name"]),
        }
        fields |= {name: read(name) for name in ARRAYS}
        for name in TRENDS:
            parts = (read(f"{name}_{part}") for part in TREND_PARTS)
            fields[name] = Trends(int(values[f"{name}_degree"]), *parts)
        return CommonForm(**fields)


@dataclass(frozen=True, eq=False)
class FormLaws(DesignLaws):
    """A fitted meta-model that rests on a common form; kinds add what gives a design's targets or energy."""

    names: tuple[str, ...]
    box: Array
    fixed: Mapping[str, Parameter]
    form: CommonForm

    def build_record(self, kind: str, arrays: Mapping[str, Array], **values: Any) -> LawRecord:
        """Return the record of a kind: its own arrays and values and the shared ones."""
        form, form_arrays = self.form.record()
        shared = {"names": list(self.names), "fixed": dict(self.fixed), "form": form}
        return LawRecord(kind, {**shared, **values}, {**form_arrays, **arrays, "box": self.box})

    @staticmethod
    def shared_fields(record: LawRecord) -> dict[str, Any]:
        """Return the attributes of this class from a record, by name."""
        values, arrays = record.values, record.arrays
        return {
            "names": tuple(values["names"]),
            "box": np.asarray(arrays["box"], float),
            "fixed": dict(values["fixed"]),
            "form": CommonForm.from_record(values["form"], arrays),
        }
