"""What an update reports, kept for TensorBoard."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.logger import TensorBoardOutputFormat

from pliant.errors import UserError
from pliant_plugins.optimizers.ppo.encoding import packed, unpacked

# Not written by stable-baselines3 either: it is the step itself.
UNWRITTEN = ("train/n_updates",)


class UpdateLog:
    """One row of named numbers per update, each at the number of candidates that it had learned from."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._rows: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, step: int, logged: Mapping[str, float]) -> None:
        """The next row; every row has the names of the first."""
        if not self._names:
            self._names = tuple(sorted(logged))
        self._rows.append((float(step), *(float(logged.get(name, np.nan)) for name in self._names)))

    def write(self, folder: Path) -> list[Path]:
        """All rows as a TensorBoard event file, in place of those that are there."""
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("events.out.tfevents.*"):
            old.unlink()
        stream = LiveLog(folder)
        for step, *values in self._rows:
            stream.add(int(step), dict(zip(self._names, values, strict=True)))
        stream.close()
        return sorted(folder.glob("events.out.tfevents.*"))

    def state(self) -> dict[str, Any]:
        """As JSON values."""
        return {"names": list(self._names), "rows": packed(np.array(self._rows, float))}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As `state` left it."""
        self._names = tuple(state["names"])
        self._rows = [tuple(row) for row in unpacked(state["rows"]).tolist()]


class LiveLog:
    """A TensorBoard event file that grows while the policy learns, by stable-baselines3's writer."""

    def __init__(self, folder: Path) -> None:
        try:
            self._stream = TensorBoardOutputFormat(str(folder))
        except OSError as error:
            raise UserError(f"optimizer.tensorboard: '{folder}' cannot be written ({error}).") from None

    def add(self, step: int, logged: Mapping[str, float]) -> None:
        """The numbers of one update."""
        excluded = {name: ("tensorboard",) if name in UNWRITTEN else () for name in logged}
        self._stream.write(dict(logged), excluded, step)

    def close(self) -> None:
        """Write what is left."""
        self._stream.close()
