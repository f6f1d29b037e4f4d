"""The errors of drawn laws relative to the error bar from which they were drawn."""

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebpts1

from pliant.records.law import JointLaw


def require_errors_as_the_bar(law: JointLaw, drawn: Sequence[JointLaw], nodes: int = 9) -> None:
    """Check that errors over the band of one standard deviation have a mean square of 1 over the box.

    One draw estimates a variance to √2 of it or better.
    """
    x, v = (axis.ravel() for axis in np.meshgrid(chebpts1(nodes), chebpts1(nodes)))
    (p_low, p_high), (u_low, u_high) = law.domain.actuation, law.domain.deformation[0]
    p = (p_low + p_high + (p_high - p_low) * x) / 2
    u = (u_low + u_high + (u_high - u_low) * v[:, None]) / 2
    band = law.band(p, u, 2 * NormalDist().cdf(1.0) - 1)
    errors = np.array([one.evaluate(p, u).tau - law.evaluate(p, u).tau for one in drawn])
    assert np.mean((errors / band) ** 2) == pytest.approx(1.0, rel=3 * np.sqrt(2 / len(drawn)))
