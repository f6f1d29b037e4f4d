"""Where people watch: told trials written to a storage that optuna-dashboard and the `optuna` command read.

The sampler works on trials in memory; nothing here comes back to it, so a slow disk changes no proposal.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import optuna
from optuna.exceptions import DuplicatedStudyError
from optuna.storages import BaseStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial

from pliant.errors import UserError
from pliant_plugins.optimizers.optuna.quiet import quiet
from pliant_plugins.optimizers.optuna.trials import CANDIDATE

OWNER = "pliant_search"  # user attribute of a study: which search writes it


class Board:
    """One study in a storage, each candidate in it once."""

    def __init__(self, study: optuna.Study) -> None:
        self._study = study
        trials = study.get_trials(deepcopy=False)
        self._written = {trial.user_attrs.get(CANDIDATE) for trial in trials}

    @classmethod
    def new(cls, place: str, name: str, owner: str, objectives: int) -> Board:
        """A study of this name, or of `name-2`, `name-3`, … where it is taken: every search has its own."""
        storage = opened(place)
        names = itertools.chain([name], (f"{name}-{k}" for k in itertools.count(2)))
        with quiet():
            for free in names:
                try:
                    study = optuna.create_study(
                        storage=storage, study_name=free, directions=["minimize"] * objectives
                    )
                except DuplicatedStudyError:
                    continue
                study.set_user_attr(OWNER, owner)
                return cls(study)
        raise AssertionError("names do not end")

    @classmethod
    def again(cls, place: str, name: str, owner: str, objectives: int) -> Board:
        """The study of a search that goes on; made anew where the storage has lost it.

        Raises:
            UserError: another search has written the study of this name.
        """
        storage = opened(place)
        with quiet():
            if name not in optuna.get_all_study_names(storage):
                return cls.new(place, name, owner, objectives)
            study = optuna.load_study(study_name=name, storage=storage)
            if study.user_attrs.get(OWNER) != owner:
                raise UserError(
                    f"The search cannot go on in '{place}': its study '{name}' belongs to another search. "
                    "Put the former file back, or move this one away and it is written anew."
                )
            return cls(study)

    @property
    def name(self) -> str:
        """The study's name in its storage."""
        return self._study.study_name

    def write(self, trials: Iterable[FrozenTrial]) -> None:
        """Add the trials of candidates that are not there yet."""
        with quiet():
            for trial in trials:
                number = trial.user_attrs[CANDIDATE]
                if number not in self._written:
                    self._study.add_trial(trial)
                    self._written.add(number)


def opened(place: str) -> BaseStorage:
    """The storage, its file made where there is none.

    Raises:
        UserError: its folder is missing, or the file is no storage of Optuna's.
    """
    kind, _, path = place.partition("///") if place.startswith("sqlite:") else place.partition(":")
    if not Path(path).parent.is_dir():
        raise UserError(
            f"optimizer.storage: the folder '{Path(path).parent}' of '{place}' does not exist; make it first."
        )
    try:
        with quiet():
            if kind == "sqlite:":
                return RDBStorage(place)
            return optuna.storages.JournalStorage(JournalFileBackend(path))
    except Exception as error:  # SQLAlchemy, alembic and json each have their own
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(
            f"optimizer.storage: '{place}' cannot be used as Optuna's storage: {cause}"
        ) from error
