"""A fitted law with its report and its states: residuals, coverage of its error bars, slopes, cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.fem_tables.reading import holds_whole_states, read_module_table, read_table
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.mechanics.one_input import first_input_law
from pliant.pipeline.learning import learning_stage
from pliant.pipeline.residuals import Residuals, as_module_data, as_scored, module_from_axes
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import DEFAULT_SURROGATE
from pliant.pipeline.surrogate import LawStage, evaluations_per_second, study_law_beside
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.records.law import FitReport, JointLaw
from pliant.store.store import Artifact

# Keys of a report for published forms, and their titles on the page.
STUDY_FORMS = {
    "study_form": "the published form, least squares",
    "study_finite_differences": "the published form, its finite differences",
}
POINTS = 81  # points of a grid of slopes, along each side of the box
LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)


@dataclass(frozen=True, eq=False)
class ReportedLaw:
    """A law with the data of its page.

    Attributes:
        name: of the design, or of the surrogate where several are compared.
        kind: of the surrogate.
        report: errors on states left out.
        data: the states; those that the report scores have the role "check".
        wall_s: of the fit.
        learning: result of `pliant.pipeline.learning.learning_curve`, or None.
        source: origin of the states, in words.
        study_law: the published form on the same states, if the report has none.
        config: of the surrogate.
        artifacts: its inputs, for the page's provenance.
    """

    name: str
    kind: str
    law: JointLaw
    report: FitReport
    data: ModuleData
    wall_s: float
    learning: Mapping[str, Any] | None = None
    source: str = "FEM"
    study_law: JointLaw | None = None
    config: SurrogateConfig | None = None
    artifacts: tuple[Artifact, ...] = ()

    @cached_property
    def per_second(self) -> float:
        """Evaluations with slopes per second, measured on first access."""
        return evaluations_per_second(self.law)

    @cached_property
    def coverage(self) -> list[BandCoverage]:
        """The law's bands at its check states, all of them first, then by axis; empty without an error bar."""
        return _coverage(self)

    @cached_property
    def least_stable(self) -> float:
        """The largest slope of `least_stable`."""
        return least_stable(self.law)

    @cached_property
    def misses(self) -> Residuals:
        """The law's residuals, by state and axis."""
        return Residuals.from_law(self.data, self.law, ranges=self.ranges)

    @cached_property
    def ranges(self) -> Array | None:
        """(k,) range of each axis' effort as in the report, so that shares agree; None if the report has none."""
        if len(self.law.axes) == 1:
            return np.array([self.report.effort_range])
        found = [self.axis_details(axis).get("effort_range") for axis in self.law.axes]
        return np.array(found, float) if all(isinstance(one, float | int) for one in found) else None

    @cached_property
    def study_misses(self) -> dict[str, Residuals]:
        """The residuals of each published form at the same states, by its title."""
        box = np.vstack([self.law.domain.actuation, self.law.domain.deformation])
        found = {}
        for key, title in STUDY_FORMS.items():
            forms = self.study_forms(key)
            if len(forms) == len(self.explored):
                found[title] = Residuals.from_prediction(
                    self.data, self.law.axes, _efforts(forms, self.law.axes), box, ranges=self.ranges
                )
        if not found and self.study_law is not None and self.study_law.axes == self.law.axes:
            beside = self.study_law
            title = STUDY_FORMS["study_form"]
            found[title] = Residuals.from_prediction(
                self.data, beside.axes, lambda p, u: beside.evaluate(p, u).tau, box, ranges=self.ranges
            )
        return found

    @property
    def explored(self) -> tuple[str, ...]:
        """The explored axes of the law, the main one first."""
        return tuple(axis for axis in self.data.explored_axes() if axis in self.law.axes)

    def axis_details(self, axis: str) -> Mapping[str, Any]:
        """Return the report's details of one axis: its own if the axes were fitted one by one."""
        each = self.report.details.get("axes")
        if isinstance(each, Mapping):
            found = each.get(axis, {})
            return found if isinstance(found, Mapping) else {}
        return self.report.details if len(self.law.axes) == 1 else {}

    def study_forms(self, key: str) -> dict[str, Mapping[str, Any]]:
        """Return by axis the scores and parameters of one published form, where it could be fitted."""
        found = {}
        for axis in self.explored:
            form = self.axis_details(axis).get(key)
            if isinstance(form, Mapping) and "parameters" in form:
                found[axis] = form
        return found

    @property
    def fem_s(self) -> float:
        """Solver's seconds for the states; 0 if not known."""
        return float(np.nansum(self.data.wall_s))

    @property
    def solved(self) -> int:
        """Number of solved states; all of them if not known."""
        return int(np.sum((self.data.wall_s > 0) | (self.data.iterations > 0))) or len(self.data)


