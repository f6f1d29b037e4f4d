"""Remark: a sentence that limits a result, with its subject."""

from __future__ import annotations

from enum import IntEnum


class Rank(IntEnum):
    """Subject of a remark, the most severe first."""

    UNIT = 0  # a unit, a sign or a label may be wrong, so that no number is reliable
    FLOOR = 1  # the noise floor cannot judge
    DATA = 2  # what the data lack, and what the result depends on
    DETAIL = 3


class Remark(str):
    """A text with a rank; plain strings among remarks are about the data.

    Attributes:
        rank: its severity.
        left_out: the kind of effect that was not tried, if it is about one; else "".
    """

    rank: Rank
    left_out: str

    def __new__(cls, text: str, rank: Rank = Rank.DATA, left_out: str = "") -> Remark:
        made = super().__new__(cls, text)
        made.rank, made.left_out = rank, left_out
        return made

    @classmethod
    def from_text(cls, text: str) -> Remark:
        """Return the text as a remark; a remark is returned unchanged."""
        return text if isinstance(text, cls) else cls(text)

    def from_file(self, name: str) -> Remark:
        """Return the same remark about one file among several."""
        return Remark(f"{name}: {self}", self.rank, self.left_out)


def detail(text: str) -> Remark:
    """Return the text as a remark of the lowest rank."""
    return Remark(text, Rank.DETAIL)
