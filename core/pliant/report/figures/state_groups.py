"""States of a data set as pictures tell them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.fem import TRUSTED, FemDataset


@dataclass(frozen=True, eq=False)
class Groups:
    """Masks of a data set's states: fitted, checked, not trusted."""

    fit: NDArray[np.bool_]
    check: NDArray[np.bool_]
    untrusted: NDArray[np.bool_]

    @staticmethod
    def of(data: FemDataset) -> Groups:
        """Not trusted: what overlaps and was not let pass, and every unknown status."""
        trusted = np.isin(data.status, TRUSTED)
        check = data.role == "check"
        return Groups(trusted & ~check, trusted & check, ~trusted)
