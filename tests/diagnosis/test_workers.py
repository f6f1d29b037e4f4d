"""Hypotheses fitted by workers: tasks and results are pickled, and results are equal bit for bit."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.quick import effect, joint, make_predictor, measured, rich

from pliant.diagnosis import fitting
from pliant.diagnosis.diagnosis import diagnose
from pliant.errors import UserError
from pliant.execution.executors import Executor, InlineExecutor, ThreadExecutor, executor_for

KINDS = ("stiffness", "viscoelastic", "sensor_bias")


class Far(InlineExecutor):
    """An executor that passes tasks and results through pickle, as to another process."""

    calls = 0

    def submit(self, function: Callable[..., Any], *values: Any) -> Future[Any]:
        self.calls += 1
        sent, given = pickle.loads(pickle.dumps((function, values)))
        done: Future[Any] = Future()
        done.set_result(pickle.loads(pickle.dumps(sent(*given))))
        return done


@pytest.mark.parametrize("made", [Far, partial(ThreadExecutor, 3)], ids=["far", "threads"])
def test_workers_change_nothing(made: Callable[[], Executor]) -> None:
    chain = joint()
    predictor = make_predictor(chain, measured(chain, rich(1), effect("viscoelastic")))
    with executor_for(InlineExecutor()) as alone, executor_for(made()) as others:
        here, there = (diagnose(predictor, kinds=KINDS, workers=one) for one in (alone, others))
    assert getattr(others, "calls", 99) >= len(KINDS) + 1
    assert list(here.fits) == list(there.fits) and here.verdict == there.verdict
    assert here.judgement.probability == there.judgement.probability
    for kinds, fit in here.fits.items():
        np.testing.assert_array_equal(fit.x, there.fits[kinds].x)


class Cluster(Far):
    """An executor whose workers may have other code."""

    remote = True


def test_a_worker_with_other_code_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    chain = joint()
    predictor = make_predictor(chain, measured(chain, rich(1), effect("viscoelastic")))
    fingerprints = iter(["of the driver", "of the driver", "of another version"])
    monkeypatch.setattr(fitting, "code_of", lambda modules: next(fingerprints))
    with pytest.raises(UserError, match="another version of Pliant, of a plugin or of a library"):
        diagnose(predictor, kinds=KINDS, workers=Cluster())
