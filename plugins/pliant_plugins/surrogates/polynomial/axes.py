"""The law of a spherical joint whose three axes do not affect each other: made, fitted, scored."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.design import Array
from pliant.records.error_bar import BarsOfAxes, ErrorBar
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, Effort, FitReport, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class AxesLaw(JointLaw):
    """τ_k(p, u) = law_k(p, u_k) for k = x, y, z, the components of the joint's rotation vector.

    It derives from the potential Σ Π_k(p, u_k). Its domain is the box of all three laws: their pressures in
    common, and each one's own angles. Its error bar is that of the laws that have one.

    Attributes:
        laws: one law for each of x, y, z, all of one kind, whose `scalar` function takes any number of axes.

    Raises:
        UserError: the laws take different inputs or have no actuation in common.
    """

    laws: tuple[JointLaw, JointLaw, JointLaw]
    axes: tuple[str, ...] = AXES
    joint: JointKind = "spherical"
    actuation_name: str = field(init=False)
    domain: Domain = field(init=False)
    error: ErrorBar | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        names = sorted({law.actuation_name for law in self.laws})
        if len(names) > 1:
            raise UserError(
                f"surrogate.axes: one joint has one actuation, and its axes take {' and '.join(names)}; give all of "
                "them the same 'actuation_name'."
            )
        boxes = np.array([law.domain.actuation for law in self.laws])
        common = np.array([boxes[:, 0].max(), boxes[:, 1].min()])
        if not common[0] < common[1]:
            ranges = ", ".join(f"{a} {low:g} to {high:g}" for a, (low, high) in zip(AXES, boxes, strict=True))
            raise UserError(f"the axes have no {names[0]} in common: {ranges}")
        deformation = np.concatenate([law.domain.deformation for law in self.laws])
        object.__setattr__(self, "actuation_name", names[0])
        object.__setattr__(self, "domain", Domain(common, deformation))
        bars = tuple(law.error for law in self.laws)
        if any(bar is not None for bar in bars):
            object.__setattr__(self, "error", BarsOfAxes(bars))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ (n, 3), ∂τ/∂p (n, 3) and the diagonal ∂τ/∂u (n, 3, 3) for deformation (n, 3)."""
        u = np.asarray(deformation, float)
        each = [law.evaluate(actuation, u[:, k : k + 1]) for k, law in enumerate(self.laws)]
        slopes = np.zeros((len(u), 3, 3))
        for k, effort in enumerate(each):
            slopes[:, k, k] = effort.dtau_du[:, 0, 0]
        return Effort(
            np.concatenate([effort.tau for effort in each], axis=1),
            np.concatenate([effort.dtau_dp for effort in each], axis=1),
            slopes,
        )

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) in J, shape (n,), in closed form."""
        u = np.asarray(deformation, float)
        return np.sum([law.potential(actuation, u[:, k : k + 1]) for k, law in enumerate(self.laws)], axis=0)

    def scalar(self) -> ScalarLaw:
        """Return the law as a scalar function for compiled engines."""
        each = [scalar for law in self.laws if (scalar := law.scalar()) is not None]
        parameters = np.concatenate([scalar.parameters for scalar in each])
        return ScalarLaw(each[0].function, parameters, each[0].shared)

    def record(self) -> LawRecord:
        """Return the records of the axes, their names led by the axis."""
        records = {axis: law.record() for axis, law in zip(AXES, self.laws, strict=True)}
        values = {
            "joint": self.joint,
            "axes": list(AXES),
            "actuation_name": self.actuation_name,
            "of_axes": {axis: dict(record.values) for axis, record in records.items()},
        }
        arrays = {
            f"{axis}_{name}": array
            for axis, record in records.items()
            for name, array in record.arrays.items()
        }
        return LawRecord(records[AXES[0]].kind, values, arrays)

    @staticmethod
    def from_record(
        record: LawRecord, of_axis: Callable[[LawRecord], JointLaw] = PolynomialLaw.from_record
    ) -> AxesLaw:
        """Return the law of a record, identical bit for bit, its axes' laws made by `of_axis`."""

        def one(axis: str) -> JointLaw:
            start = f"{axis}_"
            arrays = {k.removeprefix(start): v for k, v in record.arrays.items() if k.startswith(start)}
            return of_axis(LawRecord(record.kind, record.values["of_axes"][axis], arrays))

        return AxesLaw((one("x"), one("y"), one("z")))


