"""The run in words: the result as one sentence, and everything that a reader must be warned of."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant.formatting import (
    Unit,
    actuation_unit,
    deformation_unit,
    display_unit,
    effort_unit,
    fixed,
    percent,
    small_length,
    unbroken,
)
from pliant.records.fem import PASSED, SELF_CONTACT, TRUSTED, FemDataset, ModuleData
from pliant.report.document import Warned
from pliant.report.fem_reading import failed_place
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.reading import (
    Ran,
    actuation,
    chain_config,
    distances_m,
    main_axis,
    payload_kg,
    ran,
    skipped,
)

LISTED = 12  # entries that a warning spells out


def result_sentence(run: FinishedRun) -> str:
    """What came out: the bend, how well the engines agree, how well the law fits."""
    parts = [_bend(run), _agreement(ran(run)), _law_error(run)]
    text = "; ".join(part for part in parts if part)
    text = unbroken(text)
    return text[0].upper() + text[1:] + "."


def warnings(run: FinishedRun) -> list[Warned]:
    """Everything that limits the result, the gravest first."""
    found: list[Warned] = []
    for engine in ran(run):
        found += _engine_warnings(engine, run)
    for design in run.designs:
        found += _law_warnings(design, len(run.designs) > 1)
    for other in skipped(run):
        found.append(Warned(f"Engine {other.kind} was skipped: {other.skipped or 'no cause was given'}"))
    unused = run.summary.get("unused") or []
    if unused:
        found.append(Warned(f"The study sets {', '.join(unused)}, which no stage of this version reads."))
    return found


def _bend(run: FinishedRun) -> str:
    engines, given = ran(run), actuation(run)
    law = run.designs[0].law
    if not engines:
        return f"a joint law of one module, no chain simulated ({run.study.get('name', 'study')})"
    final = engines[0].result.final
    if engines[0].result.stills:
        return grasp_words(engines[0], actuation(run))
    joints = final.joint_angles
    at = f" at {actuation_unit(given[0]).text(given[1])}" if given else ""
    load = payload_kg(run)
    under = f" with {display_unit('kg').text(load)} at its tip" if load else ""
    name = f"{len(joints)}-module finger" if len(joints) > 1 else "one-joint finger"
    unit, total = deformation_unit(law), float(joints[:, main_axis(law)].sum())
    verb = "extends by" if law.joint == "prismatic" else "bends"
    size = unit.attached(fixed(total * unit.factor, 2 if law.joint == "prismatic" else 1))
    if not final.converged:
        return f"{name} did not settle{at}{under} in {engines[0].kind}"
    return f"{name} {verb} {size}{at}{under}{_to_target(engines[0])}"


def _to_target(engine: Ran) -> str:
    """How far a backbone ended from the curve that it was to follow."""
    metrics = engine.result.metrics
    if "target_points_m" not in metrics:
        return ""
    return f", {display_unit('m').text(float(metrics['rmse_m']), 3)} (RMS) from its target"


def grasp_words(engine: Ran, given: tuple[str, float] | None) -> str:
    """A task with contact: how the grasp went."""
    measured = engine.result.metrics
    at = f" at {actuation_unit(given[0]).text(given[1])}" if given else ""
    mode, rise, share = (measured.get(name) for name in ("mode", "z_end_m", "success_share"))
    if not mode:
        return f"the scene was simulated{at}"
    parts = [f"the grasp{at} is '{mode}'"]
    if rise is not None:
        parts.append(f"the object ends {display_unit('m').text(float(rise), 3)} above its place")
    if share is not None and "trials" in measured:
        parts.append(f"{100 * float(share):.0f} % of {len(measured['trials']['mode'])} trials hold it")
    return ", ".join(parts)


def _agreement(engines: list[Ran]) -> str:
    if len(engines) < 2 or engines[0].result.stills:
        return ""
    worst = max(float(d.max()) for d in distances_m(engines))
    numbers = {2: "two", 3: "three", 4: "four"}
    return f"{numbers.get(len(engines), str(len(engines)))} engines agree within {small_length(worst)}"


def _law_error(run: FinishedRun) -> str:
    fits = [d.fit for d in run.designs if d.fit is not None]
    if not fits:
        return "the law is stated by its coefficients"
    worst = max(fit.worst_of_range for fit in fits)
    if any("meta_model" in fit.details for fit in fits):
        return f"law of a meta-model, within {percent(worst)} of FEM on designs left out"
    data = [d.fem for d in run.designs if d.fem is not None]
    source = "the table's states" if data and data[0].design.family == "table" else "FEM"
    return f"law within {percent(worst)} of {source} on states left out"


def _engine_warnings(engine: Ran, run: FinishedRun) -> list[Warned]:
    final, law = engine.result.final, run.designs[0].law
    found = []
    if not final.converged:
        unit = effort_unit(law)
        residual = unit.text(final.residual, 2)
        found.append(Warned(f"{engine.kind} did not converge; unbalanced effort {residual}."))
    if final.stable is False:
        found.append(
            Warned(f"{engine.kind} settled in an unstable equilibrium: the energy has no minimum there.")
        )
    if engine.result.not_reached:
        found.append(Warned(f"{engine.kind}: {engine.result.not_reached}"))
    if final.outside_domain:
        p_unit, u_unit = actuation_unit(law.actuation_name), deformation_unit(law)
        entries = sorted(final.outside_domain, key=lambda e: -abs(e.excess))
        items = [
            f"module {e.module}: {e.variable} by {_unit_of(e.variable, p_unit, u_unit).text(e.excess, 3)}"
            for e in entries[:LISTED]
        ]
        places = f"{len(entries)} places" if len(entries) > 1 else "one place"
        sentence = f"{engine.kind} used the law outside its domain at {places}"
        found.append(Warned(sentence + _rest(len(entries)) + ".", tuple(items)))
    return found


def _unit_of(variable: str, actuation_unit: Unit, deformation_unit: Unit) -> Unit:
    """Actuations are named by their input, joint coordinates by their axis."""
    return actuation_unit if variable.endswith(("_pa", "_n")) or variable == "actuation" else deformation_unit


def _law_warnings(design: DesignResult, named: bool) -> list[Warned]:
    found = []
    prefix = f"{design.name}: " if named else ""
    if design.fit is not None and design.fit.details.get("stable") is False:
        found.append(Warned(f"{prefix}the law is unstable (∂τ/∂u ≥ 0) somewhere in its domain."))
    data = design.fem if design.module is None else design.module
    return found if data is None else found + data_warnings(data, prefix)


def data_warnings(data: FemDataset | ModuleData, prefix: str = "") -> list[Warned]:
    """What limits a data set: self-contact, states that are not trusted, states that failed."""
    found = []
    contact = int(np.sum(data.status == SELF_CONTACT))
    if contact:
        found.append(
            Warned(
                f"{prefix}{contact} of {len(data)} states have {_touching(data)}. The model has no "
                "contact: the law's domain ends where they take over, and inside it they are too soft."
            )
        )
    if passed := int(np.sum(data.status == PASSED)):
        found.append(
            Warned(
                f"{prefix}In {passed} of {len(data)} states convolutions pass through each other, as "
                "'fem.self_contact: pass' lets them: a real module is stiffer there."
            )
        )
    other = ~np.isin(data.status, (*TRUSTED, SELF_CONTACT))
    if other.any():
        names = ", ".join(sorted(set(data.status[other].tolist())))
        found.append(Warned(f"{prefix}{int(other.sum())} states are not trusted ({names})."))
    failed = data.failed
    if failed:
        items = tuple(_failed(entry, data) for entry in failed[:LISTED])
        found.append(Warned(f"{prefix}{len(failed)} states failed{_rest(len(failed))}.", items))
    return found


def _touching(data: FemDataset | ModuleData) -> str:
    return "links that would meet" if data.actuation_name == "tendon_force_n" else "touching convolutions"


def _failed(entry: Mapping[str, object], data: FemDataset | ModuleData) -> str:
    return f"{', '.join(failed_place(entry, data))}: {entry.get('cause', 'no cause recorded')}"


def _rest(count: int) -> str:
    return f" (the first {LISTED} are listed)" if count > LISTED else ""


def gravity_words(run: FinishedRun) -> str:
    """Whether weight acts, for captions."""
    chain = chain_config(run)
    return "under gravity" if chain is not None and any(chain.gravity_m_s2) else "without gravity"
