"""`pliant fit TABLE.csv`: anybody's states become a law with error bars, and a study that uses it."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.cli import summaries
from pliant.cli.session import Session, check_writable, plain
from pliant.errors import MissingDependencyError, UserError
from pliant.formatting import actuation_unit, deformation_unit, effort_unit, number, unit_of
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.pipeline.study import Design, DesignStages
from pliant.pipeline.surrogate import law_stage
from pliant.pipeline.workbench import Workbench
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.report.fit_stage import fit_report_stage, piece_of
from pliant.store.store import write_atomically

LEVEL = 0.9
GRID = 41  # places per coordinate at which the law's stability is looked at
STUDY, RESULT = "study.yaml", "fit.json"


@dataclass(frozen=True)
class Scores:
    """What is told of one law.

    Attributes:
        stages: the law and what it came from.
        covered: share of the states left out that lie in the 90 % band; None where the law states no band.
        half_width: median half-width of that band there, in the effort's unit.
        unstable: places of the domain with ∂τ/∂u ≥ 0 as (actuation, u, slope); the worst of each axis.
        wall_s: of the fit.
    """

    stages: DesignStages
    covered: float | None
    half_width: float | None
    unstable: tuple[tuple[str, float, float, float], ...]
    wall_s: float

    @property
    def law(self) -> JointLaw:
        """The law."""
        return self.stages.law.law


def fit_table(
    here: Session,
    source: Path,
    kind: str,
    compare: bool,
    out: Path | None,
    store: Path,
    learning: bool = True,
) -> None:
    """Fit, print, and write what was asked for. Raises `UserError` for whatever is wrong with the table."""
    if out is not None:
        _check_free(source, kind, out)
        check_writable(out)
    bench = here.bench(store)
    try:
        scores = _scored(bench, source, kind)
    except UserError:
        if out is not None and not any(out.iterdir()):
            out.rmdir()
        raise
    here.result.update(_result(source, scores))
    for line in _lines(source, scores):
        here.say(line)
    known = {kind: scores}
    if compare:
        others = [k for k in here.registry.kinds("surrogate") if k != kind]
        _compare(here, bench, source, known, others)
    if out is not None:
        _write(here, source, kind, scores, out)
        _page(here, bench, source, known, out, learning)


def _scored(bench: Workbench, source: Path, kind: str) -> Scores:
    config = (
        bench.registry.get("surrogate", kind).config_model().model_validate({"kind": kind, "data": source})
    )
    assert isinstance(config, SurrogateConfig)
    started = time.perf_counter()
    stage = law_stage(bench, config, None)
    wall = stage.artifact.manifest["wall_s"] if stage.artifact else time.perf_counter() - started
    covered, width = _band(stage.law, stage.report.details if stage.report else {})
    return Scores(DesignStages(Design(None, config), None, stage), covered, width, _unstable(stage.law), wall)


def _band(law: JointLaw, details: Any) -> tuple[float | None, float | None]:
    """Share of the states left out in the band, and its median half-width there, over all axes with residuals."""
    of_axes = details.get("axes") or {law.axes[0]: details}
    inside: list[Array] = []
    widths: list[Array] = []
    for index, axis in enumerate(law.axes):
        found = of_axes.get(axis, {}).get("residuals")
        if not found:
            continue
        p, u = np.array(found["actuation"]), np.zeros((len(found["actuation"]), len(law.axes)))
        u[:, index] = found["angle_rad"]
        half = law.band(p, u, LEVEL)
        if half is None:
            continue
        moment = np.array(found["moment_n_m"])
        missed = np.abs(np.array(found["predicted_n_m"]) - moment)
        inside.append(missed <= half[:, index])
        widths.append(half[:, index])
    if not inside:
        return None, None
    return float(np.mean(np.concatenate(inside))), float(np.median(np.concatenate(widths)))


def _unstable(law: JointLaw) -> tuple[tuple[str, float, float, float], ...]:
    """For each axis along which the effort rises, where it rises most; the other axes at rest."""
    if not all(np.all(np.isfinite(side)) for side in (law.domain.actuation, law.domain.deformation)):
        return ()
    found = []
    pressures = _levels(law.domain.actuation)
    for index, axis in enumerate(law.axes):
        p, along = (g.ravel() for g in np.meshgrid(pressures, _levels(law.domain.deformation[index])))
        u = np.zeros((len(p), len(law.axes)))
        u[:, index] = along
        slopes = law.evaluate(p, u).dtau_du[:, index, index]
        worst = int(np.argmax(slopes))
        if slopes[worst] >= 0:
            found.append((axis, float(p[worst]), float(along[worst]), float(slopes[worst])))
    return tuple(found)


def _levels(limits: Array) -> Array:
    return np.linspace(float(limits[0]), float(limits[1]), GRID)


def _result(source: Path, scores: Scores) -> dict[str, Any]:
    return {
        "data": str(source),
        **summaries.fit(scores.stages),
        "band": {"level": LEVEL, "covered": scores.covered, "median_half_width": scores.half_width},
        "unstable": [
            dict(zip(("axis", "actuation", "deformation", "slope"), place, strict=True))
            for place in scores.unstable
        ],
    }


def _lines(source: Path, scores: Scores) -> list[str]:
    law, report = scores.law, scores.stages.law.report
    assert report is not None
    effort, u_unit, p_unit = effort_unit(law), deformation_unit(law), actuation_unit(law.actuation_name)
    lines = [
        f"table    {source}: {report.n_fitted + report.n_heldout} states, {_actuation(law)}",
        *(f"         {axis}: {_deformation(law, k)}" for k, axis in enumerate(law.axes)),
        *summaries.fit_lines(scores.stages),
    ]
    if scores.covered is None or scores.half_width is None:
        lines.append("band     this law states none")
    else:
        share = 100 * scores.half_width / report.effort_range
        lines.append(
            f"band     90 %: ± {effort.text(scores.half_width, 2)} ({share:.2g} % of the range) at the median of the "
            f"states left out; {100 * scores.covered:.0f} % of them lie in it"
        )
    if scores.unstable:
        lines += [
            f"unstable axis {axis}: ∂τ/∂u = {number(slope * effort.factor / u_unit.factor, 2)} "
            f"{effort.symbol}/{u_unit.symbol} at {p_unit.text(p)}, {u_unit.text(u)}"
            for axis, p, u, slope in scores.unstable
        ]
    else:
        lines.append("stable   the effort falls with u everywhere in the domain")
    excluded = report.details.get("excluded") or {}
    lines += [f"left out {count} states: {reason}" for reason, count in excluded.items()]
    return lines


def _actuation(law: JointLaw) -> str:
    (low, high), unit = law.domain.actuation, actuation_unit(law.actuation_name)
    return f"{unit_of(law.actuation_name).label} {number(low * unit.factor)} to {unit.text(high)}"


def _deformation(law: JointLaw, axis: int) -> str:
    (low, high), unit = law.domain.deformation[axis], deformation_unit(law)
    return f"u from {number(low * unit.factor)} to {unit.text(high)}"


def _compare(
    here: Session, bench: Workbench, source: Path, known: dict[str, Scores], others: Sequence[str]
) -> None:
    """Fit the other kinds too and print all side by side; a kind that cannot fit says why."""
    told: dict[str, Any] = {}
    problems: dict[str, str] = {}
    for kind in others:
        try:
            known[kind] = _scored(bench, source, kind)
        except (UserError, MissingDependencyError) as error:
            problems[kind] = str(error)
    here.say()
    here.say(f"{'kind':<12} {'worst':>8} {'rmse':>8} {'R²':>10} {'in band':>8} {'stable':>7} {'fit':>8}")
    for kind, scores in known.items():
        report = scores.stages.law.report
        assert report is not None
        rmse = report.rmse / report.effort_range
        covered = "—" if scores.covered is None else f"{100 * scores.covered:.0f} %"
        here.say(
            f"{kind:<12} {100 * report.worst_of_range:>6.2g} % {100 * rmse:>6.2g} % {report.r2:>10.7f} {covered:>8} "
            f"{'no' if scores.unstable else 'yes':>7} {scores.wall_s:>6.1f} s"
        )
        told[kind] = {
            "worst_of_range": report.worst_of_range,
            "rmse_of_range": rmse,
            "r2": report.r2,
            "covered": scores.covered,
            "stable": not scores.unstable,
            "wall_s": scores.wall_s,
        }
    for kind, problem in problems.items():
        here.say(f"{kind:<12} {problem}")
        told[kind] = {"problem": problem}
    here.result["compared"] = told


def _check_free(source: Path, kind: str, out: Path) -> None:
    """Raise `UserError` where the folder holds a study of another law; one of this law may have been edited."""
    study = out / STUDY
    if study.exists() and _law_line(source, kind, out) not in study.read_text(
        encoding="utf-8", errors="replace"
    ):
        raise UserError(f"{study} is there already, of another law; give another --out.")


def _write(here: Session, source: Path, kind: str, scores: Scores, out: Path) -> None:
    """The study, unless it is there already, and the result; the law's page has its place here."""
    study = out / STUDY
    kept = study.exists()
    if not kept:
        write_atomically(study, _study(source, kind, scores.law, out))
    write_atomically(out / RESULT, json.dumps(plain(here.result), indent=1, allow_nan=False) + "\n")
    here.result["out"] = str(out)
    here.result["study"] = str(study)
    what = "kept as it was;" if kept else "set the chain's measures in it, then"
    here.say(f"study    {study}: {what} 'pliant run {study}'")


