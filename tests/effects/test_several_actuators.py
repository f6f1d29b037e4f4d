"""Effects of chains with several actuators: tendons that go slack, chambers that do not act alike."""

from __future__ import annotations

import numpy as np
import pytest
from tests.effects.bench import effect

from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.mechanics.full_scale import full_scale
from pliant.records.chain import Actuator, ChainModel
from pliant.records.history import History
from pliant.testing.samples import linear_law, sample_chain

TRAVEL = np.array([-2e-3, -0.5e-3, 0.0, 1e-3])


def driven_by(*inputs: str) -> ChainModel:
    """Return a chain with these inputs."""
    return sample_chain(linear_law(), modules=2).with_(actuators=tuple(Actuator(name) for name in inputs))


def test_a_slack_tendon_keeps_its_pull_and_loses_what_is_paid_out() -> None:
    chain = driven_by("tendon_travel_1_m", "pressure_2_pa")
    history = History.from_arrays({"tendon_travel_1_m": TRAVEL, "pressure_2_pa": TRAVEL})
    reached = effect("tendon_slack", share=0.75).apply(Model(chain)).commanded(history).actuation
    np.testing.assert_allclose(reached["tendon_travel_1_m"], [-0.5e-3, -0.125e-3, 0.0, 1e-3])
    np.testing.assert_array_equal(reached["pressure_2_pa"], TRAVEL)


def test_a_pretension_keeps_a_tendon_tight() -> None:
    chain = driven_by("tendon_travel_m")
    scale = full_scale(chain)
    model = effect("tendon_slack", share=1.0, pretension=0.2).apply(Model(chain))
    reached = model.commanded(History.from_arrays({"tendon_travel_m": scale * np.array([-0.5, -0.1, 0.3])}))
    np.testing.assert_allclose(reached.actuation["tendon_travel_m"] / scale, [-0.2, -0.1, 0.3])


def test_the_second_and_third_inputs_are_scaled() -> None:
    chain = driven_by("pressure_1_pa", "pressure_2_pa", "pressure_3_pa")
    history = History.from_arrays(
        {name: np.array([1e3, 2e3]) for name in ("pressure_1_pa", "pressure_2_pa", "pressure_3_pa")}
    )
    reached = (
        effect("unequal_actuators", second=0.8, third=1.1).apply(Model(chain)).commanded(history).actuation
    )
    np.testing.assert_allclose(reached["pressure_1_pa"], [1e3, 2e3])
    np.testing.assert_allclose(reached["pressure_2_pa"], [0.8e3, 1.6e3])
    np.testing.assert_allclose(reached["pressure_3_pa"], [1.1e3, 2.2e3])


@pytest.mark.parametrize(
    ("kind", "inputs", "signals", "reason"),
    [
        ("tendon_slack", ("tendon_force_n",), {"tendon_force_n": [0.0, 5.0]}, "negative"),
        ("tendon_slack", ("tendon_force_n",), {"tendon_force_n": [-1.0, 5.0]}, ""),
        ("unequal_actuators", ("pressure_pa",), {"pressure_pa": [0.0, 5e3]}, "one input"),
        (
            "unequal_actuators",
            ("pressure_1_pa", "pressure_2_pa"),
            {"pressure_1_pa": [0.0, 5e3], "pressure_2_pa": [0.0, 0.0]},
            "only the first input acts",
        ),
    ],
)
def test_recordings_that_cannot_show_them_are_named(kind, inputs, signals, reason) -> None:  # type: ignore[no-untyped-def]
    stated = effect(kind).unsuited(
        driven_by(*inputs), [History.from_arrays({k: np.array(v) for k, v in signals.items()})]
    )
    assert stated == "" if not reason else reason in stated


@pytest.mark.parametrize("kind", ["tendon_slack", "unequal_actuators"])
def test_a_chain_with_one_pressure_is_refused(kind: str) -> None:
    with pytest.raises(UserError, match="pressure_pa"):
        effect(kind).apply(Model(driven_by("pressure_pa")))
