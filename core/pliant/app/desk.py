"""What the page asks, answered by the commands' engine; every change is on disk before it is answered."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant import __version__, api
from pliant.app import describing, work
from pliant.app.folder import SessionFolder, key_of
from pliant.app.inbox import MOST_BYTES, STUDIES, TABLES, checked_study, too_large
from pliant.app.jobs import Job
from pliant.app.leaving import Leaving
from pliant.app.open_model import OpenModel
from pliant.app.page_state import Effects, PageState, PageStep, as_effects
from pliant.app.screening import screened
from pliant.app.session import PageSession
from pliant.app.showing import curves, failing, predicted_points, recording, space
from pliant.config.writing import name_of_file
from pliant.errors import PliantError, UserError
from pliant.formatting import displayed_in, listed, unit_of
from pliant.measurements.files import sources_of
from pliant.measurements.written_units import units_as_written
from pliant.pipeline.study import chain_of_study
from pliant.registry.discovery import discover
from pliant.store.store import write_atomically


class Desk(PageSession):
    """A session that is asked and told; what it leaves behind is written by `leaving`."""

    def __init__(self, folder: SessionFolder, store: Path) -> None:
        super().__init__(folder, store)
        self.leaving = Leaving(self)

    def begin(self, study: Path | None, data: Sequence[Path]) -> None:
        """Open what the command names, or go on where the session was; work that was cut off is taken up."""
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

    # What is there

    def pulse(self) -> dict[str, Any]:
        """Small enough to ask every second: whether anything changed, a user's own effect too, and what runs."""
        self.read_changed()
        job = self.bench.job
        study = Path(self.state.study).name
        return {"version": self.state.version, "study": study, "job": None if job is None else job.as_json()}

    def view(self) -> dict[str, Any]:
        """Everything but the curves."""
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
        """The points of the pictures; they do not change with the effects."""
        with self.lock:
            model = self.now()
            with displayed_in(units_as_written(model.measurement)):
                return curves(model, model.predicted(model.own_effects))

    def preview(self, values: Effects, parts: int = 0) -> dict[str, Any]:
        """The prediction with these effects, and its errors; `parts` steps between samples, as needed where 0."""
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
                    name: unit_of(name).factor * floor.value
                    for name, floor in noise.floors.items()
                    if floor.value > 0.0
                },
                "floor_from": {name: floor.source for name, floor in noise.floors.items()},
                "parts": used,
            }

    def space(self, values: Effects, run: str) -> dict[str, Any]:
        """The robot through a run with these effects, in three dimensions."""
        model = self.now()
        with displayed_in(units_as_written(model.measurement)):
            return space(model, values, run)

    def where(self) -> dict[str, Any]:
        """Where the present model fails on the training runs, in words and as a table."""
        with self.slow:
            model, now = self.present()
            with displayed_in(units_as_written(model.measurement)):
                return failing(model.comparison(now.effects))

    def screen(self) -> dict[str, Any]:
        """What every effect could explain of what is left; kept under the model."""
        with self.slow:
            model, now = self.present()
            key = key_of("screen", model.key, now.effects)
            found = self.folder.result(key)
            if found is None:
                with displayed_in(units_as_written(model.measurement)):
                    found = screened(model, now.effects)
                self.folder.keep_result(key, found)
            return found

    # What is done

    def take(self, name: str) -> None:
        """A file was dropped: a study is opened, a recording goes beside those that are there."""
        with self.lock:
            path = self.folder.files / name
            if path.suffix.lower() in STUDIES:
                try:
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

    def _add(self, path: Path) -> None:
        """A recording goes beside those of the open study; one of the same name is replaced. Undo leaves it out.

        Raises:
            UserError: work is under way, or they cannot be one measurement; then nothing has changed.
        """
        if self.bench.job is not None:
            raise UserError("work is under way; stop it or wait, then add the file again.")
        before, notes = self.state, self.now().study.measurements
        named = before.data or (sources_of(notes.file) if notes is not None else ())
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
        """The form that describes a robot, with the tables that were dropped."""
        return {**describing.form(discover()), "tables": self._tables()}

    def describe(self, values: Mapping[str, Any]) -> None:
        """Write the study of a form that was filled in, solve its law, and open it.

        Raises:
            UserError: it is no study that can be read, or other work is under way.
        """
        with self.lock:
            text = describing.described(values, self._tables())
            path = self.folder.files / f"{name_of_file(Path(str(values.get('name') or 'robot')))}.yaml"
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
        """Solve or fit the law of a study that was described, then open it."""

        def go(job: Job) -> None:
            job.words = "the law of one module; what is solved once is kept"
            opened = api.open_study(path, store=self.store, progress=job)
            chain_of_study(opened.bench, opened.study)

        def ended(job: Job, said: str) -> None:
            with self.lock:
                self.keep(replace(self.state, pending=None))
                if said:
                    self.said.append(said)
                else:
                    self.take(path.name)

        self.keep(replace(self.state, pending={"what": "describe", "file": path.name}))
        self.bench.begin(Job("describe", key_of("describe", path.read_text(encoding="utf-8"))), go, ended)

    def forget(self, name: str) -> None:
        """Leave a recording out of the session; its file stays."""
        with self.lock:
            kept = tuple(one for one in self.state.data if Path(one).name != name)
            self.keep(PageState(self.state.study, kept, version=self.state.version))
            self.close()

    def step(self, effects: Effects, off: Sequence[str], words: str) -> None:
        """Go on with another model; raises `UserError` for effects that cannot be."""
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
                raise UserError("one run at least must stay on that is not put aside.")
            changed = named != self.state.now.off
            if any(one.result for one in self.state.steps[self.state.cursor + 1 :]):
                self.said.append("Undone steps are gone from the list; the same fit is there again at once.")
            step = PageStep(
                words[:120] or "by hand", plain, named, "" if changed else result, self.state.data
            )
            self.keep(self.state.with_step(step))

    def toggle(self, run: str, on: bool) -> None:
        """Switch a run on or off, whatever else was chosen meanwhile."""
        with self.lock:
            off = [one for one in self.state.now.off if one != run]
            self.step(self.state.now.effects, off if on else [*off, run], f"{run} {'on' if on else 'off'}")

    def tick(self, kind: str, on: bool) -> None:
        """Add an effect as it begins, or take it out, whatever else was chosen meanwhile."""
        with self.lock:
            begun = [one["begun"] for one in self.listed(self.now()) if one["kind"] == kind]
            kept = [one for one in self.state.now.effects if one["kind"] != kind]
            if on and not begun:
                raise UserError(f"there is no effect '{kind}' here.")
            words = f"ticked {kind}" if on else f"took {kind} out"
            self.step(as_effects([*kept, *begun] if on else kept), self.state.now.off, words)

    def go(self, cursor: int) -> None:
        """Undo and redo: look at another step."""
        with self.lock:
            self.keep(self.state.at(cursor))

    def run(self, what: str, kinds: Sequence[str] = (), learned: bool = False) -> None:
        """Begin long work, or show at once what it gave before.

        Args:
            what: "fit", "diagnose" or "improve".
            kinds: effects to fit.
            learned: whether a learned term may be the last step of an improvement.

        Raises:
            UserError: it is none of these, or there is nothing to fit, or other work is under way.
        """
        with self.lock:
            model, now = self.now(), self.state.now
            own = {effect.kind for effect in model.study.effects}
            forms = work.forms_of(kinds, self._diagnoses(model)) if what == "fit" else []
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
            key = key_of(what, model.key, depends)
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
            self.bench.begin(Job(what, key), go, lambda job, said: self._ended(job, said, now))

    def stop(self) -> None:
        """Stop the work that runs."""
        self.bench.stop()

    def _tables(self) -> list[str]:
        """Names of tables that were dropped."""
        found = (one.name for one in self.folder.files.iterdir() if one.name[0] != ".")
        return sorted(name for name in found if Path(name).suffix.lower() in TABLES)

    def _diagnoses(self, model: OpenModel) -> list[tuple[Effects, Mapping[str, Any]]]:
        """Those of the models on the way to the present one, with the effects that each looked at."""
        way = [step.effects for step in self.state.steps[: self.state.cursor + 1]]
        found = [(one, self.folder.result(key_of("diagnose", model.key, one))) for one in way]
        return [(effects, result) for effects, result in found if result is not None]

    def _ended(self, job: Job, said: str, began: PageStep) -> None:
        with self.lock:
            if said:
                self.said.append(said)
            self.keep(replace(self.state, pending=None))
            if not said and (found := self.folder.result(job.key)) is not None:
                self._take_result(job.what, job.key, found, began)

    def _take_result(self, what: str, key: str, found: Mapping[str, Any], began: PageStep) -> None:
        """A fit or an improvement becomes the present model; a diagnosis stands beside it."""
        if what == "diagnose":
            self.keep(self.state)
            return
        named = listed(found["kinds"])
        words = {"fit": f"fitted {named}", "improve": f"improved: {named}" if named else "improved"}[what]
        step = PageStep(words, as_effects(found["effects"]), began.off, key, began.data)
        if what == "improve" and not found["kinds"]:
            self.said.append(str(found["sentence"]))
        self.keep(self.state.with_step(step))
