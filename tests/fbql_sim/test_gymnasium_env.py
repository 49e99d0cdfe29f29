"""The Gymnasium environment: Gymnasium's own checker, seeds, rewards, the two ends, and what it says when it can't."""

from __future__ import annotations

import copy
import pickle
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_fusion.core.session import episode_seed
from fbql_sim.core.scripted_law import law
from fbql_sim.core.world_loop import WorldLoop
from patience import PATIENCE_S
from places import ROOT

gymnasium = pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")
WITHOUT_GYMNASIUM = """
import sys
sys.modules["gymnasium"] = None
import fbql_sim, fbql_sim.core.world_loop
try:
    import fbql_sim.gymnasium_env
except ModuleNotFoundError as error:
    print(error)
"""


PAGE = ROOT / "docs" / "peers.md"


def made(**parameters: Any) -> Any:
    import fbql_sim.gymnasium_env as module

    return gymnasium.make(module.WHEELS_ID, **parameters).unwrapped


def made_bare(**parameters: Any) -> Any:
    """Without Gymnasium's own checks of what it passes on."""
    import fbql_sim.gymnasium_env as module

    return module.WheelsEnv(**parameters)


def by_law(env: Any) -> np.ndarray[Any, Any]:
    return np.array(law(env.world)) / MAX_WHEEL_RAD_S


def test_the_environment_passes_gymnasiums_checker_without_a_warning() -> None:
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made())
        check_env(made(hold_steps=7, reward_collision=-0.3, max_steps=50))


def played(env: Any, seed: int) -> list[bytes]:
    env.action_space.seed(seed)
    seen: list[bytes] = []
    for episode in range(3):
        observation, _ = env.reset(seed=seed if episode == 0 else None)
        seen.append(observation.tobytes())
        ended = False
        while not ended:
            observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
            seen.append(observation.tobytes() + np.float64(reward).tobytes())
            ended = terminated or truncated
    return seen


def test_the_same_seed_gives_the_same_episodes_bit_for_bit_whatever_was_played_before() -> None:
    env = made(max_steps=100)
    first = played(env, 5)
    assert played(env, 6) != first
    assert played(env, 5) == first
    assert played(made(max_steps=100), 5) == first


def test_an_episode_seed_plays_the_episode_of_a_session() -> None:
    env, loop = made(), WorldLoop()
    seed = episode_seed(1000, 3)
    observation, info = env.reset(options={"episode_seed": seed})
    assert info == {"episode_seed": seed}
    world = loop.reset(0, seed)
    for _ in range(200):
        assert env.world == world
        assert observation.tolist() == np.array(world[3:15], np.float32).tolist()
        observation, *_ = env.step(np.array([0.5, 0.625], np.float32))
        world = loop.step(0.5 * MAX_WHEEL_RAD_S, 0.625 * MAX_WHEEL_RAD_S)


def test_an_action_beyond_full_velocity_is_full_velocity() -> None:
    ends: list[Any] = []
    for action in ([1.0, -1.0], [30.0, -1.5]):
        env = made()
        env.reset(seed=0)
        env.step(np.array(action))
        ends.append(env.world)
    assert ends[0] == ends[1]


@pytest.mark.parametrize("hold_steps", [1, 3])
def test_the_return_is_what_happened_priced_and_a_goal_terminates(hold_steps: int) -> None:
    env = made(hold_steps=hold_steps, reward_goal=7, reward_own_goal=-3.0, reward_collision=-0.25)
    goals = collisions = 0
    for episode in range(6):
        env.reset(options={"episode_seed": episode})
        total, begun, steps, ended = 0.0, 0, 0, False
        while not ended:
            _, reward, terminated, truncated, info = env.step(by_law(env))
            ended = terminated or truncated
            total += reward
            begun += info["collisions_begun"]
            steps += info["steps"]
        assert steps == env.world.step
        assert (terminated, truncated) == (env.world.terminated, env.world.truncated)
        assert total == 7.0 * info["goal"] - 3.0 * info["own_goal"] - 0.25 * begun
        goals += info["goal"]
        collisions += begun
    assert goals >= 5
    assert collisions > 0, "no episode had a collision to price"


def test_an_own_goal_terminates_and_costs() -> None:
    env = made(reward_collision=0)
    for episode in range(200):
        env.reset(options={"episode_seed": episode})
        ended = False
        while not ended:
            world = env.world
            mirrored = world._replace(robot_x_m=-world.robot_x_m, ball_x_m=-world.ball_x_m)
            mirrored = mirrored._replace(ball_vx_m_s=-world.ball_vx_m_s, wall_x_m=-world.wall_x_m)
            mirrored = mirrored._replace(
                robot_yaw_rad=np.pi - world.robot_yaw_rad, wall_yaw_rad=np.pi - world.wall_yaw_rad
            )
            left, right = law(mirrored)  # who drives in a mirror has left and right the other way round
            _, reward, terminated, truncated, info = env.step(np.array([right, left]) / MAX_WHEEL_RAD_S)
            ended = terminated or truncated
        if info["own_goal"]:
            assert (reward, terminated, truncated) == (-10.0, True, False)
            return
    pytest.fail("the mirrored law never scored an own goal")


