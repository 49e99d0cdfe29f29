"""PPO with what fbql has: that it has the same, and what each step adds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fbql_fusion.core.learners.features import Scales, Situation
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.tasks.soccer.critic import CRITIC_INPUTS, critic_inputs
from fbql_fusion.core.tasks.soccer.task import SoccerTask
from fbql_studies.peers.fair_ppo import BEFORE, PUBLISHED_PPO, STEPS, TUNED_PPO, TUNED_SENSED_PPO
from fbql_studies.peers.ppo_settings import (
    FBQL_HOLD_STEPS,
    FBQL_PLAY_STEPS,
    FIRST_SETTING,
    PUBLISHED,
    TRIED,
    as_text,
    setting,
)
from fbql_studies.peers.senses import Senses

pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")

from fbql_studies.peers.choice_env import ChoiceEnv
from fbql_studies.peers.learners import TrainingPlan, learn
from fbql_studies.peers.team_env import SelectionEnv, shipped_behaviors


def worlds(count: int) -> list[Any]:
    """Worlds of a match in which each behavior drives for a while."""
    env, found = SelectionEnv(hold_steps=5), list[Any]()
    env.reset(seed=1)
    for index in range(count):
        *_, terminated, truncated, _ = env.step(index // 7 % 3)
        found.append(env.world)
        if terminated or truncated:
            env.reset()
    return found


def mirrored(world: Any) -> Any:
    """The same with left and right exchanged."""
    names = (
        "robot_y_m",
        "robot_yaw_rad",
        "robot_yaw_rate_rad_s",
        "ball_y_m",
        "ball_vy_m_s",
        "wall_y_m",
        "wall_yaw_rad",
    )
    return world._replace(**{name: -getattr(world, name) for name in names})


def test_situations_that_mirror_each_other_look_alike_but_for_their_leaves() -> None:
    behaviors = shipped_behaviors()
    leaves = sum(behavior.tree.leaf_count for behavior in behaviors)
    mirror, plain = (Senses(behaviors, references=False, mirror=each) for each in (True, False))
    differ = 0
    for world in worlds(60):
        one, two = ([behavior.answer(each) for behavior in behaviors] for each in (world, mirrored(world)))
        assert mirror.of(one)[:-leaves].tolist() == pytest.approx(mirror.of(two)[:-leaves].tolist(), abs=1e-6)
        assert mirror.of(one)[-leaves - 2] >= 0.0, "the sine of the last angle decides"
        assert mirror.of(one)[-leaves:].tolist() == plain.of(one)[-leaves:].tolist()
        differ += plain.of(one).tolist() != mirror.of(one).tolist()
    assert 0 < differ < 60


def test_the_mirror_is_that_of_fbqls_features() -> None:
    behaviors = shipped_behaviors()
    task = SoccerTask(10.0, -10.0, -0.2)
    found: list[Situation] = []
    for world in worlds(400):
        answers = [behavior.answer(world) for behavior in behaviors]
        found.append(Situation(tuple(each.leaf_id for each in answers), task.observed(world, answers)))
    scales = Scales.of(found, mirror=True)
    units = [feature.unit for behavior in behaviors for feature in behavior.tree.features]
    assert scales.signed.tolist() == [unit == "rad" for unit in units]
    assert scales.decisive == max(i for i, unit in enumerate(units) if unit == "rad")


def test_an_informed_observation_ends_with_what_only_fbqls_critic_sees() -> None:
    sensed, informed = ChoiceEnv(informed=False), ChoiceEnv()
    first, second = (env.reset(seed=4)[0] for env in (sensed, informed))
    assert (sensed.critic_only, informed.critic_only) == (0, CRITIC_INPUTS)
    assert second[:-CRITIC_INPUTS].tolist() == first.tolist()
    inputs = np.array(critic_inputs(informed.world, mirror=True), np.float32)
    assert second[-CRITIC_INPUTS:].tolist() == inputs.tolist()
    assert second in informed.observation_space
    for world in worlds(20):
        one, two = (informed.observe(each)[-CRITIC_INPUTS:] for each in (world, mirrored(world)))
        assert one.tolist() == two.tolist()
    assert not Senses(sensed.behaviors, references=False, mirror=True).width - len(first)


def test_its_choice_drives_as_a_selection_does_and_its_weights_as_a_blend() -> None:
    choice, selection = ChoiceEnv(hold_steps=3), SelectionEnv(hold_steps=3)
    for env in (choice, selection):
        env.reset(options={"episode_seed": 5})
        for index in range(60):
            env.step(index % 3)
    assert choice.world == selection.world
    with pytest.raises(ValueError, match="index of a behavior"):
        choice.step(3)
    weighted = ChoiceEnv(selects=False)
    weighted.reset(seed=0)
    weighted.step([0.1, -1.0, 0.4])


def test_a_choice_passes_gymnasiums_checker() -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(ChoiceEnv())


def test_decisions_are_held_as_long_as_fbqls() -> None:
    fbql = FusionParameters()
    assert round(fbql.fbql_hold_s / SoccerTask.period_s) == FBQL_HOLD_STEPS
    assert round(fbql.fbql_play_s / SoccerTask.period_s) == FBQL_PLAY_STEPS


def test_each_step_changes_one_thing() -> None:
    def parts(method: str) -> dict[str, Any]:
        fair = STEPS[method]
        own = fair.parameters
        rest = replace(own, hold_steps=1, discount=0.0)
        return {
            "selects": fair.selects,
            "hold": own.hold_steps,
            "mirrors": fair.mirrors,
            "informed": fair.informed,
            "settings": (rest, round(own.discount**own.hold_steps, 12)),
        }

    changes = {
        method: [name for name, value in parts(method).items() if value != parts(before)[name]]
        for method, before in BEFORE.items()
    }
    sensed = changes.pop(TUNED_SENSED_PPO)
    assert [*changes.values()] == [["selects"], ["hold"], ["mirrors"], ["informed"], ["settings"]]
    assert "informed" in sensed
    assert STEPS[TUNED_SENSED_PPO].informed < STEPS[TUNED_PPO].informed


def test_a_setting_depends_on_its_number_alone_and_all_are_of_the_space() -> None:
    found = [setting(number) for number in range(40)]
    assert found[0] == FIRST_SETTING
    assert found == [setting(number) for number in range(40)]
    assert len(set(found)) == 40
    for name, values in TRIED.items():
        assert {getattr(each, name) for each in found[1:]} == set(values)
        assert all(f"{name} " in as_text(each) for each in found)


def test_the_published_defaults_are_those_of_stable_baselines() -> None:
    ppo = pytest.importorskip("stable_baselines3", reason="an optional extra: requirements/peers.txt").PPO
    from inspect import signature

    defaults = {name: each.default for name, each in signature(ppo.__init__).parameters.items()}
    ours = (PUBLISHED.decisions, PUBLISHED.batch, PUBLISHED.epochs, PUBLISHED.learning_rate, PUBLISHED.discount)
    assert ours == tuple(defaults[name] for name in ("n_steps", "batch_size", "n_epochs", "learning_rate", "gamma"))
    more = (PUBLISHED.trace, PUBLISHED.clip, PUBLISHED.entropy)
    assert more == tuple(defaults[name] for name in ("gae_lambda", "clip_range", "ent_coef"))


def test_an_informed_critic_alone_sees_the_last_inputs_and_learns_from_them() -> None:
    torch = pytest.importorskip("torch", reason="an optional extra: requirements/peers.txt")
    from fbql_studies.peers.ppo import train

    behaviors = shipped_behaviors()
    parameters = replace(FIRST_SETTING, environments=2, decisions=64, batch=64, epochs=1)
    model, _ = train(lambda: ChoiceEnv(behaviors, hold_steps=4), 1500, 3, parameters)
    env = ChoiceEnv(behaviors)
    seen = torch.as_tensor(env.reset(seed=2)[0])[None]
    other = seen.clone()
    other[:, -CRITIC_INPUTS:] += 0.3
    policy = model.policy
    with torch.no_grad():
        probabilities = [policy.get_distribution(each).distribution.probs for each in (seen, other)]
        values = [policy.predict_values(each) for each in (seen, other)]
    assert torch.equal(*probabilities)
    assert not torch.equal(*values)
    changed = seen.clone()
    changed[:, 0] = -changed[:, 0]
    with torch.no_grad():
        assert not torch.equal(policy.get_distribution(changed).distribution.probs, probabilities[0])


@pytest.mark.parametrize("method", [PUBLISHED_PPO, TUNED_PPO])
def test_it_trains_for_its_budget_and_repeats(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3", reason="an optional extra: requirements/peers.txt")
    monkeypatch.setattr("fbql_studies.peers.learners.CHOOSING_EPISODES", 1)
    plan = TrainingPlan(shipped_behaviors(), 10_000, training_seed=50, evaluation_seed=1050, episodes=2)
    found = [learn(method, plan) for _ in range(2)]
    for learned in found:
        assert 10_000 <= learned.course.steps < 10_000 + 8 * 4
        assert learned.score.episodes == 2
    assert (found[0].score, found[0].played) == (found[1].score, found[1].played)
