"""PPO as ask and tell: it learns the design for each condition, continues exactly, and its policy can be used."""

from __future__ import annotations

import base64
import json
import pickle
import random
import sys
import zipfile

import numpy as np
import pytest
from pydantic import ValidationError
from tests.optimizers.optimizer_searches import resumed

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
pytest.importorskip("tensorboard")

from pliant.errors import MissingDependencyError, UserError  # noqa: E402
from pliant.registry.discovery import discover  # noqa: E402
from pliant_ppo.config import PpoConfig  # noqa: E402
from pliant_ppo.episode import (  # noqa: E402
    context_index,
    context_observations,
    decode_action,
    encode_action,
)
from pliant_ppo.optimizer import Ppo, Rewards  # noqa: E402
from pliant_ppo.policy import SavedPolicy  # noqa: E402
from pliant_search.optimizer import Context, Space, Trial, Variable  # noqa: E402

NAN = float("nan")
MIXED = (
    Variable("length", "real", -0.02, 0.05),
    Variable("modules", "integer", 5, 10),
    Variable("side", "categorical", choices=("left", "right", "both")),
)
TWO = (Context("light", (0.0,)), Context("heavy", (1.0,)))
PLANE = (Variable("a", "real", 0.0, 1.0), Variable("b", "real", -2.0, 2.0))


def started(space=Space(MIXED, contexts=TWO), seed=3, **config):
    optimizer = Ppo(PpoConfig(**config))
    optimizer.start(space, seed)
    return optimizer


def mixed_score(candidate):
    failed = candidate.values["side"] == "both"
    return NAN if failed else candidate.values["modules"] + 100 * candidate.values["length"]


def played(optimizer, candidates, score=mixed_score, count=32):
    """Return the proposals while `candidates` candidates are tried."""
    proposed = []
    while len(proposed) < candidates:
        asked = optimizer.ask(min(count, candidates - len(proposed)))
        optimizer.tell([c.scored(score(c)) for c in asked])
        proposed += [(c.number, c.context, dict(c.values)) for c in asked]
    return proposed


def test_the_policy_starts_where_the_space_says():
    start = {"length": 0.04, "modules": 9, "side": "right"}
    for candidate in started(Space(MIXED, start=start)).recommend():
        assert candidate.values["length"] == pytest.approx(0.04, abs=2e-3)  # the network adds a little
        assert candidate.values["modules"] == 9
        assert candidate.values["side"] == "right"


def test_keys_without_effect_are_named():
    """An episode has one step; a search shorter than a batch has no update."""
    assert Ppo(PpoConfig()).remarks(32) == Ppo(PpoConfig()).remarks(None) == []
    (later,) = Ppo(PpoConfig(gamma=0.5)).remarks(320)
    assert later.startswith("optimizer.gamma has no effect")
    (short,) = Ppo(PpoConfig(learning_rate=1e-3)).remarks(31)
    assert "after every 32 candidates and the search has 31" in short and "optimizer.learning_rate" in short


def test_discounts_do_not_change_a_policy_and_other_keys_do():
    """What `remarks` says of a batch that is learned from, key by key."""
    space = Space(PLANE)

    def policy(**config):
        optimizer = started(space, environments=4, n_steps=2, batch_size=4, **config)
        played(optimizer, 16, lambda c: c.values["a"])
        return [one.values for one in optimizer.recommend()]

    plain = policy()
    assert policy(gamma=0.1) == policy(gae_lambda=0.1) == plain
    assert policy(learning_rate=1e-3) != plain != policy(entropy=0.3)


def test_a_restored_search_goes_on_exactly():
    """The state is taken in the middle of a batch; networks, Adam, the worst reward and the log are restored."""
    first = started()
    played(first, 40, count=11)
    waiting = first.ask(7)
    first.tell([c.scored(mixed_score(c)) for c in waiting[:3]])
    second = resumed(first)
    for optimizer in (first, second):
        optimizer.tell([c.scored(mixed_score(c)) for c in waiting[3:]])
    assert played(first, 40) == played(second, 40)
    assert json.dumps(first.state()) == json.dumps(second.state())
    assert first.recommend() == second.recommend()


def test_neither_the_outcome_order_nor_the_ask_size_matters():
    together, apart = started(), started()
    for _ in range(2):
        asked = together.ask(32)
        together.tell([c.scored(mixed_score(c)) for c in asked])
        piecewise = [c for n in (1, 20, 11) for c in apart.ask(n)]
        assert asked == piecewise
        for candidate in reversed(piecewise):
            apart.tell([candidate.scored(mixed_score(candidate))])
    assert together.ask(32) == apart.ask(32)


def test_candidates_may_be_asked_for_before_the_batch_is_told():
    optimizer = started()
    asked = [c for _ in range(3) for c in optimizer.ask(20)]
    assert [c.number for c in asked] == list(range(20 + 12 + 20))
    optimizer.tell([c.scored(mixed_score(c)) for c in asked[40:]])
    before = optimizer.recommend()
    optimizer.tell([c.scored(mixed_score(c)) for c in asked[1:40]])
    assert optimizer.recommend() == before  # the first batch still lacks one
    optimizer.tell([Trial(0, {}).scored(1.0)])
    assert optimizer.recommend() != before


