"""The tendon joint against the published FEM: free branch fitted, constrained branch predicted.

    python -m benchmarks.families.tendon_joint [--refinement 2] [--sensitivity]

The joint's geometry is not published. Stated: the tendon's length between its holes at rest, 27.297 mm (published);
the flexure's length, thickness and width (assumed). Fitted, on the free branch alone: the tendon's offset and the
shear modulus. The free branch fixes ratios only (stiffness to arm, growth of the arm to the arm): the stated tendon
length gives the scale. Nothing is fitted on the constrained branch; but the length was chosen in the knowledge that a
flexure of about this length fits it, which is why `--sensitivity` prints other choices.

Prints the table and writes benchmarks/out/tendon_joint.json.

The published FEM of one tendon joint (Yao, Howard, Maiolino 2026, doi 10.1002/aisy.70406).

Observed in the data, without a model:
- M is linear in T at a held angle, M = T arm(θ) − S(θ), with S close to 0.095 N·m/rad · θ;
- past θ ≈ −0.02 rad the moment rises several times as steeply: a stop, which no model in this module includes (`lip`);
- four of the eight free points that have a constrained branch are 4 to 10 mrad below its limit for M → 0, the others
  within 0.3 mrad (`free_gaps`): the free branch has errors of up to 2 %;
- the last free point, 7.925 N, is beyond a second stop: dθ/dT falls from 0.157 to 0.088 rad/N before it.
"""

from __future__ import annotations

import sys
import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from benchmarks.families.published_y import free_curve, make_solver
from benchmarks.output import REFERENCE, make_parser, reference_table, write
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from pliant.interfaces.fem import StateNotConvergedError
from pliant_plugins.families.reference import TENDON_JOINT
from pliant_plugins.families.tendon_joint.family import TendonJoint, TendonJointConfig
from pliant_plugins.fem.skfem.backend import SkfemSolver

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
STOP_RAD = -0.02  # rows below are past the stop
FREE_TOP_N = 7.5  # free points up to here are fitted: all but the last
TENDON_AT_REST_M = 27.297e-3  # published, constant of the length of the tendon at a joint


@dataclass(frozen=True, eq=False)
class PublishedJoint:
    """Rows of the table, (n,) each; `free` marks those without external moment."""

    force_n: Array
    angle_rad: Array
    moment_n_m: Array

    @property
    def free(self) -> Mask:
        return self.moment_n_m == 0

    @property
    def fitted(self) -> Mask:
        """Free points before the second stop, rest aside."""
        return self.free & (self.force_n > 0) & (self.force_n <= FREE_TOP_N)

    @property
    def between_stops(self) -> Mask:
        """Constrained rows that the model describes."""
        return ~self.free & (self.angle_rad > STOP_RAD)

    @property
    def forces_n(self) -> Array:
        """Tendon forces of the constrained branches."""
        return np.unique(self.force_n[~self.free])

    def at_angle(self, angle_rad: float) -> tuple[float, float]:
        """Return (arm in m, S in N·m) at a fixed angle: the line M = T arm − S through the branches that reach it."""
        forces, moments = [], []
        for force in self.forces_n:
            rows = np.flatnonzero((self.force_n == force) & ~self.free)
            rows = rows[np.argsort(self.angle_rad[rows])]
            if self.angle_rad[rows[0]] <= angle_rad <= self.angle_rad[rows[-1]]:
                forces.append(force)
                moments.append(np.interp(angle_rad, self.angle_rad[rows], self.moment_n_m[rows]))
        arm, offset = np.polyfit(forces, moments, 1)
        return float(arm), -float(offset)

    def free_gaps(self) -> dict[str, float]:
        """Return the free angle less that of the force's constrained branch extrapolated to M = 0, rad, by force.

        The continuation is a parabola through eight rows; the first, which some of the free points share their
        error with, is left out.
        """
        gaps = {}
        for force in self.forces_n:
            rows = np.flatnonzero((self.force_n == force) & ~self.free)
            rows = rows[np.argsort(self.moment_n_m[rows])][1:9]
            at_zero = np.polyfit(self.moment_n_m[rows], self.angle_rad[rows], 2)[-1]
            free = self.angle_rad[self.free & (self.force_n == force)][0]
            gaps[f"{force:g}"] = float(free - at_zero)
        return gaps

    def lip(self) -> dict[str, float]:
        """Return M = T arm − S past the stop, and M between the stops extrapolated to the same angles.

        Links that meet on a lip at height d above the mid-plane turn about it and stretch the flexure: the arm
        grows by d, the stiffness from EI/c to EI/c + d² EA/c = (1 + 12 d²/t²) EI/c, which gives t.
        """
        past = ~self.free & (self.angle_rad < STOP_RAD)
        force_n, angle_rad = self.force_n[past], self.angle_rad[past]
        design = np.column_stack([force_n, -np.ones(past.sum()), -angle_rad, force_n * angle_rad])
        arm, _, stiffness, growth = np.linalg.lstsq(design, self.moment_n_m[past], rcond=None)[0]
        angle, force = float(angle_rad.mean()), float(force_n.mean())
        near = [self.at_angle(u) for u in (0.02, 0.1)]
        slope = (near[1][0] - near[0][0]) / 0.08
        elastic = (near[1][1] - near[0][1]) / 0.08
        rise = float(arm + growth * angle) - (near[0][0] + slope * (angle - 0.02))
        ratio = 1 + float(stiffness - growth * force - (elastic - slope * force)) / elastic
        thickness = rise * float(np.sqrt(12 / (ratio - 1)))
        return {"arm_rise_m": rise, "stiffness_ratio": ratio, "thickness_m": thickness}

    def error(self, predicted_n_m: Array, rows: Mask) -> float:
        """Return RMS of the moment's error over the RMS of the moment, over rows."""
        error = predicted_n_m[rows] - self.moment_n_m[rows]
        return float(np.linalg.norm(error) / np.linalg.norm(self.moment_n_m[rows]))


