"""One call of the command line: where it prints, what it returns, how it ends."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import typer
from rich.console import Console
from rich.markup import escape
from rich.segment import Segment

from pliant import __version__
from pliant.cli.bars import TerminalProgress
from pliant.config.loading import load_study
from pliant.config.study import Study
from pliant.errors import INTERRUPTED, PliantError, UserError, interrupted
from pliant.pipeline.workbench import Workbench
from pliant.records.counts import Counts
from pliant.records.measurement import Measurement
from pliant.records.plain_values import plain as plain
from pliant.registry.discovery import discover
from pliant.registry.files import blamed, with_files
from pliant.report.document import Document
from pliant.report.render import page, terminal
from pliant.report.stage import StoredPage, write_page
from pliant.report.stored_answer import Answer
from pliant.store.store import ArtifactStore, write_atomically
from pliant.user_text import visible

LONGEST_NAME = 80
# Endings of files, which no folder should have.
FILE_ENDINGS = (".yaml", ".yml", ".json", ".html", ".csv")


@dataclass
class Session:
    """The surroundings of one verb. `result` becomes the JSON, `say` prints for people.

    `path`, `study_name` and `overrides` are of the study that was read, `installed` the plugins that were known before;
    `until_end` holds contexts that last as long as the verb.
    """

    command: str
    json_target: str | None = None
    quiet: bool = False
    result: dict[str, Any] = field(default_factory=dict)
    exit_code: int = 0
    store: Path = Path()
    path: Path = Path()
    study_name: str = ""
    overrides: tuple[str, ...] = ()
    until_end: ExitStack = field(default_factory=ExitStack)

    def __post_init__(self) -> None:
        # With JSON on standard output, words for people go to standard error.
        self.out = VisibleConsole(stderr=self.json_target == "-", highlight=False, soft_wrap=True)
        self.err = VisibleConsole(stderr=True, highlight=False)
        self.installed = self.registry = discover()

    def say(self, text: object = "", markup: bool = False) -> None:
        """Print for people, unless --quiet; `markup` reads rich's tags, so foreign text must be escaped."""
        if not self.quiet:
            self.out.print(text, markup=markup)

    def show(
        self, document: Document, folder: Path | None = None, stored: StoredPage | Answer | None = None
    ) -> None:
        """Print a document, keep its JSON, and write its page, `stored` or not, where there is a folder for it."""
        self.result.update(document.data)
        for block in terminal(document, has_page=folder is not None):
            self.say(block)
        if folder is not None:
            made = page(document) if stored is None else stored.render(document)
            written = write_page(folder, made.html, made.pictures, document.page)
            self.result.update(out=str(folder), report=str(written))
            self.say(f"report   {written}")

    def study(self, path: Path, overrides: Sequence[str] | None, uses: Sequence[str] = ()) -> Study:
        """Read the study, know the plugins that it lists, and say which of its keys this verb does not read.

        `uses` names keys that this verb alone reads.
        """
        self.path, self.overrides = path, tuple(overrides or ())
        study = load_study(path, self.registry, self.overrides, self.progress.note)
        self.registry = with_files(self.registry, study.plugins)
        self.study_name = study.name
        if unused := [key for key in study.unused() if key not in uses]:
            self.progress.note(f"{', '.join(unused)}: read, but not used by '{self.command}'.")
        if searched := [key for key in study.searched() if key not in uses]:
            self.progress.note(
                f"{', '.join(searched)}: for 'pliant optimize'; '{self.command}' takes the study as it is."
            )
        return study

    def measured(self, study: Study, data: Measurement | Counts) -> None:
        """Keep for the JSON which study was held against which data."""
        self.result.update(study=study.name, data=data.source, data_sha256=data.sha256)

    @property
    def progress(self) -> TerminalProgress:
        """Progress on standard error."""
        return TerminalProgress(self.err, self.quiet)

    def bench(self) -> Workbench:
        """A workbench on the verb's store."""
        return Workbench(
            self.registry, ArtifactStore(self.store.expanduser(), self.study_name), self.progress
        )