def _page(
    here: Session, bench: Workbench, source: Path, known: Mapping[str, Scores], out: Path, learning: bool
) -> None:
    """The page of the first law, all that were compared beside it."""
    pieces = [
        piece_of(bench, kind, config, one.stages.law, learning=learning and not index, source=source.name)
        for index, (kind, one) in enumerate(known.items())
        if (config := one.stages.design.surrogate) is not None
    ]
    compared = pieces if len(pieces) > 1 else []
    inputs = {"name": source.stem, "surrogate": pieces[0].config.canonical()}
    here.result["report"] = fit_report_stage(bench, source.stem, pieces[:1], inputs, out, compared)
    here.say(f"report   {here.result['report']}")


def _law_line(source: Path, kind: str, out: Path) -> str:
    """The line of the study that says where its law comes from."""
    table = json.dumps(os.path.relpath(source, out).replace(os.sep, "/"))
    return f"surrogate: {{kind: {kind}, data: {table}}}"


def _study(source: Path, kind: str, law: JointLaw, out: Path) -> str:
    """A study with this law; the chain's numbers are placeholders that it says."""
    name = json.dumps(source.stem)
    largest = max((float(side) for side in law.domain.actuation), key=abs)
    key = "pressure" if law.actuation_name == "pressure_pa" else "tendon_force"
    return f"""\
pliant: 1
name: {name}
{_law_line(source, kind, out)}
chain:
  modules: 1                # how many of these joints stand in a row
  module_length: 10 mm      # from one joint to the next
  # module_mass: 1 g        # needed for gravity
  gravity: [0, 0, 0]        # m/s²; [0, 0, -9.81] with a mass
physics: {{kind: quasistatic}}
task: {{kind: free_bending, {key}: {largest:.6g}}}
"""