@dataclass(frozen=True, eq=False)
class BandCoverage:
    """The coverage of bands: stated `levels` (l,) against `covered` (l,) of n states.

    `half_width` and `missed` (n,) are the band of 90 % and the miss at each state, as shares of the range of the
    axis' effort; `effort_range` (n,) is that range, N·m or N.
    """

    label: str
    levels: Array
    covered: Array
    n: int
    half_width: Array = field(repr=False)
    missed: Array = field(repr=False)
    effort_range: Array = field(repr=False)

    def at(self, level: float) -> float:
        """Return the share covered at one of the levels."""
        return float(self.covered[int(np.argmin(np.abs(self.levels - level)))])


def _coverage(fitted: ReportedLaw) -> list[BandCoverage]:
    data, law, missed = fitted.data, fitted.law, fitted.misses
    part = missed.rows(missed.check)
    if not law.states_error or not len(part.state):
        return []
    columns = [data.axes.index(axis) for axis in law.axes]
    p, u = data.actuation[part.state], data.deformation[part.state][:, columns]
    widths = [law.band(p, u, level) for level in LEVELS]
    every, ranges = np.arange(len(part.state)), missed.ranges[part.axis]
    bands = np.array([w[every, part.axis] / ranges for w in widths if w is not None])
    several = len(law.axes) > 1
    groups = {"all axes" if several else "states left out": np.ones(len(every), bool)}
    if several:
        groups |= {f"axis {axis}": part.axis == k for k, axis in enumerate(law.axes)}
    found = []
    for label, rows in groups.items():
        if rows.any():
            covered = np.mean(part.share[rows] <= bands[:, rows], axis=1)
            own = (bands[LEVELS.index(0.9), rows], part.share[rows], ranges[rows])
            found.append(BandCoverage(label, np.array(LEVELS), covered, int(rows.sum()), *own))
    return found


def slope_grid(law: JointLaw, axis: str) -> tuple[Array, Array, Array]:
    """Return p (m,), u (m,) and ∂τ_axis/∂u_axis (m, m) over the law's box, the other axes at zero."""
    k = law.axes.index(axis)
    ends = (law.domain.actuation, law.domain.deformation[k])
    p, u = (np.linspace(float(low), float(high), POINTS) for low, high in ends)
    P, V = np.meshgrid(p, u, indexing="ij")
    deformation = np.zeros((P.size, len(law.axes)))
    deformation[:, k] = V.ravel()
    slopes = law.evaluate(P.ravel(), deformation).dtau_du[:, k, k]
    return p, u, slopes.reshape(P.shape)


def least_stable(law: JointLaw, count: int = 4000) -> float:
    """Return the largest eigenvalue of the symmetric part of ∂τ/∂u in the box; below 0 the joint is stable everywhere.

    It is searched at `count` random points and, axis by axis, on the grid of `slope_grid`; of several inputs only the
    first is varied (the fit's own report has the largest slope over the whole box).
    """
    law = first_input_law(law)
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    values = box[:, 0] + np.ptp(box, axis=1) * np.random.default_rng(0).random((count, len(box)))
    slopes = law.evaluate(values[:, 0], values[:, 1:]).dtau_du
    largest = float(np.linalg.eigvalsh((slopes + np.swapaxes(slopes, 1, 2)) / 2).max())
    return max(largest, *(float(slope_grid(law, axis)[2].max()) for axis in law.axes))


def _efforts(
    forms: Mapping[str, Mapping[str, Any]], axes: tuple[str, ...]
) -> Callable[[Array, Array], Array]:
    def predict(actuation: Array, u: Array) -> Array:
        tau = np.full(u.shape, np.nan)
        for axis, form in forms.items():
            k = axes.index(axis)
            tau[:, k] = study_form_effort(form, actuation, u[:, k])
        return tau

    return predict


