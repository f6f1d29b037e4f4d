"""Every environment follows gymnasium's rules, is deterministic under a seed, and rewards the intended behaviour."""

import importlib
import importlib.util
import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

import pliant_plugins.envs  # noqa: E402, F401 - registers them
from pliant.errors import UserError  # noqa: E402
from pliant_plugins.envs.registration import ENVIRONMENTS  # noqa: E402

SCENES = (
    "pliant/Crawl-v0",
    "pliant/Grasp-v0",
    "pliant/HoldAndTurn-v0",
    "pliant/Push-v0",
    "pliant/ReachAround-v0",
)
CHAINS = [name for name in ENVIRONMENTS if name not in SCENES]
# 22 spherical joints are slow: fewer steps suffice.
SHORT = {"episode_s": 0.5}


@pytest.fixture(params=ENVIRONMENTS, scope="module")
def env(request):
    made = gymnasium.make(request.param, **SHORT)
    yield made
    made.close()


def played(env, seed, policy, steps=1000):
    """Return observations and rewards of one episode, or of its first steps."""
    seen, info = env.reset(seed=seed)
    observations, rewards, infos = [seen], [], [info]
    over = False
    while not over and len(rewards) < steps:
        seen, reward, ended, truncated, info = env.step(policy(seen))
        observations.append(seen)
        rewards.append(reward)
        infos.append(info)
        over = ended or truncated
    return np.array(observations), np.array(rewards), infos


@pytest.mark.slow
def test_the_checkers_have_no_remark(env):
    """Gymnasium's checker, and stable-baselines3's where it is installed; then a random policy."""
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
        if importlib.util.find_spec("stable_baselines3"):
            importlib.import_module("stable_baselines3.common.env_checker").check_env(env.unwrapped)
    env.action_space.seed(1)
    observations, rewards, infos = played(env, 0, lambda _: env.action_space.sample())
    assert len(rewards) <= 10
    assert np.all(np.abs(observations) <= 10.0) and np.all(np.isfinite(rewards))
    assert infos[-1]["time_s"] == pytest.approx(0.05 * len(rewards))


def test_a_seed_decides_an_episode(env):
    def bang(seen):
        return np.sign(np.resize(np.sin(1e3 * seen), env.action_space.shape)).astype(np.float32)

    first, again, other = (played(env, seed, bang) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert not np.array_equal(first[0][0], other[0][0])


@pytest.mark.parametrize("name", ["pliant/FreeBending-v0", "pliant/TipLoad-v0", "pliant/TendonFinger-v0"])
def test_the_target_is_reached_by_an_actuation(name):
    """A slowly rising actuation brings the tip to the target, which was drawn at one; zero actuation does not."""
    env = gymnasium.make(name, episode_s=4.0)
    rise = iter(np.linspace(-1.0, 1.0, 81))
    _, rewards, infos = played(env, 5, lambda _: np.array([next(rise)], np.float32))
    length, errors = env.unwrapped.chain.length_m, np.array([info["error_m"] for info in infos[1:]])
    np.testing.assert_allclose(rewards, -errors / length, atol=1e-5)  # except for action costs
    assert errors.min() < 0.05 * length < errors[0]
    env.close()


def test_options_fix_what_is_drawn():
    env = gymnasium.make("pliant/TipLoad-v0", **SHORT)
    wanted = {"target_m": [0.03, 0.0, -0.05], "tip_force_n": [0.0, 0.0, -0.05]}
    _, info = env.reset(seed=1, options=wanted)
    np.testing.assert_array_equal(info["target_m"], wanted["target_m"])
    np.testing.assert_array_equal(info["tip_force_n"], wanted["tip_force_n"])
    # The next episode is the one without options.
    _, following = env.reset()
    env.reset(seed=1)
    _, plain = env.reset()
    np.testing.assert_allclose(following["target_m"], plain["target_m"])
    env.close()


def test_a_shape_that_the_chain_takes_is_followed():
    env = gymnasium.make("pliant/FollowShape-v0", **SHORT)
    straight = [[0.0, 0.0, 0.0], [0.0, 0.0, -0.088]]
    _, info = env.reset(seed=1, options={"curve_m": straight})
    assert info["error_m"] == pytest.approx(0.0, abs=1e-9)
    assert info["is_success"]
    env.close()


def test_a_plain_script_grasps_the_egg_and_earns_more_than_doing_nothing():
    def script(steps):
        for k in range(steps):
            yield [-1, -1] if k < 22 else [min(1.0, -1 + 0.1 * (k - 22)), 0] if k < 50 else [1, 1]

    env = gymnasium.make("pliant/Grasp-v0", episode_s=4.5)
    actions = script(90)
    _, rewards, infos = played(env, 0, lambda _: np.array(next(actions), np.float32))
    _, idle, still = played(env, 0, lambda _: np.array([-1, 0], np.float32), steps=10)
    assert infos[-1]["is_success"]
    assert infos[-1]["rise_m"] > 0.08
    assert infos[-1]["normal_n"] > 0.5
    assert infos[-1]["slip_ratio"] < 0.1
    assert not still[-1]["is_success"]
    assert rewards.mean() > idle.mean() + 1 / 3
    env.close()


def test_several_at_once():
    envs = gymnasium.make_vec("pliant/FreeBending-v0", num_envs=3, **SHORT)
    seen, _ = envs.reset(seed=[1, 1, 2])
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2])
    _, rewards, *_ = envs.step(np.ones((3, 1), np.float32))
    assert rewards.shape == (3,)
    envs.close()


