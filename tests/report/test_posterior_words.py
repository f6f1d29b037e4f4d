"""The parameters on which a prediction depends are named where their shares differ."""

from types import SimpleNamespace

import numpy as np
import pytest

from pliant.diagnosis.exploration import Share
from pliant.report.posterior import _alike, posterior_words, shares_brief


def fitted(monkeypatch, *shares):
    """Return an extension with one parameter for each of these shares of one output."""
    monkeypatch.setattr("pliant.report.posterior.unseen_words", lambda posterior: [])
    names = tuple(f"effect_{k}.value" for k in range(len(shares)))
    exploration = SimpleNamespace(
        shares={"angle_rad": {n: Share(*s) for n, s in zip(names, shares, strict=True)}},
        spread={"angle_rad": 1.0},
    )
    posterior = SimpleNamespace(names=names)
    scatter = {"angle_rad": SimpleNamespace(left=1.0)}
    return SimpleNamespace(exploration=exploration, posterior=posterior, scatter=scatter, normal=True)


def test_equal_shares_are_a_sentence_and_no_table(monkeypatch):
    """33/33/33 % is the result for any three parameters that are known apart: the sum of the leverages."""
    found = fitted(monkeypatch, (0.33, 0.34), (0.33, 0.33), (0.34, 0.33))
    assert shares_brief(found) is None
    assert posterior_words(found) == [
        "The parameters are determined separately: all contribute equally to the uncertainty of the prediction."
    ]


def test_unequal_shares_are_a_table(monkeypatch):
    found = fitted(monkeypatch, (0.75, 0.11), (0.2, 0.12), (0.05, 0.04))
    rows = shares_brief(found).rows
    assert [row[1] for row in rows] == ["75 %", "20 %", "5 %"] and posterior_words(found) == []


@pytest.mark.parametrize("k", [2, 3, 5])
def test_orthogonal_parameters_take_equal_shares_whatever_they_are(k):
    """The total leverage of each column of a least-squares fit is one, whatever its size."""
    rng = np.random.default_rng(k)
    slopes = np.linalg.qr(rng.normal(size=(200, k)))[0] * rng.uniform(0.1, 10.0, k)
    covariance = np.linalg.inv(slopes.T @ slopes)
    of_each = [np.sum(slopes[:, i] ** 2) * covariance[i, i] for i in range(k)]
    share = {str(i): Share(one / k, one / k) for i, one in enumerate(of_each)}
    assert _alike(share)