def test_an_outcome_that_nobody_waits_for_is_an_error():
    optimizer = started()
    (candidate,) = optimizer.ask(1)
    optimizer.tell([candidate.scored(1.0)])
    for number in (candidate.number, 77):
        with pytest.raises(UserError, match=f"candidate {number} is not waiting"):
            optimizer.tell([Trial(number, {}).scored(1.0)])


def test_global_generators_and_threads_decide_nothing_and_are_left_alone():
    threads, proposals = torch.get_num_threads(), []
    torch.set_num_threads(2)
    try:
        for seed in (1, 2):
            np.random.seed(seed)
            torch.manual_seed(seed)
            before = repr(np.random.get_state()), random.getstate(), torch.get_rng_state().tolist()
            optimizer = started()
            proposals.append(played(optimizer, 40))
            optimizer.recommend()
            after = repr(np.random.get_state()), random.getstate(), torch.get_rng_state().tolist()
            assert after == before and torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    assert proposals[0] == proposals[1]
    assert played(started(seed=4), 32) != proposals[0][:32]


def test_contexts_take_turns_in_a_drawn_order():
    drawn = [context_index(number, 6, 5) for number in range(60)]
    rounds = [tuple(drawn[i : i + 6]) for i in range(0, 60, 6)]
    assert all(sorted(r) == list(range(6)) for r in rounds)
    assert len(set(rounds)) > 5
    assert [context_index(number, 6, 6) for number in range(60)] != drawn


def test_what_the_policy_sees():
    assert context_observations(()).tolist() == [[1.0]]
    assert context_observations((Context("a"), Context("b"))).tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert context_observations(TWO).tolist() == [[0.0], [1.0]]
    with pytest.raises(UserError, match="1 and 2 features"):
        context_observations((Context("a", (1.0,)), Context("b", (1.0, 2.0))))


def test_actions_and_designs():
    assert decode_action(np.array([-1.0, -1.0, -1.0]), MIXED) == {
        "length": -0.02,
        "modules": 5,
        "side": "left",
    }
    assert decode_action(np.array([3.0, 1.0, 1.0]), MIXED) == {"length": 0.05, "modules": 10, "side": "both"}
    assert decode_action(np.zeros(3), MIXED) == {
        "length": pytest.approx(0.015),
        "modules": 8,
        "side": "right",
    }
    for number in np.linspace(-1, 1, 41):
        values = decode_action(np.full(3, number), MIXED)
        assert decode_action(encode_action(values, MIXED), MIXED) == pytest.approx(values)
    shares = np.linspace(-1, 1, 3001)
    sides = [decode_action(np.array([0, 0, s]), MIXED)["side"] for s in shares]
    assert [sides.count(side) for side in MIXED[2].choices] == pytest.approx([1000] * 3, abs=2)


def test_candidates_without_an_objective_are_worse_than_the_worst():
    rewards, fine = Rewards(), np.zeros(3)
    assert rewards.compute(np.full(3, np.nan), fine).tolist() == [-1.0, -1.0, -1.0]
    assert rewards.compute(np.array([2.0, np.nan, 12.0]), fine).tolist() == [-2.0, -13.0, -12.0]
    # The worst is stored; constraints cost up to another margin.
    found = rewards.compute(np.full(4, np.nan), np.array([0.0, 0.5, 1.0, 70.0]))
    assert found.tolist() == [-13.0, -13.5, -14.0, -14.0]


def same_after(*scores):
    """Return whether searches continue alike for each (objective, violation) of odd candidates; states stay JSON."""
    proposed = []
    for objective, violation in scores:
        optimizer = started()
        for candidate in optimizer.ask(32):
            bad = candidate.number % 2
            told = candidate.scored(objective, violation=violation) if bad else candidate.scored(1.0)
            optimizer.tell([told])
            if candidate.number == 16:
                json.dumps(optimizer.state(), allow_nan=False)
        json.dumps(optimizer.state(), allow_nan=False)
        proposed.append(optimizer.ask(5))
    return all(one == proposed[0] for one in proposed)


def test_bad_numbers_reach_neither_state_nor_network():
    """A violation takes precedence over the objective; values that overflow single precision count as failed."""
    assert same_after((-100.0, 1.0), (NAN, 1.0), (1.0, NAN), (1.0, 1e9))
    assert same_after(*((objective, 0.0) for objective in (NAN, float("inf"), -float("inf"), 1e30, 1e300)))


