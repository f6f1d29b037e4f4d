"""`pliant export`: a study's robot or its law as files for other programs, or as solids to print and moulds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydantic import ValidationError

from pliant import api
from pliant.cli.options import Overrides, StudyFile, verb
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, PluginFailureError, UserError, closest
from pliant.interfaces.physics import ExportBackend, PhysicsBackend, SceneExportBackend
from pliant.interfaces.task import SceneTask, Task
from pliant.meshing.stl import write_stl
from pliant.meshing.surfaces import welded
from pliant.pipeline.carried import Carried, carried_chain
from pliant.pipeline.motion import drawn_chain, surface_at_rest
from pliant.pipeline.study import StudyRun, build_study_laws, check_study, study_physics
from pliant.pipeline.visual import seen_surface
from pliant.pipeline.workbench import RunContext
from pliant.records.mount import Mount
from pliant.records.shape import TriangleMesh
from pliant.registry.discovery import Registry
from pliant.registry.function import package_function
from pliant_export.check_file import CheckFile, posed_states, reference_law_points, settled_states
from pliant_export.law_files import ENDINGS, LAW_FORMATS, write_laws
from pliant_export.system_export import export_system
from pliant_export.written_law import NOT_WRITTEN, has_form, identifier

# File endings that do not determine their format.
FORMATS = {"xml": "mjcf", "h": "c", "py": "numpy"}
SCENE, REACHABLE = "mjcf", "reachable"
STL, SOLIDS = "stl", ("3mf", "stl", "step")
PRINT = "pliant_print"
ACTS = {
    "mjcf": "The module beside it lets the law act in plain MuJoCo: load() or install(model), then data.ctrl takes the "
    "inputs. Without it the file is a spring with the stiffness at rest.",
    "urdf": "URDF has no law and no inputs: the law is in the JSON file beside it, and read_law.py evaluates it; the "
    "program that loads the URDF applies the efforts at its joints. PyBullet takes the file's inertias with "
    "flags=URDF_USE_INERTIA_FROM_FILE alone; its own are those of no shape.",
}


def drawn_surface(context: RunContext, study: Study, part: str) -> TriangleMesh:
    """Return the surface of the study's chain at rest, or of one module, as `family.visual` draws it."""
    if part == "module":
        return welded(seen_surface(context.build("family", study.need("family", "an STL"))).whole)
    study.need("chain", "the STL of a chain")
    check_study(context, study)
    chain = drawn_chain(context, StudyRun(study, build_study_laws(context, study)))
    return welded(surface_at_rest(chain))


@verb()
def export(
    session: Session,
    study: StudyFile,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help="A .xml (MJCF) or .urdf; the solid as .3mf, .stl or .step; the law alone as .h (C), .py or .json; "
            "of a model of your own .xml or .csv; with --mould a folder.",
        ),
    ],
    overrides: Overrides = None,
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="mjcf, urdf, 3mf, stl, step, c, numpy, torch, jax or json, by the file's ending where it is left "
            "out; or reachable (.csv).",
        ),
    ] = None,
    part: Annotated[
        str,
        typer.Option(
            "--part",
            help="'chain'; solids: one 'module' in its own frame; mjcf: the task's 'scene', fingers and objects.",
        ),
    ] = "chain",
    scale: Annotated[
        float,
        typer.Option("--scale", help="stl: the file's lengths are metres times this; 1000 for millimetres."),
    ] = 1.0,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite files of an exported model that are there already.")
    ] = False,
    mould: Annotated[
        bool, typer.Option("--mould", help="Write a mould for casting into the folder --out instead.")
    ] = False,
    protocol: Annotated[
        bool,
        typer.Option(
            "--protocol", help="Solids, moulds: also the protocol of the first bench run; needs the law."
        ),
    ] = False,
) -> None:
    """Export the robot as MJCF or URDF with its law and surfaces, its law alone, or as a solid to print or cast.

    An MJCF file comes with a Python module that makes it act in plain MuJoCo, a URDF file with the law as JSON and a
    reader. The law alone is written as C, NumPy, torch, JAX or JSON. Each has a check file `FILE.check.json` with the
    study's predictions. A solid (3MF, STL, STEP) is the FEM's mesh with cap, flange and inlets, one body per material,
    checked, with a bill; it needs no FEM. --mould writes halves, cores and a bill instead. The format
    reachable writes where the tip can go, as a table and as a picture. A study with a block `model` writes that
    model with its effects: an MJCF with a module for what MJCF cannot say and a check file, or
    parameters.csv; files that are there already stay without --force.
    """
    if out.is_dir() and not mould:
        raise UserError(f"--out {out} is a folder; give the name of a file in it.")
    loaded = session.study(study, overrides)
    if loaded.model is not None:
        if form or part != "chain" or scale != 1.0 or mould or protocol:
            raise UserError(
                "--format, --part, --scale, --mould and --protocol are for chains of modules; the ending of --out "
                "decides for other models."
            )
        export_system(session, loaded, out, force)
        return
    wanted = (form or out.suffix.removeprefix(".")).lower()
    wanted = FORMATS.get(wanted, wanted)
    if wanted == REACHABLE:
        _export_reachable(session, loaded, out)
        return
    if mould:
        _export_mould(session, loaded, out, form, part, protocol)
        return
    if wanted in SOLIDS:
        _export_solid(session, loaded, out, wanted, part, scale, protocol)
        return
    if protocol:
        raise UserError("--protocol is for solids and moulds; for other files use 'pliant plan'.")
    if scale != 1.0 or part not in ("chain", "scene") or (part == "scene" and wanted != SCENE):
        raise UserError(
            "--part module is for 3MF, STL and STEP, --part scene is for MJCF, --scale is for STL; other files hold "
            "the chain in metres."
        )
    if wanted in LAW_FORMATS:
        _export_law(session, loaded, out, wanted)
        return
    engine = find_writer(session.registry, out, form)
    loaded.need("chain", "an export")
    check_writable(out.parent)
    context = session.context()
    carried = carried_chain(context, loaded, mounted=True)
    if part == "scene":
        files = _write_scene(context, loaded, carried, engine, out)
    else:
        looks = drawn_chain(context, StudyRun(loaded, build_study_laws(context, loaded)))
        files = engine.export(carried.chain, out, looks)
        own = _study_engine(context, loaded)
        files += (_write_check(loaded, carried, files, settled_states(carried.chain, own), own.config.kind),)
    session.result.update(
        {"files": list(files), "format": engine.export_format, "left_out": carried.left_out}
    )
    beside = [file for file in files[1:] if file.parent == out.parent]
    meshes = [file for file in files if file.parent != out.parent]
    session.say(f"written  {out}{f' and {len(meshes)} mesh(es) in {meshes[-1].parent}' if meshes else ''}")
    for file in beside:
        session.say(f"written  {file}")
    if not has_form(carried.chain.laws):
        session.say(NOT_WRITTEN)
    elif engine.export_format in ACTS:
        session.say(ACTS[engine.export_format])
    if carried.chain.mount is not None:
        session.say(_onto(carried.chain.mount, files))
    for sentence in carried.sentences:
        session.say(sentence)