@contextmanager
def session(command: str, json_target: str | None, quiet: bool, store: Path) -> Iterator[Session]:
    """Run a verb: errors become one message and an exit code, the result becomes JSON."""
    here = Session(command, json_target, quiet, store=store)
    try:
        if json_target is not None and json_target != "-":
            _check_json_target(json_target)
        with here.until_end:
            yield here
        _write_json(here)
    except PliantError as error:
        here.err.print(f"[bold red]error:[/] {escape(str(error))}", soft_wrap=True)
        raise typer.Exit(error.exit_code) from None
    except OSError as error:  # a name or a disk that no earlier check could foresee
        place = f"{error.filename}: " if error.filename else ""
        here.err.print(f"error: {place}{error.strerror or error}.", markup=False, soft_wrap=True)
        raise typer.Exit(UserError.exit_code) from None
    except KeyboardInterrupt:
        _stop(here)
    except Exception as error:
        if interrupted(error):
            _stop(here)
        sentence = blamed(error)  # effects from a file of the user's own may fail in any way
        if sentence is None:
            raise
        here.err.print(f"[bold red]error:[/] {escape(sentence)}", soft_wrap=True)
        raise typer.Exit(UserError.exit_code) from None
    if here.exit_code:
        raise typer.Exit(here.exit_code)


def _stop(here: Session) -> NoReturn:
    here.err.print("interrupted; finished work is kept, run the same command to go on.")
    raise typer.Exit(INTERRUPTED) from None


def _check_json_target(target: str) -> None:
    """Refuse a file that cannot be written, before any work is done."""
    path = Path(target)
    if not target or target.endswith("/") or os.path.isdir(path):  # noqa: PTH112 - never raises
        raise UserError(
            f"--json needs the name of a file, and '{target}' is a folder; try {path / 'result.json'}."
        )
    check_writable(path.parent)
    try:
        path.exists()
    except OSError as error:
        raise UserError(f"--json: the file cannot be written ({error.strerror}); choose another.") from None


def check_writable(folder: Path) -> None:
    """Make the folder and try to write in it; raises `UserError` before any work is done."""
    if folder.suffix.lower() in FILE_ENDINGS and not folder.exists():
        raise UserError(
            f"{folder} is called as a file, and a folder is written; say {folder.with_suffix('')}, for one."
        )
    missing: list[Path] = []
    try:
        missing += [p for p in (folder, *folder.parents) if not p.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        for made in missing:
            if made.is_dir():
                made.rmdir()
        cause = error.strerror or type(error).__name__
        name = str(folder) if len(str(folder)) <= LONGEST_NAME else f"{str(folder)[:LONGEST_NAME]}…"
        raise UserError(f"{name} cannot be written ({cause}); choose another folder.") from None


def _write_json(here: Session) -> None:
    if here.json_target is None:
        return
    data = {"pliant": __version__, "command": here.command, **here.result}
    text = json.dumps(plain(data), indent=1, allow_nan=False)
    if here.json_target == "-":
        sys.stdout.write(text + "\n")
        return
    path = Path(here.json_target)
    try:
        if path.exists() and not path.is_file():  # /dev/null, a pipe: to be written into, never replaced
            path.write_text(text + "\n", encoding="utf-8")
        else:
            write_atomically(path.resolve(), text + "\n")
    except OSError as error:
        raise UserError(f"--json: {path} cannot be written ({error.strerror}).") from None


class VisibleConsole(Console):
    """rich's console; control codes in texts become "�", its own colours and cursor movements stay."""

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        """Segments of anything that rich prints."""
        for segment in super().render(renderable, options):
            shown = visible(segment.text)
            ours = segment.control or shown == segment.text
            yield segment if ours else Segment(shown, segment.style)