def test_the_saved_policy_gives_the_same_designs(tmp_path):
    from stable_baselines3 import PPO

    optimizer = started()
    played(optimizer, 32)
    files = optimizer.export(tmp_path)
    assert {f.name for f in files[:2]} == {"policy.zip", "policy.json"}
    assert all(f.is_file() for f in files)
    policy = SavedPolicy.load(tmp_path)
    for candidate in optimizer.recommend():
        assert policy.design(TWO[candidate.context].name) == candidate.values
        assert policy.design(TWO[candidate.context].features) == candidate.values
    assert PPO.load(tmp_path / "policy.zip").gamma == 0.9
    with pytest.raises(UserError, match="unknown condition 'hevy'; did you mean 'heavy'"):
        policy.design("hevy")
    with pytest.raises(UserError, match="2 features are given; this policy sees 1"):
        policy.design((0.0, 1.0))
    with pytest.raises(UserError, match="name a condition: light, heavy"):
        policy.design()
    with pytest.raises(UserError, match=r"has no policy.zip"):
        SavedPolicy.load(tmp_path / "elsewhere")


class Harm:
    """An object that creates a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return type(self.path).touch, (self.path,)


def spoiled(folder, name, content):
    """Return the policy's zip with one of its files replaced."""
    with zipfile.ZipFile(folder / "policy.zip") as whole:
        files = {one: whole.read(one) for one in whole.namelist()}
    assert name in files
    with zipfile.ZipFile(folder / "policy.zip", "w") as whole:
        for one, old in files.items():
            whole.writestr(one, content if one == name else old)


def test_a_policy_from_elsewhere_runs_nothing(tmp_path):
    optimizer = started(net=(16, 8))
    files = optimizer.export(tmp_path)
    pickled = pickle.dumps(Harm(tmp_path / "harm"), protocol=2)
    data = {"policy_class": {":type:": "str", ":serialized:": base64.b64encode(pickled).decode()}}
    spoiled(tmp_path, "data", json.dumps(data))
    (light, _) = optimizer.recommend()
    assert SavedPolicy.load(files[0].parent).design("light") == light.values
    spoiled(tmp_path, "policy.pth", pickled)
    with pytest.raises(UserError, match="is damaged"):
        SavedPolicy.load(tmp_path)
    assert not (tmp_path / "harm").exists()


def test_a_damaged_policy_says_so(tmp_path):
    started().export(tmp_path)
    meaning = json.loads((tmp_path / "policy.json").read_text())
    for wrong in ("{", json.dumps({**meaning, "variables": meaning["variables"][:1]}), "{}"):
        (tmp_path / "policy.json").write_text(wrong)
        with pytest.raises(UserError, match=r"the policy in '.*' is damaged \(.+\); run the search again"):
            SavedPolicy.load(tmp_path)


def scalars(folder):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder))
    events.Reload()
    return {tag: [(e.step, e.value) for e in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


def test_tensorboard_reads_every_update(tmp_path):
    """The mean rewards are those of the batches; a log that grew while it learned has the same."""
    optimizer = started(tensorboard=str(tmp_path / "live"))
    means = []
    for _ in range(3):
        told = [c.scored(c.values["length"]) for c in optimizer.ask(32)]
        optimizer.tell(told)
        means.append(-float(np.mean([c.objective for c in told])))
    optimizer.export(tmp_path / "once")
    files = optimizer.export(tmp_path / "once")  # in place of the first
    assert len([f for f in files if "tfevents" in f.name]) == 1
    read = scalars(tmp_path / "once" / "tensorboard")
    steps, values = zip(*read["rollout/ep_rew_mean"], strict=True)
    assert steps == (32, 64, 96)
    assert values == pytest.approx(means, rel=1e-5)
    wanted = {"train/loss", "train/value_loss", "train/entropy_loss", "train/approx_kl", "train/std"}
    assert wanted <= set(read)
    optimizer._live.close()
    assert scalars(tmp_path / "live") == read
    plain = started(tensorboard=False)
    played(plain, 32)
    assert {f.name for f in plain.export(tmp_path / "none")} == {"policy.zip", "policy.json"}


def test_the_defaults_are_the_studys():
    model = started()._learner.model
    assert (model.n_steps, model.n_envs, model.batch_size, model.n_epochs) == (8, 4, 32, 10)
    assert (model.learning_rate, model.gamma, model.gae_lambda) == (1e-4, 0.9, 0.9)
    assert (model.clip_range(1.0), model.ent_coef, model.vf_coef) == (0.3, 0.03, 0.3)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"environments": 1, "n_steps": 1}, "needs at least 2 candidates"),
        ({"net": (64, 0)}, "1 to 4096 units"),
        ({"learning_rate": 0}, "learning_rate"),
        ({"steps": 8}, "steps"),
    ],
)
def test_wrong_settings(wrong, says):
    with pytest.raises(ValidationError, match=says):
        PpoConfig(**wrong)


def test_several_objectives_are_refused():
    with pytest.raises(UserError, match="has one objective and the search has 2"):
        started(Space(PLANE, objectives=2))


def test_a_missing_library_names_the_command(monkeypatch):
    component = discover().get("optimizer", "ppo")
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(MissingDependencyError, match=r"needs stable_baselines3: pip install 'pliant\[ppo\]'"):
        component.build(PpoConfig())