def _export_solid(
    session: Session, study: Study, out: Path, form: str, part: str, scale: float, protocol: bool
) -> None:
    """Write the solid; for a study whose `family.visual` draws the modules, an STL of the drawing."""
    if not (scale > 0 and math.isfinite(scale)):
        raise UserError(f"--scale {scale:g} is no scale; 1000 writes millimetres.")
    if scale != 1.0 and form != STL:
        raise UserError(f"--scale is for STL; {form.upper()} files are in millimetres and say so.")
    if part not in ("chain", "module"):
        raise UserError(f"--part {part} is neither 'chain' nor 'module'.")
    if study.family is not None and study.family.visual is not None and form == STL:
        surface = drawn_surface(session.context(), study, part)
        check_writable(out.parent)
        write_stl(surface, out, scale)
        session.result.update({"files": [out], "format": STL, "triangles": len(surface.faces)})
        session.say(f"written  {out} ({part}, {len(surface.faces)} triangles)")
        session.say(
            "It is the surface that 'family.visual' draws; leave that key out for the solid that is solved."
        )
        return
    package_function("export_solid", PRINT)(session, study, out, form, part, scale, protocol)


def _export_mould(
    session: Session, study: Study, out: Path, form: str | None, part: str, protocol: bool
) -> None:
    if form or part != "chain":
        raise UserError(
            "--mould writes a folder of 3MF files of the whole chain; leave --format and --part out."
        )
    package_function("export_mould", PRINT)(session, study, out, protocol)


def _onto(mount: Mount, files: Sequence[Path]) -> str:
    """Return a sentence on how to mount the exported robot on the study's arm, which the file does not contain."""
    module = next((file.stem for file in files if file.suffix == ".py"), None)
    said = f"The arm is not in it: its world is the frame of '{mount.at}'."
    return (
        said
        if module is None
        else f"{said} {module}.mount({str(mount.file)!r}, at={mount.at!r}) puts it there."
    )


def _export_reachable(session: Session, study: Study, out: Path) -> None:
    """Write equilibria over the whole range of the inputs as a table and a picture."""
    from pliant.report.reachable_chart import reachable_chart
    from pliant.report.still import write_still  # matplotlib takes a second to import

    if out.suffix.lower() != ".csv":
        raise UserError(f"--out {out.name}: the reachable set is a table; give it the ending .csv.")
    study.need("chain", "a reachable set")
    check_writable(out.parent)
    bounds = getattr(study.task, "bounds", None)  # of the task reach
    inverse = api.inverse(api.OpenStudy(study, session.context()), bounds)
    found, picture = inverse.reachable, out.with_suffix(".png")
    found.write(out)
    write_still(reachable_chart(found, inverse.bounds), picture)
    outside = int(np.count_nonzero(found.inside == 0))
    session.result.update(
        {
            "files": [out, picture],
            "format": REACHABLE,
            "equilibria": len(found.actuation),
            "outside_data": outside,
            "limits_m": found.limits_m,
        }
    )
    session.say(f"written  {out} ({len(found.actuation)} equilibria)\nwritten  {picture}")
    limits = zip("xyz", 1e3 * found.limits_m, strict=True)
    session.say(
        f"The tip reaches {', '.join(f'{k} {low:.4g} to {high:.4g} mm' for k, (low, high) in limits)}."
    )
    if outside:
        session.say(f"{outside} of them lie beyond the data of a law.")


