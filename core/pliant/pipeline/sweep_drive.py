"""A sweep under way: jobs out, answers in, dead workers replaced, until no design is left."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import replace
from pathlib import Path

from pliant.config.designs import SweptDesign
from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.pipeline.crews import Crew
from pliant.pipeline.desk import desk_in
from pliant.pipeline.progress import Task
from pliant.pipeline.sweep_records import DesignOutcome
from pliant.pipeline.sweep_worker import Answer, Job
from pliant.pipeline.workbench import Workbench
from pliant.store.store import Artifact, CorruptedError, load_artifact

POLL_S = 0.5
ARRIVES_WITHIN_S = 90.0
STILLBORN = 2  # crews that died before any worker of theirs began


class Drive:
    """One sweep under way: jobs out, answers in, until none is left."""

    def __init__(
        self,
        bench: Workbench,
        study: Study,
        crew: Crew,
        bar: Task,
        missing: Mapping[int, tuple[SweptDesign, str]],
    ) -> None:
        self.bench, self.study, self.crew, self.bar, self.missing = bench, study, crew, bar, missing
        self.queue: deque[Job] = deque()
        self.suspects: deque[Job] = deque()  # ran when a worker died: each again, alone
        self.alone = False
        self.running: dict[Future[Answer], Job] = {}
        self.outcomes: dict[int, DesignOutcome] = {}
        self.stillborn = 0

    def run(self) -> dict[int, DesignOutcome]:
        """Outcomes by number."""
        whole = False
        with desk_in(self.bench.store.root) as self.desk:
            try:
                self.queue.extend(self._job(design, key) for design, key in self.missing.values())
                while self.queue or self.suspects or self.running:
                    self._submit()
                    ended, _ = wait(self.running, timeout=POLL_S, return_when=FIRST_COMPLETED)
                    self._take(ended)
                    self.bar.describe(self.desk.states(job.number for job in self.running.values()))
                whole = True
            finally:
                for future in self.running:
                    future.cancel()
                self.crew.stop(at_once=not whole)
        return self.outcomes

    def _job(self, design: SweptDesign, key: str) -> Job:
        configs = {
            "family": design.family.canonical(),
            "material": design.material.canonical(),
            "fem": self.study.need("fem", "FEM").canonical(),
        }
        plugins = tuple(str(file) for file in self.study.plugins)
        store = str(self.bench.store.root.resolve())
        return Job(design.number, configs, plugins, store, str(self.desk.folder), key)

    def _submit(self) -> None:
        """Fill the crew; a suspect has it for itself."""
        if self.alone:
            return
        if self.suspects:
            if not self.running:
                self.alone = True
                self._begin(self.suspects.popleft())
            return
        while self.queue and (self.crew.size is None or len(self.running) < self.crew.size):
            self._begin(self.queue.popleft())

    def _begin(self, job: Job) -> None:
        self.desk.clear(job.number)
        try:
            self.running[self.crew.submit(job)] = job
        except BrokenExecutor:
            (self.suspects if self.alone else self.queue).appendleft(job)
            self._broken([])

    def _take(self, ended: set[Future[Answer]]) -> None:
        broken = []
        for future in ended:
            job = self.running.pop(future)
            error = future.exception()
            if isinstance(error, BrokenExecutor):
                broken.append(job)
            elif isinstance(error, ImportError):
                raise UserError(
                    f"the workers cannot import what the study needs ({error}); install it there."
                )
            elif error is not None:
                self._end(Answer(job.number, "error", f"{type(error).__name__}: {error}"))
            else:
                self._answered(job, future.result())
        if broken:
            self._broken(broken)
        elif ended:
            self.alone = False

    def _answered(self, job: Job, answer: Answer) -> None:
        self.stillborn = 0
        for note in answer.notes:
            self.bench.progress.note(note)
        if answer.status == "stop":
            raise UserError(answer.cause)
        if answer.status == "busy":  # another sweep has it: later, and then with patience
            self.queue.append(replace(job, waits=True))
            return
        self._end(answer)

    def _end(self, answer: Answer) -> None:
        design, key = self.missing[answer.number]
        if answer.status == "done":
            made = _arrived(self.bench.store.root / "fem" / key)
            self.outcomes[answer.number] = DesignOutcome.of(design, made, cached=False)
        else:
            outcome = DesignOutcome(design, answer.status, answer.cause, wall_s=answer.wall_s)
            self.outcomes[answer.number] = outcome
        self.desk.clear(answer.number)
        self.bar.advance()

    def _broken(self, jobs: list[Job]) -> None:
        """A worker died. Who ran then is suspect; who dies alone is the one."""
        jobs += self.running.values()
        self.running.clear()
        began = [job for job in jobs if self.desk.began(job.number)]
        self.queue.extendleft(job for job in reversed(jobs) if job not in began)
        if not self.crew.renew():
            raise NotReachedError(
                "the executor broke: a worker died. Finished designs are in the store; run again to go on."
            )
        if self.alone and began:
            cause = (
                "its worker was killed twice, the second time alone (out of memory, or a crash of the solver)"
            )
            self._end(Answer(began[0].number, "crashed", cause))
        else:
            self.suspects.extend(began)
        self.alone = False
        self.stillborn = 0 if began else self.stillborn + 1
        if self.stillborn >= STILLBORN:
            raise NotReachedError(
                "worker processes end before they begin; in a script, put the call under "
                "\"if __name__ == '__main__':\", or take workers=1."
            )


def _arrived(folder: Path) -> Artifact:
    """An artifact that a worker has just written; a network file system may show it to us a while later."""
    until = time.monotonic() + ARRIVES_WITHIN_S
    while not folder.is_dir() and time.monotonic() < until:
        list(folder.parent.iterdir())
        time.sleep(POLL_S)
    try:
        return load_artifact(folder)
    except CorruptedError as error:
        raise UserError(
            f"{folder} was written by a worker and cannot be read here ({error}); is the store on a shared file system?"
        ) from None