def published() -> PublishedJoint:
    """Return the table; exit with a message if it is absent."""
    table = reference_table("tendon_joint_fem.csv")
    if table is None:
        sys.exit(f"tendon_joint: the reference data are absent: {REFERENCE} (see docs: reference study)")
    return PublishedJoint(*(table[name] for name in ("tendon_force_n", "joint_angle_rad", "moment_n_m")))


OFFSETS_MM = (5.2, 8.2)  # where the offset is sought
STEEPEST_RAD = 1.05  # free curves are solved up to this value
ARM_ANGLES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)


@dataclass(frozen=True)
class Stated:
    """Stated values, which are not fitted."""

    flexure_length_m: float = 5e-3
    flexure_thickness_m: float = 1e-3
    tendon_at_rest_m: float = TENDON_AT_REST_M
    free_top_n: float = 7.5


@dataclass(frozen=True)
class FittedJoint:
    """Values fitted to the free branch; `rms_rad` is the error of its angles."""

    tendon_offset_m: float
    shear_modulus_pa: float
    rms_rad: float


class Joint:
    """Solvers of the joint with stated dimensions; states depend on T/μ alone, so one modulus serves all."""

    def __init__(self, stated: Stated, refinement: int) -> None:
        self.stated, self.refinement = stated, refinement
        self.unit_pa = 1e6
        # the modulus with about the published stiffness, so that forces are of the published size
        stiffness = -self.solver(6.5e-3).rest().dmoment_du
        self.unit_pa *= 0.095 / stiffness

    def family(self, offset_m: float) -> TendonJoint:
        stated = self.stated
        lengths = {
            "flexure_length": stated.flexure_length_m,
            "flexure_thickness": stated.flexure_thickness_m,
            "tendon_setback": (stated.tendon_at_rest_m - stated.flexure_length_m) / 2,
            "tendon_offset": offset_m,
        }
        return TendonJoint(TendonJointConfig.model_validate({**TENDON_JOINT, **lengths}))

    def solver(self, offset_m: float) -> SkfemSolver:
        problem = self.family(offset_m).problem(self.refinement)
        return make_solver(problem, self.unit_pa, tendon_force_max_n=8.0)

    def free_curve(self, offset_m: float) -> CubicHermiteSpline:
        """Return the free angle by T · unit/μ, from exact slopes; it ends before the joint snaps shut."""
        model = self.solver(offset_m)
        states = [model.rest()]
        for force in np.arange(1.0, 14.0):
            try:
                states.append(model.free(float(force), states[-1]))
            except StateNotConvergedError:
                break
            if states[-1].angle_rad > STEEPEST_RAD:
                break
        return free_curve(states)