def study_form_effort(form: Mapping[str, Any], actuation: Array, u: Array) -> Array:
    """Return τ = k_n p + (m_a p + b_a) u − (m_e u²/2 + b_e u); u|u| for u² where the form is odd."""
    k = form["parameters"]
    square = u * np.abs(u) if form.get("odd") else u**2
    p = actuation
    return np.asarray(k["k_n"] * p + (k["m_a"] * p + k["b_a"]) * u - (k["m_e"] * square / 2 + k["b_e"] * u))


def unstable_places(law: JointLaw) -> list[dict[str, Any]]:
    """Return the point of largest slope for each axis with ∂τ/∂u ≥ 0; the other axes are at rest.

    SI: actuation (Pa or N), deformation (rad or m), slope. Empty for a law without a finite domain.
    """
    if len(law.actuations) > 1:  # the fit's report has its largest slope
        return []
    if not all(np.all(np.isfinite(side)) for side in (law.domain.actuation, law.domain.deformation)):
        return []
    found = []
    for axis in law.axes:
        p, u, slopes = slope_grid(law, axis)
        i, j = np.unravel_index(int(np.argmax(slopes)), slopes.shape)
        if (slope := float(slopes[i, j])) >= 0:
            place = {"actuation": float(p[i]), "deformation": float(u[j])}
            found.append({"axis": axis, **place, "slope": slope})
    return found


def fitted_law(
    context: RunContext,
    name: str,
    config: SurrogateConfig,
    stage: LawStage,
    data: ModuleData | None = None,
    *,
    learning: bool = True,
    source: str = "FEM",
) -> ReportedLaw:
    """Return a law with the data of its document; with `learning` the surrogate is also fitted to parts of the states.

    Args:
        context: plugins and store.
        name: of the design, or of the surrogate where several are compared.
        config: of the surrogate.
        stage: the law.
        data: whole states of the module; by default those of the law's stage.
        learning: whether a learning curve is made.
        source: origin of the states, in words.

    Raises:
        UserError: the law is stated by coefficients, so there is no fit to report.
    """
    surrogate: Surrogate = context.build("surrogate", config)
    known = data is not None or stage.data is not None or bool(surrogate.tables())
    if stage.report is None or stage.artifact is None or not known:
        raise UserError(
            f"the law of '{name}' is stated by its coefficients: there is no fit, so leave out --out, or let "
            "'surrogate' fit FEM states or a table."
        )
    data = as_scored(_own_table_states(surrogate, stage) if data is None else data, stage.report)
    curve = None
    if learning and len(surrogate.tables()) <= 1 and len(data.actuations) == 1:
        curve = learning_stage(context, config, data, {"law": stage.artifact.key})
    details = stage.report.details
    own = "study_form" in details or any(
        "study_form" in axis for axis in dict(details.get("axes", {})).values()
    )
    return ReportedLaw(
        name,
        config.kind,
        stage.law,
        stage.report,
        data,
        float(stage.artifact.manifest["wall_s"]),
        curve.value if curve is not None else None,
        source,
        None if own else study_law_beside(context, data),
        config,
        (stage.artifact,) if curve is None else (stage.artifact, curve),
    )


def fitted_designs(
    context: RunContext, designs: Sequence[DesignStages], learning: bool = True
) -> list[ReportedLaw]:
    """Return the laws of a study's designs, named by number if there are several."""
    found = []
    for count, design in enumerate(designs, start=1):
        name = "the design" if len(designs) == 1 else f"design {count}"
        default = context.registry.get("surrogate", DEFAULT_SURROGATE)
        config: Any = design.design.surrogate or default.config_model()(kind=DEFAULT_SURROGATE)
        data = design.fem.value if design.fem is not None else None
        source = "FEM" if design.fem is not None else "the table"
        found.append(fitted_law(context, name, config, design.law, data, learning=learning, source=source))
    return found


def _own_table_states(surrogate: Surrogate, stage: LawStage) -> ModuleData:
    """Return the states of the config's own tables: one of one axis or of several, or one for each axis."""
    tables = surrogate.tables()
    path = tables.get("")
    if path is not None and holds_whole_states(path):
        return read_module_table(path)
    if tables and path is None:
        return module_from_axes({axis: read_table(one, axis) for axis, one in tables.items()}, stage.law.axes)
    assert stage.data is not None
    return as_module_data(stage.data)
