"""One call of the command line: where it prints, what it returns, and its exit code."""

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
from pliant.config.places import Places
from pliant.config.study import Study
from pliant.errors import INTERRUPTED, PliantError, UserError, interrupted
from pliant.pipeline.workbench import RunContext
from pliant.records.measurement import Measurement
from pliant.records.plain_values import plain as plain
from pliant.registry.blame import blamed
from pliant.registry.data_kind import MeasuredData
from pliant.registry.discovery import discover, left_out, without_unusable
from pliant.report.document import Document
from pliant.report.render import page, terminal
from pliant.report.stage import StoredPage, write_page
from pliant.report.stored_answer import StoredAnswer
from pliant.store.store import ArtifactStore, write_atomically
from pliant.user_text import escape_controls

LONGEST_NAME = 80
# Endings of files, which are refused for folders.
FILE_ENDINGS = (".yaml", ".yml", ".json", ".html", ".csv")


@dataclass
class Session:
    """The context of one verb. `result` becomes the JSON, `say` prints for people.

    `path`, `study_name`, `places` and `overrides` belong to the study that was read, `installed` contains the plugins
    that were known before; `until_end` keeps contexts that last as long as the verb.
    """

    command: str
    json_target: str | None = None
    quiet: bool = False
    result: dict[str, Any] = field(default_factory=dict)
    exit_code: int = 0
    store: Path = Path()
    path: Path = Path()
    study_name: str = ""
    places: Places = field(default_factory=Places)
    overrides: tuple[str, ...] = ()
    until_end: ExitStack = field(default_factory=ExitStack)

    def __post_init__(self) -> None:
        # With JSON on standard output, text for people is written to standard error.
        self.out = VisibleConsole(stderr=self.json_target == "-", highlight=False, soft_wrap=True)
        self.err = VisibleConsole(stderr=True, highlight=False)
        self.installed = self.registry = discover()

    def say(self, text: object = "", markup: bool = False) -> None:
        """Print for people, unless --quiet; `markup` reads rich's tags, so foreign text must be escaped."""
        if not self.quiet:
            self.out.print(text, markup=markup)

    def show(
        self, document: Document, folder: Path | None = None, stored: StoredPage | StoredAnswer | None = None
    ) -> None:
        """Print a document, keep its JSON, and write its page, `stored` or not, if there is a folder for it."""
        self.result.update(document.data)
        for block in terminal(document, has_page=folder is not None):
            self.say(block)
        if folder is not None:
            made = page(document) if stored is None else stored.render(document)
            written = write_page(folder, made.html, made.pictures, document.page)
            self.result.update(out=str(folder), report=str(written))
            self.say(f"report   {written}")

    def study(self, path: Path, overrides: Sequence[str] | None, uses: Sequence[str] = ()) -> Study:
        """Read the study, register the plugins that it lists, and note which of its keys this verb does not read.

        `uses` names keys that this verb alone reads.
        """
        self.path, self.overrides = path, tuple(overrides or ())
        study = load_study(path, self.registry, self.overrides, self.progress.note)
        self.registry = study.registry(self.registry)
        self.study_name, self.places = study.name, study.places
        if unused := [key for key in study.unused() if key not in uses]:
            self.progress.note(f"{', '.join(unused)}: read, but not used by '{self.command}'.")
        for verb, keys in study.read_by().items():
            others = [key for key in keys if key not in uses]
            if others and verb != self.command:
                self.progress.note(
                    f"{', '.join(others)}: for 'pliant {verb}'; '{self.command}' takes the study as it is."
                )
        return study

    def leave_out_broken_effects(self) -> None:
        """Remove effects that cannot be used from the registry, and report them."""
        self.registry = without_unusable(self.registry, "effect")
        self.note_left_out("effect")

    def note_left_out(self, *interfaces: str) -> None:
        """Report which plugins of these interfaces cannot be used; the verb continues without them."""
        failures = left_out(self.registry, interfaces)
        for failure in failures:
            self.progress.note(f"left out: {failure.sentence}")
        if failures:
            self.result["left_out_plugins"] = [vars(failure) for failure in failures]

    def measured(self, study: Study, data: Measurement | MeasuredData) -> None:
        """Record for the JSON which study was compared with which data."""
        self.result.update(study=study.name, data=data.source, data_sha256=data.sha256)

    @property
    def progress(self) -> TerminalProgress:
        """Return the progress display on standard error."""
        return TerminalProgress(self.err, self.quiet)

    def context(self) -> RunContext:
        """Return a workbench on the verb's store."""
        return RunContext(
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
        here.err.print(f"[bold red]error:[/] {escape(here.places.located(str(error)))}", soft_wrap=True)
        raise typer.Exit(error.exit_code) from None
    except OSError as error:  # a name or a disk that no earlier check could detect
        place = f"{error.filename}: " if error.filename else ""
        here.err.print(f"error: {place}{error.strerror or error}.", markup=False, soft_wrap=True)
        raise typer.Exit(UserError.exit_code) from None
    except KeyboardInterrupt:
        _stop(here)
    except Exception as error:
        if interrupted(error):
            _stop(here)
        sentence = blamed(error, here.registry.components)  # plugins that are not shipped may fail in any way
        if sentence is None:
            raise
        here.err.print(f"[bold red]error:[/] {escape(sentence)}", soft_wrap=True)
        raise typer.Exit(UserError.exit_code) from None
    if here.exit_code:
        raise typer.Exit(here.exit_code)


def _stop(session: Session) -> NoReturn:
    session.err.print("interrupted; finished work is kept, run the same command to continue.")
    raise typer.Exit(INTERRUPTED) from None


def _check_json_target(target: str) -> None:
    """Raise `UserError` for a file that cannot be written, before any work is done."""
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
    """Create the folder and try to write in it; raises `UserError` before any work is done."""
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


def _write_json(session: Session) -> None:
    if session.json_target is None:
        return
    data = {"pliant": __version__, "command": session.command, **session.result}
    text = json.dumps(plain(data), indent=1, allow_nan=False)
    if session.json_target == "-":
        sys.stdout.write(text + "\n")
        return
    path = Path(session.json_target)
    try:
        if path.exists() and not path.is_file():  # /dev/null, a pipe: written to, never replaced
            path.write_text(text + "\n", encoding="utf-8")
        else:
            write_atomically(path.resolve(), text + "\n")
    except OSError as error:
        raise UserError(f"--json: {path} cannot be written ({error.strerror}).") from None


class VisibleConsole(Console):
    """rich's console; control codes in texts become "�", its own colours and cursor movements are kept."""

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        """Yield the segments of anything that rich prints."""
        for segment in super().render(renderable, options):
            shown = escape_controls(segment.text)
            ours = segment.control or shown == segment.text
            yield segment if ours else Segment(shown, segment.style)
