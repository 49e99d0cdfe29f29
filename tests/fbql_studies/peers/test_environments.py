"""The environments that take the behaviors in: the checker, what an action means, and that the work is a session's work."""

from __future__ import annotations

import copy
import pickle
import warnings
from math import cos, sin
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.session import episode_seed
from fbql_sim.core.world_loop import WorldLoop

gymnasium = pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")

from fbql_studies.common.play import score_of  # noqa: E402
from fbql_studies.peers.play import score_in, score_of_law  # noqa: E402
from fbql_studies.peers.team_env import BLEND_ID, SELECTION_ID, BlendEnv, SelectionEnv, shipped_behaviors  # noqa: E402
from fbql_studies.peers.wheels import SeenFromRobot, Shaped, wheels_env  # noqa: E402

SEED = 1234
EPISODES = 3


@pytest.mark.parametrize(
    "made", [(BLEND_ID, {}), (BLEND_ID, {"action": "weights", "hold_steps": 7}), (SELECTION_ID, {})]
)
def test_the_environments_pass_gymnasiums_checker_without_a_warning(made: tuple[str, dict[str, Any]]) -> None:
    from gymnasium.utils.env_checker import check_env

    name, parameters = made
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, **parameters).unwrapped)


def test_equal_weights_play_the_very_match_of_a_session_with_equal_weights() -> None:
    behaviors = shipped_behaviors()
    env = BlendEnv(behaviors, action="weights", hold_steps=100_000)
    session = FusionParameters(controller="uniform", seed=SEED, episodes=EPISODES)
    score = score_in(env, lambda _: (1.0, 1.0, 1.0), SEED, EPISODES)
    assert score == score_of(session, behaviors, WorldLoop())
    assert score.steps > EPISODES


def test_how_long_a_constant_action_is_held_changes_nothing() -> None:
    scores = [
        score_in(BlendEnv(action="weights", hold_steps=hold), lambda _: (0.2, 0.0, 0.8), SEED, EPISODES)
        for hold in (1, 7, 100_000)
    ]
    assert scores[0] == scores[1] == scores[2]


def test_all_the_weight_on_a_behavior_is_that_behavior_alone_and_so_is_its_selection() -> None:
    blending, selecting = BlendEnv(action="weights"), SelectionEnv()
    for driver in range(3):
        worlds: list[Any] = []
        for env, action in ((blending, [float(i == driver) for i in range(3)]), (selecting, driver)):
            env.reset(options={"episode_seed": 5})
            for _ in range(50):
                env.step(action)
            worlds.append(env.world._replace(stamp_ns=0, episode=0))
        assert worlds[0] == worlds[1]
        world = blending.world
        answer = blending.behaviors[driver].answer(world)
        assert selecting.driver(driver)(world) == (answer.left_rad_s, answer.right_rad_s)


def test_logits_are_turned_into_weights_that_sum_to_one_in_their_order() -> None:
    env = BlendEnv()
    assert env.weights([0.3, 0.3, 0.3]) == pytest.approx([1 / 3] * 3)
    weights = env.weights([-0.5, 1.0, 0.0])
    assert sum(weights) == pytest.approx(1.0)
    assert weights[1] > weights[2] > weights[0] > 0.0
    assert env.weights([9.0, -9.0, -9.0])[0] > 0.999
    assert BlendEnv(action="weights").weights([0.0, 0.0, 0.0]) == [1 / 3] * 3
    with pytest.raises(ValueError, match="finite"):
        env.weights([np.nan, 0.0, 0.0])


def test_a_blend_sees_what_the_behaviors_sense_and_answer_and_their_leaves() -> None:
    env = BlendEnv()
    seen, _ = env.reset(seed=3)
    outputs = [behavior.answer(env.world) for behavior in env.behaviors]
    ball, wall, detour = outputs
    distance, bearing = ball.observation
    feature = env.behaviors[0].tree.features[0]
    scaled = 2.0 * (distance - feature.low) / (feature.high - feature.low) - 1.0
    share = ball.left_rad_s / MAX_WHEEL_RAD_S, ball.right_rad_s / MAX_WHEEL_RAD_S
    assert seen[:5].tolist() == pytest.approx([scaled, sin(bearing), cos(bearing), *share])
    error, psi = detour.observation
    assert seen[10:14].tolist() == pytest.approx([sin(error), cos(error), sin(psi), cos(psi)])
    counts = [behavior.tree.leaf_count for behavior in env.behaviors]
    leaves = seen[-sum(counts) :]
    assert np.flatnonzero(leaves).tolist() == [
        ball.leaf_id,
        counts[0] + wall.leaf_id,
        counts[0] + counts[1] + detour.leaf_id,
    ]
    joint_state, _ = (selection := SelectionEnv()).reset(seed=3)
    assert joint_state.tolist() == [output.leaf_id for output in outputs]
    assert selection.observation_space.nvec.tolist() == counts


