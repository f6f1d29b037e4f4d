"""A sentence that limits a result, with what it is about."""

from __future__ import annotations

from enum import IntEnum


class Rank(IntEnum):
    """What a remark is about, the gravest first."""

    UNIT = 0  # a unit, a sign, a label may be wrong: no number is to be believed before that is settled
    FLOOR = 1  # the noise floor cannot judge
    DATA = 2  # what the data lack, and what the result rests on
    DETAIL = 3


class Remark(str):
    """A text that knows its rank; a plain text among remarks is about the data.

    Attributes:
        rank: how grave it is.
        left_out: the kind of effect that was not tried and that it is about; empty for all others.
    """

    rank: Rank
    left_out: str

    def __new__(cls, text: str, rank: Rank = Rank.DATA, left_out: str = "") -> Remark:
        made = super().__new__(cls, text)
        made.rank, made.left_out = rank, left_out
        return made

    @classmethod
    def of(cls, text: str) -> Remark:
        """The text as a remark; itself where it is one."""
        return text if isinstance(text, cls) else cls(text)

    def from_file(self, name: str) -> Remark:
        """The same, said of one file among several."""
        return Remark(f"{name}: {self}", self.rank, self.left_out)


def detail(text: str) -> Remark:
    """What may be left unread."""
    return Remark(text, Rank.DETAIL)
