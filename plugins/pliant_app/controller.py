"""Answers to the page's requests, by the functions of the commands; every change is on disk before the answer."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant import __version__, api
from pliant.config.writing import study_name_from_path
from pliant.errors import PliantError, UserError
from pliant.formatting import displayed_in, listed, output_unit
from pliant.measurements.files import expand_sources
from pliant.measurements.written_units import units_as_written
from pliant.pipeline.study import build_study_chain
from pliant.registry.discovery import discover
from pliant.store.store import write_atomically
from pliant_app import describing, work
from pliant_app.exports import SessionExporter
from pliant_app.folder import SessionFolder, result_key
from pliant_app.jobs import Job
from pliant_app.open_model import OpenModel
from pliant_app.page_state import Effects, PageState, PageStep, as_effects
from pliant_app.screening import screened
from pliant_app.session import PageSession
from pliant_app.uploads import MOST_BYTES, STUDIES, TABLES, checked_study, holds_notes, too_large
from pliant_app.view_model import curves, failing, predicted_points, recording, space


class SessionController(PageSession):
    """A session that answers requests and takes commands; `exports` writes its exports."""

    def __init__(self, folder: SessionFolder, store: Path) -> None:
        super().__init__(folder, store)
        self.exports = SessionExporter(self)

    def begin(self, study: Path | None, data: Sequence[Path]) -> None:
        """Open the study and data of the command, or continue the stored session and resume its interrupted work."""
        with self.lock:
            begun = self.state.steps[0].data if self.state.steps else self.state.data
            wanted = str(study.resolve()) if study is not None else self.state.study
            files = tuple(str(file.resolve()) for file in data) or (
                () if study is not None and wanted != self.state.study else self.state.data
            )
            if wanted != self.state.study or files not in (self.state.data, begun):
                self.keep(PageState(wanted, files, version=self.state.version))
            if self.state.study:
                self.opened()
            if self.state.pending:
                pending = dict(self.state.pending)
                if pending["what"] == "describe":
                    self.solve(self.folder.files / pending["file"])
                    return
                self.run(pending["what"], pending.get("kinds", ()), pending.get("learned", False))

    # Queries

    def status(self) -> dict[str, Any]:
        """Return a small status that is polled every second: version, changed user effect files, and running work."""
        self.read_changed()
        job = self.runner.job
        study = Path(self.state.study).name
        return {"version": self.state.version, "study": study, "job": None if job is None else job.as_json()}

    def view(self) -> dict[str, Any]:
        """Return the state of the page except its curves."""
        with self.lock:
            state = self.state
            whole: dict[str, Any] = {
                "pliant": __version__,
                "version": state.version,
                "study": Path(state.study).name,
                "data": [Path(one).name for one in state.data],
                "dropped": sorted(one.name for one in self.folder.files.iterdir() if one.name[0] != "."),
                "folder": str(self.folder.path),
                "said": self.said[-3:],
                "most": {"bytes": MOST_BYTES, "sentence": str(too_large())},
                "model": None,
            }
            if not state.study:
                return whole | {"recording": recording(self.state.data)}
            try:
                model = self.opened()
            except PliantError as error:
                return whole | {"refused": str(error), "recording": recording(self.state.data)}
            with displayed_in(units_as_written(model.measurement)):
                return whole | {"model": self.shown(model)}

    def curves(self) -> dict[str, Any]:
        """Return the points of the pictures; they do not change with the effects."""
        with self.lock:
            model = self.now()
            with displayed_in(units_as_written(model.measurement)):
                return curves(model, model.predicted(model.own_effects))

    def preview(self, values: Effects, parts: int = 0) -> dict[str, Any]:
        """Return the prediction with these effects and its errors; `parts`: steps between samples, 0 for as needed."""
        model, now = self.present()
        with displayed_in(units_as_written(model.measurement)):
            try:
                predicted = model.quick(values, parts) if parts else model.predicted(values)
                used = parts or model.parts(values)
            except ValidationError as error:
                raise UserError(f"out of bounds: {error.errors()[0]['msg']}.") from None
            noise = model.noise(model.predicted(now.effects) if parts else predicted)
            return {
                "predicted": predicted_points(model, predicted),
                "errors": vars(model.errors(predicted, noise)),
                "floors": {
                    name: output_unit(name).factor * floor.value
                    for name, floor in noise.floors.items()
                    if floor.value > 0.0
                },
                "floor_from": {name: floor.source for name, floor in noise.floors.items()},
                "parts": used,
            }

    def space(self, values: Effects, run: str) -> dict[str, Any]:
        """Return the robot in three dimensions through a run with these effects."""
        model = self.now()
        with displayed_in(units_as_written(model.measurement)):
            return space(model, values, run)

    def where(self) -> dict[str, Any]:
        """Return where the present model fails on the training runs, in words and as a table."""
        with self.slow:
            model, now = self.present()
            with displayed_in(units_as_written(model.measurement)):
                return failing(model.comparison(now.effects))

    def screen(self) -> dict[str, Any]:
        """Return what every effect could explain of the residual; cached under the model."""
        with self.slow:
            model, now = self.present()
            key = result_key("screen", model.key, now.effects)
            found = self.folder.result(key)
            if found is None:
                with displayed_in(units_as_written(model.measurement)):
                    found = screened(model, now.effects)
                self.folder.keep_result(key, found)
            return found

    # Commands

    def take(self, name: str) -> None:
        """Take a dropped file: open a study, merge a recording with the loaded ones, or apply notes to a recording."""
        with self.lock:
            path = self.folder.files / name
            if path.suffix.lower() in STUDIES:
                try:
                    if holds_notes(path):
                        self._note(path)
                        return
                    checked_study(path)
                except PliantError:
                    path.unlink(missing_ok=True)
                    raise
                self.keep(PageState(str(path), self.state.data, version=self.state.version))
            elif self.state.steps:
                self._add(path)
                return
            else:
                dropped = tuple(dict.fromkeys((*self.state.data, str(path))))
                self.keep(PageState(self.state.study, dropped, version=self.state.version))
            self.close()

    def _note(self, path: Path) -> None:
        """Read the recordings again with dropped notes, which are stored next to the recording of their name.

        Raises:
            UserError: no dropped recording has their name.
        """
        if str(path) == self.state.study:
            raise UserError(f"{path.name} is the open study; write the notes into its 'measurements' block.")
        recordings = [one for one in self.folder.files.iterdir() if one.suffix.lower() in TABLES]
        mine = [one.name for one in recordings if one.stem == path.stem]
        if not mine:
            names = listed([f"{one.stem}.yaml" for one in recordings])
            raise UserError(
                f"{path.name} holds notes on a recording, and none that was dropped is called so; "
                + (f"name it {names}." if names else "drop the recording first.")
            )
        self.keep(PageState(self.state.study, self.state.data, version=self.state.version))
        self.close()
        self.said.append(f"{mine[0]} is read with the notes of {path.name} now.")

    def _add(self, path: Path) -> None:
        """Merge a recording with those of the open study, replacing one of the same name. Undo removes it.

        Raises:
            UserError: work is under way, or they cannot form one measurement; nothing is changed then.
        """
        if self.runner.job is not None:
            raise UserError("work is under way; stop it or wait, then add the file again.")
        before, notes = self.state, self.now().study.measurements
        named = before.data or (expand_sources(notes.file) if notes is not None else ())
        data = (*(str(one) for one in named if Path(one).name != path.name), str(path))
        step = PageStep(f"added {path.name}", before.now.effects, before.now.off, "", data)
        self.close()
        self.keep(before.with_step(step))
        try:
            self.opened()
        except PliantError:
            self.keep(replace(before, version=self.state.version))
            if str(path) not in before.data:
                path.unlink(missing_ok=True)
            raise
        if len(data) > 1:
            names = listed([Path(one).name for one in data])
            self.said.append(f"{names} are one measurement now. Undo leaves {path.name} out again.")

    def form(self) -> dict[str, Any]:
        """Return the form that describes a robot, with the dropped tables."""
        return {**describing.form(discover()), "tables": self._tables()}

    def describe(self, values: Mapping[str, Any]) -> None:
        """Write the study of a filled-in form, solve its law, and open it.

        Raises:
            UserError: the study cannot be read, or other work is under way.
        """
        with self.lock:
            text = describing.described(values, self._tables())
            path = (
                self.folder.files / f"{study_name_from_path(Path(str(values.get('name') or 'robot')))}.yaml"
            )
            before = path.read_text(encoding="utf-8") if path.exists() else None
            write_atomically(path, text)
            try:
                checked_study(path)
                api.open_study(path, store=self.store)
            except PliantError as error:
                write_atomically(path, before) if before is not None else path.unlink()
                raise UserError(
                    re.sub(rf"{re.escape(str(path))}(, line \d+)?", "the form", str(error))
                ) from None
            table = str(values.get("table", "")) if values.get("way") == "data" else ""
            kept = tuple(one for one in self.state.data if Path(one).name != table)
            self.keep(replace(self.state, data=kept))
            self.solve(path)

    def solve(self, path: Path) -> None:
        """Solve or fit the law of a described study, then open it."""

        def go(job: Job) -> None:
            job.words = "the law of one module; what is solved once is kept"
            opened = api.open_study(path, store=self.store, progress=job)
            build_study_chain(opened.context, opened.study)

        def ended(job: Job, said: str) -> None:
            with self.lock:
                self.keep(replace(self.state, pending=None))
                if said:
                    self.said.append(said)
                else:
                    self.take(path.name)

        self.keep(replace(self.state, pending={"what": "describe", "file": path.name}))
        self.runner.begin(
            Job("describe", result_key("describe", path.read_text(encoding="utf-8"))), go, ended
        )

    def forget(self, name: str) -> None:
        """Leave a recording out of the session; its file stays."""
        with self.lock:
            kept = tuple(one for one in self.state.data if Path(one).name != name)
            self.keep(PageState(self.state.study, kept, version=self.state.version))
            self.close()

    def step(self, effects: Effects, off: Sequence[str], words: str) -> None:
        """Make a model with these effects the present one; raises `UserError` for impossible effects."""
        with self.lock:
            model = self.now()
            try:
                made = model.effects(effects)
            except (ValidationError, KeyError) as error:
                raise UserError(f"these effects cannot be: {error}") from None
            plain = tuple(one.canonical() for one in made)
            result = self.state.now.result if plain == self.state.now.effects else ""
            named = tuple(run.name for run in model.measurement.runs if run.name in set(off))
            aside = {model.measurement.runs[k].name for k in model.without(()).split.runs}
            if all(run.name in aside or run.name in named for run in model.measurement.runs):
                raise UserError("one run at least must stay on that is not held out.")
            changed = named != self.state.now.off
            if any(one.result for one in self.state.steps[self.state.cursor + 1 :]):
                self.said.append("Undone steps are gone from the list; the same fit is there again at once.")
            step = PageStep(
                words[:120] or "by hand", plain, named, "" if changed else result, self.state.data
            )
            self.keep(self.state.with_step(step))

    def toggle(self, run: str, on: bool) -> None:
        """Switch a run on or off, keeping other choices made in the meantime."""
        with self.lock:
            off = [one for one in self.state.now.off if one != run]
            self.step(self.state.now.effects, off if on else [*off, run], f"{run} {'on' if on else 'off'}")

    def tick(self, kind: str, on: bool) -> None:
        """Add an effect with its initial values, or remove it, keeping other choices made in the meantime."""
        with self.lock:
            begun = [one["begun"] for one in self.listed(self.now()) if one["kind"] == kind]
            kept = [one for one in self.state.now.effects if one["kind"] != kind]
            if on and not begun:
                raise UserError(f"there is no effect '{kind}' here.")
            words = f"ticked {kind}" if on else f"took {kind} out"
            self.step(as_effects([*kept, *begun] if on else kept), self.state.now.off, words)

    def go(self, cursor: int) -> None:
        """Go to another step (undo and redo)."""
        with self.lock:
            self.keep(self.state.at(cursor))

    def run(self, what: str, kinds: Sequence[str] = (), learned: bool = False) -> None:
        """Begin long work, or show its cached result at once.

        Args:
            what: "fit", "diagnose" or "improve".
            kinds: effects to fit.
            learned: whether a learned term may be the last step of an improvement.

        Raises:
            UserError: an unknown `what`, nothing to fit, or other work under way.
        """
        with self.lock:
            model, now = self.now(), self.state.now
            own = {effect.kind for effect in model.study.effects}
            forms = work.varied_forms(kinds, self._diagnoses(model)) if what == "fit" else []
            ways: dict[str, tuple[Any, Callable[[work.ModelWork, str], dict[str, Any]]]] = {
                "fit": (
                    [
                        sorted(kinds),
                        [one for one in now.effects if one["kind"] not in set(kinds) and one["kind"] in own],
                        *([forms] if forms else []),
                    ],
                    lambda task, key: work.fit(task, self.folder, key, sorted(kinds), forms),
                ),
                "diagnose": (now.effects, lambda task, key: work.diagnose(task, self.folder, key)),
                "improve": (
                    [model.own_effects, learned],
                    lambda task, key: work.improve(task, self.folder, key, learned),
                ),
            }
            if what not in ways:
                raise UserError(f"there is no '{what}' here.")
            if what == "fit" and not kinds:
                raise UserError("tick an effect first: there is nothing to fit.")
            depends, does = ways[what]
            key = result_key(what, model.key, depends)
            if (known := self.folder.result(key)) is not None:
                self._take_result(what, key, known, now)
                return
            units = units_as_written(model.measurement)

            def go(job: Job) -> None:
                task = work.ModelWork(model, now.effects, job.tick, job.stop.is_set)
                with displayed_in(units):
                    found = does(task, key)
                self.folder.keep_result(key, found)

            self.keep(replace(self.state, pending={"what": what, "kinds": list(kinds), "learned": learned}))
            self.runner.begin(Job(what, key), go, lambda job, said: self._ended(job, said, now))

    def stop(self) -> None:
        """Stop the running work."""
        self.runner.stop()

    def _tables(self) -> list[str]:
        """Return the names of dropped tables."""
        found = (one.name for one in self.folder.files.iterdir() if one.name[0] != ".")
        return sorted(name for name in found if Path(name).suffix.lower() in TABLES)

    def _diagnoses(self, model: OpenModel) -> list[tuple[Effects, Mapping[str, Any]]]:
        """Return the diagnoses of the steps up to the present one, each with the effects of its model."""
        history = [step.effects for step in self.state.steps[: self.state.cursor + 1]]
        found = [(one, self.folder.result(result_key("diagnose", model.key, one))) for one in history]
        return [(effects, result) for effects, result in found if result is not None]

    def _ended(self, job: Job, said: str, began: PageStep) -> None:
        with self.lock:
            if said:
                self.said.append(said)
            self.keep(replace(self.state, pending=None))
            if not said and (found := self.folder.result(job.key)) is not None:
                self._take_result(job.what, job.key, found, began)

    def _take_result(self, what: str, key: str, found: Mapping[str, Any], began: PageStep) -> None:
        """Make a fit or an improvement the present model; a diagnosis does not change the model."""
        if what == "diagnose":
            self.keep(self.state)
            return
        named = listed(found["kinds"])
        words = {"fit": f"fitted {named}", "improve": f"improved: {named}" if named else "improved"}[what]
        step = PageStep(words, as_effects(found["effects"]), began.off, key, began.data)
        if what == "improve" and not found["kinds"]:
            self.said.append(str(found["sentence"]))
        self.keep(self.state.with_step(step))