def fit(joint: Joint, data: PublishedJoint) -> FittedJoint:
    """Fit offset and modulus to the free angle by least squares."""
    rows = data.fitted & (data.force_n <= joint.stated.free_top_n)
    force, angle = data.force_n[rows], data.angle_rad[rows]

    def modulus(offset_mm: float) -> tuple[float, float]:
        """Return the best modulus, in units, and its sum of squares."""
        curve = joint.free_curve(1e-3 * offset_mm)
        found = minimize_scalar(
            lambda m: float(np.sum((curve(np.minimum(force / m, curve.x[-1])) - angle) ** 2)),
            bounds=(0.6, 1.5),
            method="bounded",
            options={"xatol": 1e-6},
        )
        return float(found.x), float(found.fun)

    best = minimize_scalar(
        lambda mm: modulus(mm)[1], bounds=OFFSETS_MM, method="bounded", options={"xatol": 4e-3}
    )
    units, squares = modulus(best.x)
    return FittedJoint(1e-3 * float(best.x), units * joint.unit_pa, float(np.sqrt(squares / rows.sum())))


def predict(joint: Joint, fitted: FittedJoint, data: PublishedJoint) -> Array:
    """Predict moments (n,) at the constrained rows, NaN elsewhere."""
    model, units = joint.solver(fitted.tendon_offset_m), fitted.shear_modulus_pa / joint.unit_pa
    moments = np.full(len(data.force_n), np.nan)
    for force in data.forces_n:
        rows = np.flatnonzero((data.force_n == force) & ~data.free)
        state = model.rest()
        for row in rows[np.argsort(np.abs(data.angle_rad[rows]))]:
            state = model.constrained(force / units, float(data.angle_rad[row]), state)
            moments[row] = state.moment_n_m * units
    return moments


def errors(data: PublishedJoint, moments: Array) -> dict[str, Any]:
    """Return relative RMS by force and in all, over the rows between the stops and over all rows."""

    def by_force(rows: Mask) -> dict[str, float]:
        return {f"{f:g}": data.error(moments, rows & (data.force_n == f)) for f in data.forces_n}

    found: dict[str, Any] = {}
    for name, rows in (("between_stops", data.between_stops), ("all_rows", ~data.free)):
        found |= {name: data.error(moments, rows), f"{name}_by_force": by_force(rows)}
    return {**found, "rows_between_stops": int(data.between_stops.sum()), "rows": int((~data.free).sum())}


def arms(
    joint: Joint, fitted: FittedJoint, data: PublishedJoint, force_n: float = 4.0
) -> list[dict[str, float]]:
    """Return ∂M/∂T by angle: data, ours, our ∂travel/∂θ by differences, the arc's closed form, the published one."""
    model, units = joint.solver(fitted.tendon_offset_m), fitted.shear_modulus_pa / joint.unit_pa
    geometry = joint.family(fitted.tendon_offset_m).geometry
    state, rows, step = model.rest(), [], 2e-3
    for angle in ARM_ANGLES:
        state = model.constrained(force_n / units, angle, state)
        places = (angle + n * step for n in (-2, -1, 1, 2))
        t = [model.constrained(force_n / units, place, state).travel for place in places]
        slope = (8 * (t[2] - t[1]) - (t[3] - t[0])) / (12 * step)  # fourth order
        arm, stiffness = data.at_angle(angle)
        rows.append(
            {
                "angle_rad": angle,
                "data_m": arm,
                "ours_m": state.dmoment_dp,
                "travel_slope_m": slope,
                "arc_m": geometry.tendon_arm_m(angle),
                # −dL/dθ of the published L(θ) = −1.2698 θ² − 2.4933 θ + 27.297 mm
                "published_formula_m": (2.4933 + 2 * 1.2698 * angle) * 1e-3,
                "data_elastic_n_m": stiffness,
                "ours_elastic_n_m": state.dmoment_dp * force_n - state.moment_n_m * units,
            }
        )
    return rows


def convergence(stated: Stated, fitted: FittedJoint, finest: int) -> list[dict[str, float]]:
    """Return the free angle at 3 and 6 N and the moment at 6 N, θ = 0.2, by refinement, constants unchanged."""
    rows = []
    for refinement in range(1, finest + 1):
        joint = Joint(stated, refinement)
        joint.unit_pa = fitted.shear_modulus_pa
        model = joint.solver(fitted.tendon_offset_m)
        low = model.free(3.0, model.rest())
        high, held = model.free(6.0, low), model.constrained(6.0, 0.2, low)
        rows.append(
            {
                "refinement": refinement,
                "cells": len(model.problem.mesh.cells),
                "free_3_n": low.angle_rad,
                "free_6_n": high.angle_rad,
                "moment_6_n": held.moment_n_m,
                "seconds_per_state": (low.wall_s + high.wall_s + held.wall_s) / 3,
            }
        )
    return rows


