"""`pliant export`: a study's chain as a file for other programs, or what it looks like as STL."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import Overrides, StudyFile, verb
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError, closest
from pliant.interfaces.physics import PhysicsBackend
from pliant.meshing.stl import write_stl
from pliant.meshing.surfaces import welded
from pliant.pipeline.motion import drawn_chain, surface_at_rest
from pliant.pipeline.study import StudyRun, chain_of_study, check_study, laws_of_study
from pliant.pipeline.visual import seen_surface
from pliant.pipeline.workbench import Workbench
from pliant.records.shape import TriangleMesh
from pliant.registry.discovery import Registry

# Endings that do not name their format themselves.
FORMATS = {"xml": "mjcf"}
STL = "stl"
CANNOT_MOVE = (
    "It holds geometry, masses and the stiffness at rest. It cannot move by itself: there is no actuator, no law of "
    "pressure or tendon, and no payload of the task in it."
)


def surface_of(bench: Workbench, study: Study, part: str, scale: float) -> TriangleMesh:
    """The surface of the study's chain at rest, or of one module, inner walls between pieces taken away."""
    if not (scale > 0 and math.isfinite(scale)):
        raise UserError(f"--scale {scale:g} is no scale; 1000 writes millimetres.")
    if part == "module":
        family = bench.build("family", study.need("family", "the STL of a module"))
        return welded(seen_surface(family).whole)
    if part != "chain":
        raise UserError(f"--part {part} is neither 'chain' nor 'module'.")
    study.need("chain", "the STL of a chain")
    check_study(bench, study)
    chain = drawn_chain(bench, StudyRun(study, laws_of_study(bench, study)))
    return welded(surface_at_rest(chain))


@verb()
def export(
    here: Session,
    study: StudyFile,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="A .xml (MJCF), .urdf or .stl.")],
    overrides: Overrides = None,
    form: Annotated[
        str | None,
        typer.Option("--format", help="mjcf, urdf or stl; by the file's ending where it is left out."),
    ] = None,
    part: Annotated[
        str,
        typer.Option("--part", help="stl: 'chain', at rest in the world, or one 'module' in its own frame."),
    ] = "chain",
    scale: Annotated[
        float,
        typer.Option("--scale", help="stl: the file's lengths are metres times this; 1000 for millimetres."),
    ] = 1.0,
) -> None:
    """The chain as MJCF or URDF with its surfaces beside it, or its surface as STL.

    In MJCF and URDF the law is stiffness at rest only. An STL of one module needs no FEM.
    """
    if out.is_dir():
        raise UserError(f"--out {out} is a folder; give the name of a file in it.")
    loaded = here.study(study, overrides)
    if (form or out.suffix.removeprefix(".")).lower() == STL:
        surface = surface_of(here.bench(), loaded, part, scale)
        check_writable(out.parent)
        write_stl(surface, out, scale)
        here.result.update({"files": [out], "format": STL, "triangles": len(surface.faces)})
        here.say(f"written  {out} ({part}, {len(surface.faces)} triangles)")
        return
    if part != "chain" or scale != 1.0:
        raise UserError("--part and --scale are for STL; MJCF and URDF hold the whole chain in metres.")
    engine = writer_of(here.registry, out, form)
    loaded.need("chain", "an export")
    check_writable(out.parent)
    bench = here.bench()
    chain = chain_of_study(bench, loaded).chain
    looks = drawn_chain(bench, StudyRun(loaded, laws_of_study(bench, loaded)))
    files = engine.export(chain, out, looks)
    if loaded.effects:
        here.progress.note("the study's effects are not in the file, which holds the chain at rest.")
    here.result.update({"files": list(files), "format": engine.capabilities.export})
    beside = f" and {len(files) - 1} mesh(es) in {files[1].parent}" if len(files) > 1 else ""
    here.say(f"written  {out}{beside}")
    here.say(CANNOT_MOVE)


def writer_of(registry: Registry, out: Path, form: str | None) -> PhysicsBackend:
    """The engine that writes the format.

    Raises:
        UserError: no engine that is installed writes it.
    """
    ending = out.suffix.lower().removeprefix(".")
    wanted = form.lower() if form else FORMATS.get(ending, ending)
    known: list[str] = []
    missing: list[str] = []
    for component in registry.of("physics"):
        try:
            engine: PhysicsBackend = component.build(component.config_model()(kind=component.kind))
        except MissingDependencyError as error:
            missing.append(f" {error}")
            continue
        if wanted and engine.capabilities.export == wanted:
            return engine
        known += [engine.capabilities.export] if engine.capabilities.export else []
    endings = {of: ending for ending, of in FORMATS.items()}
    told = ", ".join(f"{name} (.{endings.get(name, name)})" for name in sorted([*known, STL]))
    said = f"--format {form}" if form else f"--out {out.name}"
    cause = f"no engine writes '{wanted}'" if wanted else "the name has no ending"
    raise UserError(f"{said}: {cause}{closest(wanted, [*known, STL])} Formats: {told}.{''.join(missing)}")