def test_the_time_limit_truncates_and_cuts_a_held_action_short() -> None:
    env = made(hold_steps=4, max_steps=10)
    env.reset(seed=0)
    ends = [env.step(np.zeros(2))[2:] for _ in range(3)]
    assert [(terminated, truncated, info["steps"]) for terminated, truncated, info in ends] == [
        (False, False, 4),
        (False, False, 4),
        (False, True, 2),
    ]


def test_what_is_observed_is_within_the_bounds_whatever_the_world() -> None:
    env = made()
    env.reset(seed=0)
    wild = env.world._replace(ball_vx_m_s=1e3, robot_yaw_rate_rad_s=-1e9, robot_yaw_rad=np.pi)
    assert env.observe(wild) in env.observation_space
    assert env.observe(env.world) in env.observation_space


@pytest.mark.parametrize(
    ("parameters", "said"),
    [({"hold": 2}, "unknown parameter 'hold'"), ({"hold_steps": 0}, "hold_steps"), ({"dt_s": "x"}, "dt_s")],
)
def test_parameters_that_cannot_be_used_are_refused(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        made(**parameters)


@pytest.mark.parametrize("options", [{"seed": 1}, {"episode_seed": -1}, {"episode_seed": 1.5}])
def test_reset_options_that_cannot_be_used_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match="reset option"):
        made().reset(options=options)


@pytest.mark.parametrize(
    "action",
    [[np.nan, 0.0], [0.0, np.inf], [0.0], [0.0] * 3, [[0.0, 0.0]], 0.5, None, "ab", ["1", "2"], [True, False],
     [1j, 0.0], [[0.0], [0.0, 1.0]], []],
)  # fmt: skip
def test_an_action_that_is_not_two_numbers_is_refused_in_one_line_and_nothing_moves(action: Any) -> None:
    env = made(hold_steps=4)
    env.reset(seed=0)
    before = env.world
    with pytest.raises(ValueError, match=r"^[^\n]*action[^\n]*$"):
        env.step(action)
    assert env.world == before
    env.step([0.5, 1])


@pytest.mark.parametrize("options", [5, "episode_seed", {"episode_seed": True}, {1: 2}])
def test_reset_options_of_a_wrong_kind_are_refused_and_the_episode_goes_on(options: Any) -> None:
    env = made()
    env.reset(seed=0)
    before = env.world
    with pytest.raises(BadInput, match=r"^environment: [^\n]*reset option[^\n]*$"):
        env.reset(seed=1, options=options)
    assert env.world == before
    env.step(np.zeros(2))


@pytest.mark.parametrize("action", [np.zeros(2), np.array([np.nan, 0.0])])
def test_a_step_outside_of_an_episode_is_refused_in_one_line_whatever_the_action(action: Any) -> None:
    env = made(max_steps=2)
    with pytest.raises(RuntimeError, match=r"^no episode has begun: call reset first$"):
        env.step(action)
    env.reset(seed=0)
    env.step(np.zeros(2))
    env.step(np.zeros(2))
    for _ in range(2):
        with pytest.raises(RuntimeError, match=r"^episode 0 ended at step 2: call reset first$"):
            env.step(action)
    env.reset()
    env.step(np.zeros(2))


# Copies, and what other libraries do with an environment