def choices() -> dict[str, Stated]:
    """Return results for other stated values, one or two changed at a time."""
    usual = Stated()
    found = {"as stated": usual}
    for length in (3e-3, 4e-3, 6e-3, 8e-3):
        found[f"flexure_length {1e3 * length:g} mm"] = replace(usual, flexure_length_m=length)
    for thickness in (0.5e-3, 2e-3):
        found[f"flexure_thickness {1e3 * thickness:g} mm"] = replace(usual, flexure_thickness_m=thickness)
    found["tendon at rest 26.0 mm"] = replace(usual, tendon_at_rest_m=26e-3)
    for length in (3e-3, 4e-3, 5e-3, 6e-3):
        other = replace(usual, free_top_n=6.0, flexure_length_m=length)
        found[f"free branch to 6 N, {1e3 * length:g} mm"] = other
    return found


def study(stated: Stated, refinement: int, data: PublishedJoint) -> tuple[Joint, FittedJoint, dict[str, Any]]:
    """Fit and prediction with one choice of stated values."""
    joint = Joint(stated, refinement)
    fitted = fit(joint, data)
    return joint, fitted, errors(data, predict(joint, fitted, data))


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--refinement", type=int, default=1)
    parser.add_argument("--finest", type=int, default=3, help="largest refinement of the convergence table")
    parser.add_argument("--sensitivity", action="store_true", help="other stated values too (minutes)")
    options = parser.parse_args()
    data, begun = published(), time.perf_counter()

    joint, fitted, found = study(Stated(), options.refinement, data)
    table = arms(joint, fitted, data)
    meshes = convergence(Stated(), fitted, options.finest)
    print(
        f"fitted on the free branch: tendon_offset {1e3 * fitted.tendon_offset_m:.3f} mm, shear modulus "
        f"{fitted.shear_modulus_pa / 1e6:.3f} MPa; angles to {1e3 * fitted.rms_rad:.2f} mrad RMS"
    )
    gaps, lip = data.free_gaps(), data.lip()
    print(
        "the data's free points against their own constrained branches: "
        + ", ".join(f"{f} N {1e3 * gap:+.1f} mrad" for f, gap in gaps.items())
    )
    print(
        f"the data's own stop: arm +{1e3 * lip['arm_rise_m']:.2f} mm, stiffness × {lip['stiffness_ratio']:.1f}, as "
        f"of a lip on a flexure {1e3 * lip['thickness_m']:.2f} mm thick"
    )
    print("constrained branch, predicted: RMS error of M over RMS of M")
    for key, rows in (("between_stops", found["rows_between_stops"]), ("all_rows", found["rows"])):
        parts = ", ".join(f"{f} N {e:.2%}" for f, e in found[f"{key}_by_force"].items())
        print(f"  {key.replace('_', ' ')} ({rows} rows): {found[key]:.2%}; {parts}")
    print("  θ/rad   arm/mm: data   ours   dtravel/dθ  arc    formula   elastic moment/mN·m: data   ours")
    for row in table:
        angle, *arms_m, elastic, ours = row.values()
        cells = "".join(f"{1e3 * arm:9.4f}" for arm in arms_m)
        print(f"  {angle:5.2f} {cells}{1e3 * elastic:18.3f}{1e3 * ours:9.3f}")
    for row in meshes:
        print("  mesh: " + ", ".join(f"{k} {v:.6g}" for k, v in row.items()))
    others = {}
    if options.sensitivity:
        print("other stated values:      offset   μ/MPa  free RMS  between stops  worst force  all rows")
        for name, stated in choices().items():
            _, other, error = study(stated, 1, data)
            others[name] = {**asdict(stated), **asdict(other), **error}
            worst = max(error["between_stops_by_force"].values())
            print(
                f"  {name:28s} {1e3 * other.tendon_offset_m:5.3f} {other.shear_modulus_pa / 1e6:7.3f}  "
                f"{1e3 * other.rms_rad:5.2f} mrad  {error['between_stops']:8.2%} {worst:12.2%} "
                f"{error['all_rows']:12.2%}",
                flush=True,
            )
    write(
        "tendon_joint",
        {
            "stated": asdict(Stated()),
            "fitted": asdict(fitted),
            "refinement": options.refinement,
            "stop_of_the_data": lip,
            "gaps_of_the_free_points_rad": gaps,
            "prediction": found,
            "arms": table,
            "meshes": meshes,
            "other_stated_values": others,
            "wall_s": time.perf_counter() - begun,
        },
    )


if __name__ == "__main__":
    main()