@pytest.mark.slow
def test_pictures_show_the_motion():
    pytest.importorskip("OpenGL")
    env = gymnasium.make("pliant/FreeBending-v0", render_mode="rgb_array", size=(160, 120))
    env.reset(seed=1)
    try:
        before = env.render()
    except UserError as error:
        pytest.skip(str(error))
    for _ in range(10):
        env.step(np.ones(1, np.float32))
    after = env.render()
    assert before.shape == after.shape == (120, 160, 3)
    assert np.mean(np.any(before != after, axis=2)) > 0.01
    env.close()


@pytest.mark.parametrize(
    ("name", "changes", "says"),
    [
        ("pliant/FreeBending-v0", {"study": "no_such.yaml"}, "no_such.yaml"),
        ("pliant/FreeBending-v0", {"control_s": 0.0}, "control_s"),
        ("pliant/FreeBending-v0", {"actuation_max": -1.0}, "actuation_max is -1"),
    ],
)
def test_wrong_input_is_told_in_a_sentence(name, changes, says):
    with pytest.raises(UserError, match=says):
        gymnasium.make(name, **changes)


STUDY = """
pliant: 1
name: own
surrogate: {kind: polynomial, form: study, axis: y, odd: true,
            coefficients: {k_n: 1.6e-6, m_a: 0, m_e: 0.1, b_e: 0.02}}
chain: {modules: 3, module_length: 11 mm, module_mass: 2 g}
physics: PHYSICS
task: {kind: free_bending, pressure: 10 kPa}
"""


def test_a_users_own_study(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(STUDY.replace("PHYSICS", "mujoco"))
    env = gymnasium.make("pliant/FreeBending-v0", study=str(path))
    env.reset(seed=0)
    *_, info = env.step(np.ones(1, np.float32))
    assert info["pressure_pa"] == pytest.approx(10e3)
    assert env.unwrapped.chain.n_joints == 3
    env.close()


@pytest.mark.parametrize(
    ("name", "physics", "says"),
    [
        ("pliant/FreeBending-v0", "quasistatic", "has equilibria only"),
        ("pliant/Grasp-v0", "mujoco", "needs a study with 'task: {kind: grasp"),
        ("pliant/Push-v0", "mujoco", "needs a study with 'task: {kind: push"),
        ("pliant/HoldAndTurn-v0", "mujoco", "needs a study with 'task: {kind: hold_and_turn"),
        ("pliant/ReachAround-v0", "mujoco", "needs a study with 'task: {kind: reach_around"),
        ("pliant/Crawl-v0", "mujoco", "needs a study with 'task: {kind: crawl"),
    ],
)
def test_a_study_that_does_not_fit(tmp_path, name, physics, says):
    path = tmp_path / "own.yaml"
    path.write_text(STUDY.replace("PHYSICS", physics))
    with pytest.raises(UserError, match=says):
        gymnasium.make(name, study=str(path))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"target": [0, 0, 0]}, "unknown option 'target'"),
        ({"target_m": [0, 0]}, "three numbers"),
        ({"target_m": "here"}, "three numbers"),
    ],
)
def test_wrong_options(options, says):
    env = gymnasium.make("pliant/FreeBending-v0")
    with pytest.raises(UserError, match=says):
        env.reset(options=options)
    env.close()