def by_pickle(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


@pytest.mark.parametrize("copy_of", [copy.deepcopy, by_pickle])
@pytest.mark.parametrize("hold_steps", [1, 3])
def test_a_copy_continues_as_the_original_bit_for_bit(copy_of: Callable[[Any], Any], hold_steps: int) -> None:
    """Also amid a contact with a wall, which the solver of the physics remembers; and in the episodes after this one."""
    env = made(hold_steps=hold_steps, max_steps=300)
    env.reset(seed=4)
    rng = np.random.default_rng(3)
    copies = [(copy_of(env), env.world)]
    in_contact = False
    while not in_contact:
        _, _, terminated, truncated, info = env.step([1.0, 0.9])
        in_contact = info["collision_steps"] > 0
        if terminated or truncated:
            env.reset()
    copies.append((copy_of(env), env.world))
    copies.append((copy_of(copy_of(env)), env.world))
    for other, world in copies:
        assert other.world == world
    other = copies[-1][0]
    for _ in range(700):
        action = rng.uniform(-1.0, 1.0, 2).astype(np.float32) if rng.random() < 0.5 else np.ones(2, np.float32)
        one, two = env.step(action), other.step(action)
        assert env.world == other.world
        assert one[0].tobytes() == two[0].tobytes()
        assert one[1:] == two[1:]
        if one[2] or one[3]:
            assert env.reset()[1] == other.reset()[1]
    assert copies[1][0].world == copies[1][1], "a copy is not moved by the original"


@pytest.mark.parametrize("copy_of", [copy.deepcopy, by_pickle])
def test_a_copy_before_the_first_and_after_the_last_step_is_in_the_same_state(copy_of: Callable[[Any], Any]) -> None:
    env = made(max_steps=2)
    with pytest.raises(RuntimeError, match="no episode has begun"):
        copy_of(env).step(np.zeros(2))
    env.reset(seed=0)
    for _ in range(2):
        env.step(np.zeros(2))
    with pytest.raises(RuntimeError, match="ended at step 2"):
        copy_of(env).step(np.zeros(2))
    assert copy_of(env).reset()[1] == env.reset()[1]


def test_make_takes_the_render_mode_that_other_libraries_pass_on() -> None:
    """Stable-Baselines3's make_vec_env calls gymnasium.make(id, render_mode=None, **env_kwargs)."""
    assert made(render_mode=None, hold_steps=2).render_mode is None
    with pytest.raises(BadInput, match=r"^environment: render_mode is 'human', but there is no rendering[^\n]*$"):
        import fbql_sim.gymnasium_env as module

        module.WheelsEnv(render_mode="human")


def test_without_a_render_mode_nothing_is_rendered() -> None:
    """Stable-Baselines3's VecEnv.render and others call it whatever the mode."""
    env = made()
    env.reset(seed=0)
    assert env.render() is None


@pytest.mark.parametrize("value", [10**400, -(10**400), 10**5000], ids=["large", "negative", "endless"])
@pytest.mark.parametrize("name", ["dt_s", "reward_goal", "hold_steps", "max_steps"])
def test_a_whole_number_beyond_every_float_is_refused(name: str, value: int) -> None:
    with pytest.raises(BadInput, match=rf"^environment: parameter '{name}' is [^\n]*, outside of [^\n]*$"):
        made(**{name: value})


@pytest.mark.parametrize("name", ["render_mode", "dt_s", "hold_steps"])
def test_a_value_that_python_cannot_write_is_refused_all_the_same(name: str) -> None:
    with pytest.raises(BadInput, match=r"^environment: [^\n]* a list with too many digits[^\n]*$"):
        made_bare(**{name: [10**5000]})


@pytest.mark.parametrize("options", [10**5000, {"episode_seed": 10**5000}, {"episode_seed": [10**5000]}], ids=range(3))
def test_reset_options_that_python_cannot_write_are_refused_all_the_same(options: Any) -> None:
    with pytest.raises(BadInput, match=r"^environment: [^\n]*reset option[^\n]*$"):
        made().reset(options=options)


def test_an_action_of_longdoubles_is_that_of_the_nearest_floats() -> None:
    ends: list[Any] = []
    for kind in (np.longdouble, np.float64):
        env = made()
        env.reset(seed=0)
        env.step(np.array([1e-320, -0.0], np.float64).astype(kind))
        ends.append(env.world)
    assert ends[0] == ends[1]


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_many_environments_can_be_made_at_once(mode: str) -> None:
    import fbql_sim.gymnasium_env as module

    many = gymnasium.make_vec(
        f"{module.__name__}:{module.WHEELS_ID}",
        num_envs=2,
        vectorization_mode=mode,
        vector_kwargs={"context": "spawn"} if mode == "async" else None,
        render_mode=None,
        max_steps=5,
    )
    try:
        seen, _ = many.reset(seed=[1, 2])
        assert seen.shape == (2, 12)
        for _ in range(5):
            _, _, _, truncated, _ = many.step(np.zeros((2, 2), np.float32))
        assert truncated.tolist() == [True, True]
    finally:
        many.close()


def test_without_gymnasium_the_package_works_and_the_environment_says_what_is_missing_in_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_GYMNASIUM], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == (
        "fbql_sim.gymnasium_env needs Gymnasium, which is an optional extra: pip install gymnasium\n"
    )


def test_the_example_of_the_page_plays_an_episode(capsys: pytest.CaptureFixture[str]) -> None:
    [example] = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), flags=re.MULTILINE | re.DOTALL)
    exec(compile(example, str(PAGE), "exec"), {})
    steps, goal, truncated = capsys.readouterr().out.split()
    assert 0 < int(steps) <= 4000
    assert (goal, truncated) in {("True", "False"), ("False", "True"), ("False", "False")}


def test_the_page_tells_the_rewards_that_are_the_defaults() -> None:
    parameters = made().parameters
    told = f"{parameters.reward_goal:g} for a goal, {parameters.reward_own_goal:g} for an own goal"
    assert f"{told}, {parameters.reward_collision:g} for a collision when it begins" in PAGE.read_text()
