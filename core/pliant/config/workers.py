"""Who does a study's work, in one word of it."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from pliant.interfaces.base import FrozenModel


class WorkersConfig(FrozenModel):
    """`workers: 2` for processes of this machine, `workers: {kind: dask, address: tcp://host:8786}` for a cluster.

    FEM sweeps, searches with their checks, diagnoses and counted trials are done by them. Results do not depend on
    who works, and no key of stored data, laws or searches holds it.
    """

    kind: Literal["processes", "dask"] = Field(
        "processes", description="of this machine, or those of a dask cluster"
    )
    count: int | None = Field(None, ge=1, description="processes; one for each CPU by default")
    address: str | None = Field(
        None, min_length=1, description="of the dask scheduler, tcp://host:8786, or its file"
    )

    @model_validator(mode="before")
    @classmethod
    def _number(cls, raw: Any) -> Any:
        return {"count": raw} if isinstance(raw, int) and not isinstance(raw, bool) else raw

    @model_validator(mode="after")
    def _one_of_them(self) -> WorkersConfig:
        if self.kind == "dask" and self.address is None:
            raise ValueError("dask needs the 'address' of its scheduler, tcp://host:8786, or its file")
        if self.kind == "dask" and self.count is not None:
            raise ValueError("a dask cluster has as many workers as it has; leave 'count' out")
        if self.kind == "processes" and self.address is not None:
            raise ValueError("'address' is of a dask scheduler; write kind: dask")
        return self

    @property
    def who(self) -> int | str | None:
        """A number of processes, a scheduler's address or file; None: a process for each CPU."""
        return self.address if self.kind == "dask" else self.count