@pytest.mark.parametrize(
    "copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"]
)
@pytest.mark.parametrize("kind", [BlendEnv, SelectionEnv])
def test_a_copy_continues_as_the_original_bit_for_bit(kind: Any, copy_of: Any) -> None:
    env = kind(hold_steps=3)
    env.reset(seed=2)
    env.action_space.seed(1)
    for _ in range(40):
        env.step(env.action_space.sample())
    other = copy_of(env)
    for _ in range(100):
        action = env.action_space.sample()
        one, two = env.step(action), other.step(action)
        assert env.world == other.world
        assert one[0].tobytes() == two[0].tobytes()
        assert one[1:] == two[1:]
        if one[2] or one[3]:
            env.reset()
            other.reset()


@pytest.mark.parametrize("action", [3, -1, 0.5, np.nan, None, "a", [0], [1.0, 0.0, 0.0], True])
def test_a_selection_that_is_no_behavior_is_refused_in_one_line(action: Any) -> None:
    env = SelectionEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"^an action is the index of a behavior, 0 \.\. 2, not [^\n]*$"):
        env.step(action)
    env.step(np.int64(2))


@pytest.mark.parametrize("action", [[1.0], [1.0] * 4, 1.0, None, [[1.0, 0.0, 0.0]], [np.inf, 0.0, 0.0]])
def test_weights_that_are_not_one_for_each_behavior_are_refused_in_one_line(action: Any) -> None:
    env = BlendEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"^[^\n]*action[^\n]*$"):
        env.step(action)


def test_an_unknown_kind_of_action_is_refused() -> None:
    with pytest.raises(BadInput, match="choose one of: logits, weights"):
        BlendEnv(action="logit")


def test_the_world_seen_from_the_robot_turns_with_it() -> None:
    env = SeenFromRobot(wheels_env(1).unwrapped)
    env.reset(seed=1)
    world = env.unwrapped.world
    world = world._replace(robot_x_m=0.5, robot_y_m=0.1, robot_yaw_rad=np.pi / 2, ball_x_m=0.5, ball_y_m=0.4)
    env.unwrapped._loop._world = world._replace(ball_vx_m_s=1.0, ball_vy_m_s=0.0, wall_x_m=0.5, wall_y_m=0.9)
    seen = env.observation(None).tolist()
    # Looking along +y: the ball is 0.3 m ahead and rolls to the right, the goal is 0.6 m to the right and 0.1 m behind.
    assert seen[:8] == pytest.approx([0.3, 0.0, 0.0, -1.0, -0.1, -0.6, 0.8, 0.0], abs=1e-6)
    assert seen[16:] == pytest.approx([0.3, (0.6**2 + 0.4**2) ** 0.5])
    assert np.array(seen, np.float32) in env.observation_space


def test_shaping_adds_the_progress_from_the_start_to_the_end_and_nothing_else() -> None:
    plain, shaped = wheels_env(5, max_steps=60), wheels_env(5, shaped=True, max_steps=60)
    assert isinstance(shaped, Shaped)
    rng = np.random.default_rng(0)
    for seed in (4, 5):
        plain.reset(seed=seed)
        shaped.reset(seed=seed)
        begun, gained, ended = shaped.potential(), 0.0, False
        while not ended:
            action = rng.uniform(-1.0, 1.0, 2)
            (_, unshaped, *_), (_, reward, terminated, truncated, _) = plain.step(action), shaped.step(action)
            gained += reward - unshaped
            ended = terminated or truncated
        assert gained == pytest.approx(shaped.potential() - begun)
        assert gained != 0.0


def test_the_scripted_law_through_the_environment_scores() -> None:
    score = score_of_law(SEED, EPISODES)
    assert (score.goals, score.own_goals, score.timeouts) == (EPISODES, 0, 0)


def test_a_frozen_policy_meets_the_episodes_of_a_session() -> None:
    env, seeds = SelectionEnv(hold_steps=1000, max_steps=3), list[int]()
    reset = env.reset

    def listening(**options: Any) -> Any:
        begun = reset(**options)
        seeds.append(begun[1]["episode_seed"])
        return begun

    env.reset = listening  # type: ignore[method-assign]
    score = score_in(env, lambda _: 0, SEED, EPISODES)
    assert seeds == [episode_seed(SEED, index) for index in range(EPISODES)]
    assert (score.timeouts, score.steps) == (EPISODES, 3 * EPISODES)