@pytest.mark.slow
def test_ppo_learns_to_reach(tmp_path):
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    env = gymnasium.make("pliant/FreeBending-v0")

    def score(policy):
        return float(np.mean([played(env, seed, policy)[1].sum() for seed in range(100, 110)]))

    env.action_space.seed(0)
    random = score(lambda _: env.action_space.sample())
    model = stable_baselines3.PPO("MlpPolicy", env, seed=0, n_steps=512, batch_size=64, device="cpu")
    model.learn(10_000)
    learned = score(lambda seen: model.predict(seen, deterministic=True)[0])
    assert learned > 0.7 * random  # both negative: at least 30 % nearer
    env.close()


def test_a_finger_presses_with_the_wanted_force():
    """A share of the pressure that rises while the force is too small ends near it; none earns less."""
    env = gymnasium.make("pliant/Push-v0", episode_s=4.0)
    share = 0.0

    def integral(seen):
        nonlocal share
        share = min(max(share + 0.08 * (seen[-2] - seen[-3]), 0.0), 1.0)
        return np.array([2 * share - 1], np.float32)

    _, rewards, infos = played(env, 4, integral)
    assert infos[-1]["is_success"] and infos[-1]["press_n"] > 0.03
    _, nothing, _ = played(env, 4, lambda _: np.array([-1.0], np.float32))
    assert rewards.sum() > nothing.sum()
    env.close()


def test_the_pressures_of_inverse_statics_reach_around_the_shelf():
    env = gymnasium.make("pliant/ReachAround-v0", episode_s=5.0)
    inner = env.unwrapped
    task, scene = inner.task, inner.scene
    env.reset(seed=0, options={"shift_m": [0.0, 0.0, 0.0]})
    wanted = np.array(list(task.actuation(scene.arms[0].chain, task.config.arms[0]).values()))
    for k in range(100):
        rise = min((k + 1) / 50, 1.0)
        _, reward, _, _, info = env.step((2 * rise * wanted / 15e3 - 1).astype(np.float32))
    assert info["clearance_m"] > 0 and info["press_n"] == 0
    env.reset(seed=0, options={"shift_m": [0.0, 0.0, 0.0]})
    _, hanging, *_ = env.step(-np.ones(2, np.float32))
    assert reward > hanging + 0.2
    env.close()


def test_fingers_turn_the_object_by_the_wanted_angle():
    """The pressures that swing the fingers follow the turn that is left; those at rest earn less."""
    env = gymnasium.make("pliant/HoldAndTurn-v0")
    inner = env.unwrapped
    fingers, inputs = len(inner.scene.arms), len(inner.inputs)
    swing = inner._first_shares[0, inner.inputs.index("pressure_3_pa")] - inner._first_shares[0, -1]

    def integral(seen):
        nonlocal swing
        left = seen[-fingers * inputs - fingers - 1]
        swing = float(np.clip(swing + 0.1 * left, -1.0, 1.0))
        shares = np.tile(inner._first_shares[0], (fingers, 1))
        shares[:, 2:] = max(swing, 0.0), max(-swing, 0.0)
        return (2 * shares.ravel() - 1).astype(np.float32)

    still = (2 * inner._first_shares.ravel() - 1).astype(np.float32)
    rewards = []
    for policy in (integral, lambda _: still):
        seen, _ = env.reset(seed=0, options={"turn_rad": 0.25})
        total = 0.0
        for _ in range(60):
            seen, reward, _, _, info = env.step(policy(seen))
            total += reward
        rewards.append((total, info))
    assert rewards[0][1]["is_success"] and rewards[0][1]["held"] and not rewards[1][1]["is_success"]
    assert rewards[0][0] > rewards[1][0] + 10
    with pytest.raises(UserError, match="needs a number of radians"):
        env.reset(options={"turn_rad": "far"})
    env.close()


def test_the_gait_of_the_study_crawls_to_a_target_ahead():
    """The hand-made gait earns the way to the target; its mirror image, which crawls back, loses as much."""
    earned = []
    for late in (0, 1):
        env = gymnasium.make("pliant/Crawl-v0", episode_s=4.0)
        env.reset(seed=0, options={"target_m": 0.2})
        total = 0.0
        for k in range(80):
            share = 0.5 - 0.5 * np.cos(2 * np.pi * (0.05 * (k + 0.5) - 0.25 * np.array([1 - late, late])))
            _, reward, _, _, info = env.step((2 * share - 1).astype(np.float32))
            total += reward
        earned.append((total, info["position_m"]))
        env.close()
    (ahead, place), (back, _) = earned
    assert place > 0.02 and ahead > 1.0
    assert back < -0.5 * ahead