class AxesSurrogate(Surrogate):
    """A surrogate whose config may have `axes`, each with a surrogate of the same kind (`axis_surrogates`)."""

    @abstractmethod
    def axis_surrogates(self) -> Mapping[str, Surrogate]:
        """Build the surrogates of the axes x, y, z; none if the config has no `axes`."""

    def tables(self) -> dict[str, Path]:
        """Return the table of the law, or of each axis that has one."""
        own = dict(super().tables())
        return own or {
            axis: path for axis, one in self.axis_surrogates().items() for path in one.tables().values()
        }

    def needs_fem(self) -> bool:
        """Return whether the law, or one of its axes, is neither stated nor has a table."""
        each = self.axis_surrogates().values()
        return any(one.needs_fem() for one in each) if each else super().needs_fem()

    def fit_axes(self, data: Mapping[str, FemDataset]) -> FittedLaw:
        """Return the law of one axis, or of three: each stated, fitted to its table, or to the FEM states.

        Where the FEM stage has three axes and the config does not name them, all are fitted alike.
        """
        if each := self.axis_surrogates():
            return fit_each(each, data)
        return self.fit(data[""]) if "" in data else fit_each(dict.fromkeys(AXES, self), data)


FEM = ""
# Keys of each axis's report that are merged; the others are under `axes`.
SCORES = ("n_fitted", "n_heldout", "rmse", "worst", "worst_of_range", "r2", "effort_range")


def axes_law(laws: Mapping[str, JointLaw | None]) -> AxesLaw:
    """Return the law of three axes from laws by axis."""
    x, y, z = (laws[axis] for axis in AXES)
    assert x is not None and y is not None and z is not None
    return AxesLaw((x, y, z))


def fit_each(axes: Mapping[str, Surrogate], data: Mapping[str, FemDataset]) -> FittedLaw:
    """State or fit each axis.

    Raises:
        UserError: the FEM states are of another axis, or an axis cannot be fitted; it is named.
    """
    laws: dict[str, JointLaw] = {}
    reports: dict[str, FitReport] = {}
    for axis, surrogate in axes.items():
        stated = surrogate.stated()
        if stated is not None:
            laws[axis] = stated
            continue
        try:
            fitted = surrogate.fit(_axis_data(axis, data))
        except UserError as error:
            raise UserError(f"axis {axis}: {error}") from None
        laws[axis], reports[axis] = fitted.law, fitted.report
    return FittedLaw(axes_law(laws), _together(reports))


def _axis_data(axis: str, data: Mapping[str, FemDataset]) -> FemDataset:
    """Return the axis's own table, whatever axis it names, or the FEM states of that axis."""
    if axis in data:
        return replace(data[axis], axis=axis)
    if FEM not in data:
        raise UserError(f"no states of axis {axis}: the data have {', '.join(sorted(data))}")
    if data[FEM].axis != axis:
        raise UserError(
            f"the FEM stage solves axis {data[FEM].axis} only: give 'data' or 'coefficients' for axis {axis}"
        )
    return data[FEM]


def _together(reports: Mapping[str, FitReport]) -> FitReport:
    """Combine errors over all states of all fitted axes; `worst_of_range` and `r2` are those of the worst axis."""
    each = list(reports.values())
    n = np.array([report.n_heldout for report in each])
    details: dict[str, Any] = {
        "form": " and ".join(f"{axis} {report.details['form']}" for axis, report in reports.items()),
        "held_out": "; ".join(f"{axis}: {report.details['held_out']}" for axis, report in reports.items()),
        "stated_axes": [axis for axis in AXES if axis not in reports],
        "stable": all(report.details["stable"] for report in each),
        "axes": {
            axis: {**{name: getattr(report, name) for name in SCORES}, **report.details}
            for axis, report in reports.items()
        },
    }
    return FitReport(
        n_fitted=sum(report.n_fitted for report in each),
        n_heldout=int(n.sum()),
        rmse=float(np.sqrt(np.sum(n * [report.rmse**2 for report in each]) / n.sum())),
        worst=max(report.worst for report in each),
        worst_of_range=max(report.worst_of_range for report in each),
        r2=min(report.r2 for report in each),
        effort_range=max(report.effort_range for report in each),
        details=details,
    )
