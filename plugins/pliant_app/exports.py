"""Exports of a session: studies, its steps as commands or as a notebook, and the page as one file."""

from __future__ import annotations

import itertools
import json
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pliant.config.paths import change_paths
from pliant.config.writing import study_name_from_path, yaml_writer
from pliant.config.yaml_file import read_yaml
from pliant.errors import UserError
from pliant.formatting import displayed_in, listed, number
from pliant.measurements.written_units import units_as_written
from pliant.report.comparison import comparison_document
from pliant.report.document import Document, Drawn, Section, Table, Warned
from pliant.report.render import page
from pliant.store.store import write_atomically
from pliant_app import work
from pliant_app.folder import result_key
from pliant_app.open_model import OpenModel
from pliant_app.page_state import Effects
from pliant_app.session import PageSession

# The exports that accompany a saved study, and their endings.
KEPT = {"page": ".html", "notebook": ".ipynb", "commands": ".sh"}


def _utf8(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@dataclass(frozen=True)
class ModelHistory:
    """The steps that led to the present model.

    Attributes:
        study: the file that was opened.
        data: recordings used instead of the study's.
        diagnosed: whether one of the steps was a diagnosis.
        what: "fit", "improve", or "" for values set by hand.
        kinds: effects of the fit.
        learned: whether a learned term might be the last step of an improvement.
        saved: the file of the present model.
    """

    study: Path
    data: tuple[Path, ...]
    diagnosed: bool
    what: str
    kinds: tuple[str, ...]
    learned: bool
    saved: Path


class SessionExporter:
    """The exports of a session's present model; earlier files are kept."""

    def __init__(self, session: PageSession) -> None:
        self.session = session

    def save(self, name: str = "") -> dict[str, Any]:
        """Write the present model as a new study and return its path, its text and commands."""
        with self.session.lock:
            for target in self._targets(name):
                text = self._written(target.name)
                if not target.exists() or target.read_text(encoding="utf-8") == text:
                    break
            write_atomically(target, text)
            return {
                "name": target.name,
                "path": str(target),
                "yaml": text,
                "commands": commands(self._history(target)),
            }

    def keep(self, what: str, name: str = "") -> dict[str, Any]:
        """Save the study together with the whole page, or with its steps as a notebook or as commands.

        Raises:
            UserError: `what` is not `page`, `notebook` or `commands`.
        """
        if what not in KEPT:
            raise UserError(f"'{what}' cannot be kept; choose one of {listed(list(KEPT))}.")
        with self.session.slow:
            model, now = self.session.present()
            saved = self.save(name)
            history = self._history(Path(saved["path"]))
            target = Path(saved["path"]).with_suffix(KEPT[what])
            with displayed_in(units_as_written(model.measurement)):
                if what == "page":
                    text = saved_page(model, now.effects, self.session.shown(model), saved["commands"])
                elif what == "notebook":
                    text = notebook(history, model.study.name)
                else:
                    text = "\n".join(["#!/bin/sh", "set -e", *saved["commands"], ""])
            write_atomically(target, text)
            return {
                **saved,
                "kept": target.name,
                "kept_path": str(target),
                "text": "" if what == "page" else text,
            }

    def as_yaml(self) -> dict[str, str]:
        """Return the present model as a study's text without writing a file."""
        with self.session.lock:
            name = f"{study_name_from_path(self.session.now().path)}+page.yaml"
            return {"yaml": self._written(name, anywhere)}

    def report(self) -> str:
        """Return `pliant compare`'s page of the present model on the training runs."""
        with self.session.slow:
            model, now = self.session.present()
            with displayed_in(units_as_written(model.measurement)):
                return page(present_document(model, now.effects)).html

    def _targets(self, name: str) -> Iterator[Path]:
        """Yield possible files for a study of that name, numbered so that no file needs to be overwritten."""
        stem = (
            study_name_from_path(Path(name))
            if name
            else f"{study_name_from_path(self.session.now().path)}+page"
        )
        stem = stem or "study"
        yield self.session.folder.saved / f"{stem}.yaml"
        for k in itertools.count(2):
            yield self.session.folder.saved / f"{stem}-{k}.yaml"

    def _written(self, name: str, read: Callable[[Path], str] = _utf8) -> str:
        """Return the present model as a study of that file name, read in a folder as deep as that of saved ones."""
        with TemporaryDirectory(dir=self.session.folder.path) as beside:
            target = Path(beside) / name
            self._write_study(target)
            return read(target)

    def _history(self, saved: Path) -> ModelHistory:
        """Return the steps that led to the present model."""
        model, now = self.session.now(), self.session.state.now
        known = self.session.folder.result(now.result) if now.result else None
        diagnosis = self.session.folder.result(result_key("diagnose", model.key, model.own_effects))
        found = known or {"what": "", "kinds": ()}
        kinds = tuple(found["kinds"]) if found["what"] == "fit" else ()
        learned = bool(found.get("learned"))
        return ModelHistory(
            model.path, model.data, diagnosis is not None, found["what"], kinds, learned, saved
        )

    def _write_study(self, target: Path) -> None:
        """Write the present model as a study: as its fit wrote it, else with the values set by hand."""
        model, now = self.session.now(), self.session.state.now
        known = self.session.folder.result(now.result) if now.result else None
        written = self.session.folder.results / str(known["study"]) if known and known.get("study") else None
        if written is not None and written.exists():
            write_atomically(target, written.read_text(encoding="utf-8"))
        else:
            work.write_by_hand(target, model, now.effects)


def commands(history: ModelHistory) -> list[str]:
    """Return the steps as commands, on all runs of the files; values set by hand are only in the saved study.

    A second run overwrites the study of the first, which is stored next to the saved one.
    """
    data = [word for file in history.data for word in ("--data", str(file))]
    lines = [["pliant", "compare", str(history.study), *data]]
    if history.diagnosed:
        lines.append(["pliant", "diagnose", str(history.study), *data])
    named = [word for kind in history.kinds for word in ("--effect", kind)]
    if history.what == "fit":
        lines.append(["pliant", "extend", str(history.study), *named, *data, *_beside(history, "fitted")])
    elif history.what == "improve":
        learned = ["--learned"] if history.learned else []
        lines.append(
            ["pliant", "improve", str(history.study), *learned, *data, *_beside(history, "improved")]
        )
    lines.append(["pliant", "compare", str(history.saved)])
    return [shlex.join(line) for line in lines]


def _beside(history: ModelHistory, word: str) -> list[str]:
    return ["--out", str(history.saved.with_name(f"{history.saved.stem}-{word}.yaml")), "--force"]


def notebook(history: ModelHistory, title: str) -> str:
    """Return the same as a Jupyter notebook (nbformat 4.5) without outputs."""
    files = [str(file) for file in history.data]
    given = f"data={files!r}" if files else ""

    def call(verb: str, *words: str) -> dict[str, Any]:
        return _cell("code", f"robot.{verb}({', '.join(filter(None, words))})")

    cells = [
        _cell("markdown", f"# {title}\n\nMade by `pliant app`. It runs on all runs of the files."),
        _cell(
            "code", f"import pliant\n\nrobot = pliant.open({str(history.study)!r})\nrobot.compare({given})"
        ),
    ]
    if history.diagnosed:
        cells.append(call("diagnose", given))
    if history.what == "fit":
        cells.append(call("extend", *map(repr, history.kinds), given))
    elif history.what == "improve":
        cells.append(call("improve", given, "learned=True" if history.learned else ""))
    cells += [
        _cell("markdown", "The model that was saved, with the values of the page:"),
        _cell("code", f"saved = pliant.open({str(history.saved)!r}).compare()\nsaved.plot(interactive=True)"),
    ]
    numbered = [{**cell, "id": f"cell-{k}"} for k, cell in enumerate(cells)]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    whole = {"cells": numbered, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def anywhere(study: Path) -> str:
    """Return a saved study's text with absolute paths of its files, for a copy in another folder."""
    tree = read_yaml(study)
    change_paths(tree, lambda named: str((study.parent / named).resolve()))
    stream = StringIO()
    yaml_writer().dump(tree, stream)
    return stream.getvalue()


def _cell(kind: str, text: str) -> dict[str, Any]:
    cell: dict[str, Any] = {"cell_type": kind, "metadata": {}, "source": text.splitlines(keepends=True)}
    return cell if kind == "markdown" else {**cell, "execution_count": None, "outputs": []}


def saved_page(
    model: OpenModel,
    effects: Effects,
    shown: Mapping[str, Any],
    lines: Sequence[str],
) -> str:
    """Return the page as one file: `pliant compare`'s report of the present model, with the steps, effects and doubts.

    Args:
        model, effects: the present ones.
        shown: JSON values of the page (`SessionController.view`'s model).
        lines: the steps as commands.
    """
    document = present_document(model, effects)
    added = [Warned(one) for one in shown["warnings"]]
    return page(
        replace(
            document,
            kind="Pliant: a saved evidence page",
            warnings=(*added, *document.warnings),
            draw=lambda: _with_sections(document.draw(), _steps(shown), _effects(shown), _commands(lines)),
        )
    ).html


def present_document(model: OpenModel, effects: Effects) -> Document:
    """Return `pliant compare` of the model with these effects on the training runs."""
    found = model.comparison(effects)
    return comparison_document(model.study.name, model.split.training, model.predicted(effects), found)


def _with_sections(drawn: Drawn, *sections: Section) -> Drawn:
    return replace(drawn, sections=(*sections, *drawn.sections))


def _steps(shown: Mapping[str, Any]) -> Section:
    def text(value: float | None) -> str:
        return "–" if value is None else number(value, 3)

    rows = [
        [
            str(k + 1),
            step["words"],
            text(step["aside"]),
            text(step["error"]),
            "fitted" if step["fitted"] else "",
        ]
        for k, step in enumerate(shown["steps"][: shown["cursor"] + 1])
    ]
    head = ["step", "model", "on runs held out", "on the other runs", ""]
    note = f"Errors in units of the noise. {shown['aside']}"
    return Section("The error, step by step", tables=(Table("", head, rows, note, numeric=2),), open=True)


def _effects(shown: Mapping[str, Any]) -> Section:
    sliders = {one["kind"]: one["sliders"] for one in shown["catalogue"]}
    fit = shown["fit"] or {"estimates": []}
    told = {(one["kind"], one["parameter"]): one["words"] for one in fit["estimates"]}
    rows = []
    for effect in shown["effects"]:
        for slider in sliders.get(effect["kind"], []):
            value = f"{number(effect[slider['name']] * slider['factor'], 4)} {slider['unit']}".strip()
            fitted = told.get((effect["kind"], slider["name"]), "set by hand")
            rows.append([effect["kind"], slider["words"], value, fitted])
    if not rows:
        return Section("Effects of this model", text=("The study has none.",))
    head = ["effect", "parameter", "value", "as it was fitted"]
    return Section("Effects of this model", tables=(Table("", head, rows, numeric=9),), open=True)


def _commands(lines: Sequence[str]) -> Section:
    return Section("The same by commands", code="\n".join(lines))