def _study_engine(context: RunContext, study: Study) -> PhysicsBackend:
    """Return the study's engine, or the default one if that is not installed."""
    try:
        engine: PhysicsBackend = context.build("physics", study_physics(context, study))
    except MissingDependencyError:
        engine = context.build("physics", study_physics(context, study.model_copy(update={"physics": None})))
    return engine


def _write_check(
    study: Study,
    carried: Carried,
    files: Sequence[Path],
    states: Iterable[Mapping[str, Any]],
    engine: str = "",
) -> Path:
    """Write the check file of a robot or scene and return its path."""
    laws = carried.chain.laws
    names = [identifier(file.stem) for file in files if file.suffix == ".json"]
    check = CheckFile(
        study.name,
        engine,
        tuple(file.name for file in files if file.parent == files[0].parent),
        reference_law_points(laws, names if len(names) == len(set(laws)) else ()),
        tuple(states),
        carried.chain.length_m,
        carried.left_out,
    )
    return check.write(files[0])


def _write_scene(
    context: RunContext, study: Study, carried: Carried, engine: ExportBackend, out: Path
) -> tuple[Path, ...]:
    """Write the scene of the study's task and its check file, which has no equilibria.

    The scene has the settings of the study's engine if that engine writes the format.
    """
    task: Task | SceneTask = context.build("task", study.need("task", "a scene"))
    if not isinstance(task, SceneTask):
        raise UserError(
            f"task '{task.config.kind}' has no scene; give a task with contact, such as 'grasp', or leave --part out."
        )
    own: PhysicsBackend = context.build("physics", study_physics(context, study))
    if isinstance(own, SceneExportBackend) and own.export_format == engine.export_format:
        engine = own
    if not isinstance(engine, SceneExportBackend):
        raise UserError(f"no engine writes scenes as '{engine.export_format}'; leave --part scene out.")
    scene = task.scene(carried.chain)
    files = engine.export_scene(scene, out)
    states = [s for k, arm in enumerate(scene.arms) for s in posed_states(arm.chain, f"arm_{k}_")]
    return (*files, _write_check(study, carried, files, states))


def _export_law(session: Session, study: Study, out: Path, form: str) -> None:
    """Write the law alone; the study needs no chain."""
    check_writable(out.parent)
    context = session.context()
    carried = carried_chain(context, study, mounted=True) if study.chain is not None else None
    laws = carried.chain.laws if carried else [stages.law.law for stages in build_study_laws(context, study)]
    files = write_laws(laws, out, form)
    left_out = carried.left_out if carried else tuple(effect.kind for effect in study.effects)
    checks = [
        CheckFile(
            study.name,
            "",
            (file.name,),
            reference_law_points([law], [identifier(file.stem)]),
            left_out=left_out,
        )
        for law, file in zip(dict.fromkeys(laws), files, strict=True)
    ]
    files += tuple(check.write(file) for check, file in zip(checks, files, strict=True))
    session.result.update({"files": list(files), "format": form, "left_out": left_out})
    for file in files:
        session.say(f"written  {file}")
    if left_out:
        session.say(f"Effects that are not in it: {', '.join(left_out)}.")
    if any(law.states_error for law in laws):
        session.say(
            "Of the law's error bar it holds the largest half-width in the domain (90 %), not its shape."
        )


def find_writer(registry: Registry, out: Path, form: str | None) -> ExportBackend:
    """Return the engine that writes the format.

    Raises:
        UserError: no installed engine writes it.
    """
    ending = out.suffix.lower().removeprefix(".")
    wanted = form.lower() if form else FORMATS.get(ending, ending)
    known: list[str] = []
    missing: list[str] = []
    for component in registry.by_interface("physics"):
        try:
            engine: PhysicsBackend = component.build(component.config_model()(kind=component.kind))
        except MissingDependencyError as error:
            missing.append(f" {error}")
            continue
        except (PluginFailureError, ValidationError):  # a broken engine does not end the search
            continue
        if not isinstance(engine, ExportBackend):
            continue
        if engine.export_format == wanted:
            return engine
        known.append(engine.export_format)
    endings = {of: ending for ending, of in FORMATS.items()}
    endings |= ENDINGS
    every = sorted([*known, *SOLIDS, *LAW_FORMATS])
    told = ", ".join(f"{name} (.{endings.get(name, name)})" for name in every)
    said = f"--format {form}" if form else f"--out {out.name}"
    cause = f"no engine writes '{wanted}'" if wanted else "the name has no ending"
    raise UserError(f"{said}: {cause}{closest(wanted, every)} Formats: {told}.{''.join(missing)}")
