"""A session: its state on disk, the open models, the running work."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant.errors import PliantError, UserError
from pliant.formatting import listed
from pliant_app.folder import SessionFolder
from pliant_app.jobs import JobRunner
from pliant_app.open_model import OpenModel
from pliant_app.own_files import Watch
from pliant_app.page_state import PageState, PageStep, as_effects
from pliant_app.screening import catalogue
from pliant_app.view_model import shown

AS_IT_IS = "the study as it is"


class PageSession:
    """The session of one page.

    Attributes:
        state: its present state; every change is kept on disk.
        runner: the running work.
        said: messages of the page, newest last.
        lock: held while the state is read or changed.
        slow: held by one slow request at a time; sliders do not wait for it.
    """

    def __init__(self, folder: SessionFolder, store: Path) -> None:
        self.folder, self.store = folder, store
        self.state: PageState = folder.state()
        self.runner = JobRunner()
        self.said: list[str] = []
        self._models: dict[tuple[str, tuple[str, ...]], OpenModel] = {}
        self._catalogue: list[dict[str, Any]] | None = None
        self._watch = Watch()
        self.lock = threading.RLock()
        self.slow = threading.Lock()

    def keep(self, state: PageState) -> None:
        """Change the state, on disk before any answer."""
        self.state = state.changed()
        self.folder.keep(self.state)

    def close(self) -> None:
        """Close the models; they are opened again on request."""
        self._models.clear()

    def opened(self) -> OpenModel:
        """Return the model of the state's files; opened once."""
        way = list(
            dict.fromkeys([*(one.data for one in self.state.steps[: self.state.cursor]), self.state.data])
        )
        earlier = None
        for data in way[: way.index(self.state.data) + 1]:
            if (self.state.study, data) not in self._models:
                files = [Path(one) for one in data]
                earlier = OpenModel.open(Path(self.state.study), files, self.store, earlier)
                self._models[self.state.study, data], self._catalogue = earlier, None
                self._watch = Watch(earlier.study.plugins)
            earlier = self._models[self.state.study, data]
        assert earlier is not None
        if not self.state.steps:
            first = PageStep(AS_IT_IS, as_effects(earlier.own_effects), data=self.state.data)
            self.keep(replace(self.state, steps=(first,), cursor=0))
        held = self._models[self.state.study, self.state.data] = earlier.without(self.state.now.off)
        return held

    def now(self) -> OpenModel:
        """Return the present model; raises `UserError` where no study is open."""
        with self.lock:
            if not self.state.study:
                raise UserError("no study is open; drop one, or choose an example.")
            return self.opened()

    def present(self) -> tuple[OpenModel, PageStep]:
        """Return the present model and step, consistent with each other."""
        with self.lock:
            return self.now(), self.state.now

    def shown(self, model: OpenModel) -> dict[str, Any]:
        """Return everything of a model except its curves, as JSON values."""
        return shown(model, self.state, self.folder, self.listed(model))

    def listed(self, model: OpenModel) -> list[dict[str, Any]]:
        """Return the effects that can be ticked."""
        if self._catalogue is None:
            self._catalogue = catalogue(model)
        return self._catalogue

    def read_changed(self) -> None:
        """Read changed files of the study's own effects again, as the command line would."""
        if changed := self._watch.changed():
            self._reload([file.name for file in changed])

    def _reload(self, files: Sequence[str]) -> None:
        with self.lock:
            self.close()
            self.keep(self.state)
            self.said.append(f"{listed(files)} changed and is read anew.")
            try:
                self.opened().effects(self.state.now.effects)
            except PliantError:
                pass  # the view shows the error in the file; the corrected file is read again
            except ValidationError:
                self.said.append(f"The effects of this step are no longer what {listed(files)} says; undone.")
                self.keep(self.state.at(0))
