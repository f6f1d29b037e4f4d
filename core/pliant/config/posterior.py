"""The `posterior` block: the uncertainty of the effects of a study, as found by the fit that wrote them."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from pliant.interfaces.base import FrozenModel

SLACK = 1e-4  # of a correlation


class PosteriorConfig(FrozenModel):
    """A joint normal distribution of effects' parameters, and how single readings scatter about the model: what the
    bands of `pliant compare` are made of. `pliant extend` and `pliant improve` write it; lists are in the order of
    `parameters`, numbers in SI.
    """

    parameters: tuple[str, ...] = Field(min_length=1, description="effects' parameters as kind.name")
    values: tuple[float, ...] = Field(description="best values; the block holds for a study with these only")
    sd: tuple[float, ...] = Field(description="standard deviations")
    correlation: tuple[tuple[float, ...], ...] = Field(description="correlation matrix, row by row")
    noise: dict[str, float] = Field(description="noise floor of a reading, by output")
    left: dict[str, float] = Field(
        description="what the fit left of its readings, root mean square, by output"
    )
    freedom: float = Field(gt=0, description="independent readings less fitted parameters")

    @model_validator(mode="after")
    def _square(self) -> Self:
        k = len(self.parameters)
        rows = (self.values, self.sd, self.correlation, *self.correlation)
        if any(len(row) != k for row in rows):
            raise ValueError(f"values, sd and correlation should have {k} entries each, one per parameter")
        if min(self.sd) <= 0.0:
            raise ValueError("standard deviations are positive")
        for a, row in enumerate(self.correlation):
            mirrored = all(abs(row[b] - self.correlation[b][a]) <= SLACK for b in range(k))
            if abs(row[a] - 1.0) > SLACK or not mirrored or any(abs(r) > 1.0 + SLACK for r in row):
                raise ValueError(
                    "correlation should be symmetric, between −1 and 1, with ones on its diagonal"
                )
        return self
