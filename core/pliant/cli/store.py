"""`pliant store`: list, verify, prune, export and import the folder of cached results."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import check_target, verb
from pliant.cli.session import Session
from pliant.config.portable import write_portable
from pliant.errors import NotReachedError, UserError
from pliant.formatting import number, plural
from pliant.registry.files import shown
from pliant.report.store import as_data, store_document
from pliant.store.archive import import_archive, write_archive
from pliant.store.inventory import damaged, entries, prune, to_prune

NOT_KEPT = ("report",)  # pages are drawn again from the data, by the installed code
DAY_S = 86400.0

Verify = Annotated[bool, typer.Option("--verify", help="Read every artifact against its checksums.")]
Older = Annotated[
    float | None,
    typer.Option("--older", metavar="DAYS", min=0, help="Take away what was made more days ago than this."),
]
Most = Annotated[
    float | None,
    typer.Option("--most", metavar="MB", min=0, help="Take away the oldest until no more than this is left."),
]
Export = Annotated[
    Path | None,
    typer.Option(
        "--export", metavar="STUDY.yaml", help="Write a study with its artifacts into an archive, --out."
    ),
]
Import = Annotated[
    Path | None,
    typer.Option(
        "--import",
        metavar="FILE.zip",
        help="Put an archive's artifacts into the store, its study into --out.",
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="PATH", help="The archive, or the folder of its study.")
]


@verb()
def store(
    session: Session,
    verify: Verify = False,
    older: Older = None,
    most: Most = None,
    export: Export = None,
    import_: Import = None,
    out: Out = None,
) -> None:
    """List the cached results in the store by study; verify, prune, export and import them."""
    root = session.store.expanduser()
    asked = [verify, older is not None or most is not None, export is not None, import_ is not None]
    if sum(asked) > 1:
        raise UserError("give one of --verify, --export, --import, or --older and --most.")
    if out is not None and export is None and import_ is None:
        raise UserError("--out goes with --export or --import.")
    if import_ is not None:
        _import(session, root, import_, out)
    elif export is not None:
        _export(session, root, export, out)
    elif verify:
        _verify(session, root)
    elif asked[1]:
        _prune(session, root, older, most)
    else:
        session.show(store_document(root))


def _verify(session: Session, root: Path) -> None:
    found = entries(root)
    bar = session.progress.begin("artifacts", len(found))
    wrong = list(damaged(found, bar.advance))
    bar.finish()
    for entry, cause in wrong:
        session.say(f"damaged  {entry.stage}/{entry.key}: {cause}")
    session.say(
        f"{plural(len(found), 'artifact')} read, {len(wrong)} damaged; a damaged one is made anew when it is needed."
    )
    session.result.update(
        artifacts=len(found), damaged=[{**as_data(entry), "cause": cause} for entry, cause in wrong]
    )
    if wrong:
        session.exit_code = NotReachedError.exit_code


def _prune(session: Session, root: Path, older: float | None, most: float | None) -> None:
    found = entries(root)
    gone = to_prune(
        found, None if older is None else older * DAY_S, None if most is None else int(most * 1e6)
    )
    gone = prune(gone)
    freed, left = sum(e.size_bytes for e in gone), sum(e.size_bytes for e in found if e not in gone)
    session.say(
        f"{plural(len(gone), 'artifact')} taken away, {number(freed / 1e6, 3)} MB; {number(left / 1e6, 3)} MB stay."
    )
    session.result.update(removed=[as_data(entry) for entry in gone], freed_bytes=freed, size_bytes=left)


def _export(session: Session, root: Path, source: Path, out: Path | None) -> None:
    study = session.study(source, None, uses=("sweep", "search", "measurements", "cross_check"))
    target = out or Path(f"{study.name}.zip")
    check_target(None, target)
    own = [e for e in entries(root) if study.name in e.studies and e.stage not in NOT_KEPT]
    if not own:
        raise UserError(
            f"{root} contains no results of study '{study.name}'; run it first with this --store."
        )
    if wrong := list(damaged(own)):
        entry, cause = wrong[0]
        raise UserError(
            f"{entry.stage}/{entry.key[:8]} is damaged ({cause}); run the study again, then export it."
        )
    with tempfile.TemporaryDirectory(prefix="pliant-") as folder:
        portable = write_portable(source, Path(folder))
        write_archive(target, study.name, portable, own)
    size = target.stat().st_size
    session.say(f"archive  {target}: {plural(len(own), 'artifact')}, {number(size / 1e6, 3)} MB")
    session.result.update(study=study.name, archive=str(target), artifacts=len(own), size_bytes=size)


def _import(session: Session, root: Path, archive: Path, out: Path | None) -> None:
    made = import_archive(archive, root, out or Path(archive.stem))
    new, every = made.artifacts
    session.say(f"study    {made.study}: {plural(every, 'artifact')}, {new} of them new in {root}")
    if made.code:
        names = ", ".join(map(shown, made.code))
        session.say(f"code     {names}: runs when the study is run, not before; read it first")
    session.result.update(
        study=made.name,
        file=str(made.study),
        artifacts=every,
        new=new,
        code=[str(file) for file in made.code],
    )
