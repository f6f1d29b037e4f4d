"""`pliant calibrate`: constants of the study's material from test data."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import Force, Full, Overrides, StudyFile, check_target, verb
from pliant.cli.session import Session
from pliant.config.study import Study, written_name
from pliant.config.writing import StudyDraft
from pliant.errors import UserError
from pliant.formatting import number
from pliant.registry.discovery import Registry
from pliant.units import parse_quantity
from pliant_calibrate.calibration import calibrate_file
from pliant_calibrate.document import calibration_document
from pliant_calibrate.fitting import changed
from pliant_calibrate.result import Calibration

BenchFile = Annotated[
    Path | None,
    typer.Option("--data", metavar="CSV", help="The tensile test or the free curve."),
]
TestName = Annotated[
    str | None,
    typer.Option(
        "--test",
        metavar="TEST",
        help="free, uniaxial, equibiaxial or planar; by default from the file's columns.",
    ),
]
Keys = Annotated[
    list[str] | None,
    typer.Option(
        "--fit",
        metavar="KEY",
        help="Constant to fit, such as c10; repeat it. All but poisson_ratio by default.",
    ),
]
NewStudy = Annotated[
    Path | None, typer.Option("--out", metavar="NEW.yaml", help="Write the study with the fitted constants.")
]
NOT_REACHED = 3


@verb()
def calibrate(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: BenchFile = None,
    test: TestName = None,
    fit: Keys = None,
    out: NewStudy = None,
    force: Force = False,
    full: Full = False,
) -> None:
    """Fit the material's constants to a tensile test or a free curve, with their uncertainty."""
    begun = time.perf_counter()
    loaded = session.study(study, overrides)
    if data is None:
        raise UserError("name the data: pliant calibrate STUDY.yaml --data CSV.")
    if out is not None:
        check_target(study, out, force)
    found = calibrate_file(session.context(), loaded, data, test, fit)
    session.show(calibration_document(loaded.name, found))
    session.result |= {"study": loaded.name, "out": None, "wall_s": time.perf_counter() - begun}
    if found.undetermined:
        if out is not None:
            session.say("No study was written.")
        session.exit_code = NOT_REACHED
    elif out is not None:
        write_study(study, out, loaded, session.overrides, found, session.installed, full)
        session.result["out"] = str(out)
        session.say(f"study    {out}")


def write_study(
    source: Path,
    target: Path,
    study: Study,
    overrides: Sequence[str],
    calibration: Calibration,
    registry: Registry,
    full: bool = False,
) -> None:
    """Write the study with the fitted constants, rounded to six digits."""
    rounded = changed(
        calibration.config,
        calibration.constants,
        [
            parse_quantity(_text(c.value, c.is_modulus), c.unit or "dimensionless")
            for c in calibration.constants
        ],
    )
    assert rounded is not None
    draft = StudyDraft(source, overrides)
    draft.set(
        ("material", "kind"),
        rounded.kind,
        f"fitted to {calibration.data.source} (sha256 {calibration.data.sha256[:8]}), {calibration.covered}",
    )
    for field in dict.fromkeys(c.field for c in calibration.constants):
        key, modulus = written_name(type(rounded), field), field.endswith("_pa")
        value = getattr(rounded, field)
        listed = [_written(item, modulus) for item in value] if isinstance(value, tuple) else None
        sds = zip(calibration.constants, calibration.certainty.sd.tolist(), strict=True)
        shares = [number(sd * (1e-3 if modulus else 1), 2) for c, sd in sds if c.field == field]
        remark = f"{key} ± {', '.join(shares)}{' kPa' * modulus}"
        draft.set(("material", key), listed or _written(value, modulus), remark)
    if calibration.volume.poisson_ratio is not None and calibration.volume.assumption in (
        "incompressible",
        "default",
    ):
        draft.set(
            ("material", "poisson_ratio"),
            calibration.volume.poisson_ratio,
            f"K of FEM; {calibration.volume.assumption}",
        )
    meant = {**study.canonical(), "name": draft.name_after(target), "material": rounded.canonical()}
    draft.write(target, meant, registry, full)


def _text(value: float, is_modulus: bool) -> str:
    return f"{value / 1e3:.6g} kPa" if is_modulus else f"{value:.6g}"


def _written(value: float, is_modulus: bool) -> str | float:
    return _text(value, True) if is_modulus else float(_text(value, False))
