"""`pliant export`: a study's chain as a file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.session import check_writable, session
from pliant.errors import MissingDependencyError, UserError, closest
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.motion import drawn_chain
from pliant.pipeline.study import StudyRun, chain_of_study, laws_of_study
from pliant.registry.discovery import Registry

# Endings that do not name their format themselves.
FORMATS = {"xml": "mjcf"}


def export(
    study: StudyFile,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="A .xml (MJCF) or .urdf.")],
    overrides: Overrides = None,
    form: Annotated[
        str | None, typer.Option("--format", help="mjcf or urdf; by the file's ending where it is left out.")
    ] = None,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """The chain as MJCF or URDF with its surfaces beside it; the law is in the file as stiffness at rest only."""
    with session("export", json, quiet) as here:
        if out.is_dir():
            raise UserError(f"--out {out} is a folder; give the name of a file in it.")
        engine = writer_of(here.registry, out, form)
        loaded = here.study(study, overrides)
        loaded.need("chain", "an export")
        check_writable(out.parent)
        bench = here.bench(store)
        chain = chain_of_study(bench, loaded).chain
        looks = drawn_chain(bench, StudyRun(loaded, laws_of_study(bench, loaded)))
        files = engine.export(chain, out, looks)
        if loaded.effects:
            here.progress.note("the study's effects are not in the file, which holds the chain at rest.")
        here.result.update({"files": list(files), "format": engine.capabilities.export})
        beside = f" and {len(files) - 1} mesh(es) in {files[1].parent}" if len(files) > 1 else ""
        here.say(f"written  {out}{beside}")


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
    told = ", ".join(f"{name} (.{endings.get(name, name)})" for name in sorted(known))
    said = f"--format {form}" if form else f"--out {out.name}"
    cause = f"no engine writes '{wanted}'" if wanted else "the name has no ending"
    raise UserError(f"{said}: {cause}{closest(wanted, known)} Formats: {told}.{''.join(missing)}")
