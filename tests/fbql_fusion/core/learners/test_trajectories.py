"""The decisions of an episode: what each is credited with, and what may not be learned from."""

from __future__ import annotations

from fbql_fusion.core.learners.features import Situation
from fbql_fusion.core.learners.trajectories import Trajectory

SITUATION = Situation((0, 1), ((0.5,), (0.5,)), (), None, None)
BOTH = (True, True)


def begun(trajectory: Trajectory, driver: int) -> None:
    trajectory.begin_decision(SITUATION, [3], BOTH, driver, 0.5)


def test_each_decision_has_the_rewards_and_the_discount_of_its_own_steps() -> None:
    episode = Trajectory(guided=False)
    begun(episode, 1)
    assert (episode.rewards, episode.discounts) == ([0.0], [1.0])
    assert all([episode.add_step(1, 2.0, 0.5), episode.add_step(1, 4.0, 0.5), episode.add_step(1, 8.0, 0.5)])
    begun(episode, 0)
    assert all([episode.add_step(0, 16.0, 0.5), episode.add_step(0, 32.0, 0.5)])
    assert episode.drivers == [1, 0]
    assert episode.rewards == [2.0 + 4.0 / 2 + 8.0 / 4, 16.0 + 32.0 / 2]
    assert episode.discounts == [1 / 8, 1 / 4]


def test_the_reward_of_a_step_in_which_nobody_could_drive_belongs_to_the_last_decision() -> None:
    episode = Trajectory(guided=False)
    episode.wait(9.0, 0.5)  # before the first decision: nobody's
    begun(episode, 1)
    episode.add_step(1, 2.0, 0.5)
    begun(episode, 0)
    episode.add_step(0, 4.0, 0.5)
    episode.add_step(0, 4.0, 0.5)
    episode.wait(16.0, 0.5)
    episode.wait(16.0, 0.5)
    assert episode.rewards == [2.0, 4.0 + 4.0 / 2 + 16.0 / 4 + 16.0 / 8]
    assert episode.discounts == [1 / 2, 1 / 16]


def test_a_step_without_a_decision_or_a_driver_cannot_be_learned_from() -> None:
    episode = Trajectory(guided=False)
    assert not episode.add_step(1, 1.0, 0.5)
    begun(episode, 1)
    assert not episode.add_step(-1, 1.0, 0.5)
    assert (episode.rewards, episode.discounts) == ([0.0], [1.0])
    assert episode.add_step(0, 1.0, 0.5), "behavior 0 is a driver like any other"


def test_the_driver_of_a_guided_decision_is_the_one_of_its_first_step() -> None:
    episode = Trajectory(guided=True)
    for driver in (1, 0):
        begun(episode, 1 - driver)
        for _ in range(2):
            assert episode.add_step(driver, 0.0, 0.5)
    assert episode.add_step(1, 0.0, 0.5)
    assert episode.drivers == [1, 0]


def test_an_episode_has_one_situation_more_than_decisions_and_did_not_end_well_unless_told() -> None:
    episode = Trajectory(guided=False)
    begun(episode, 1)
    episode.end(SITUATION, [4], (True, False))
    assert (episode.rows, episode.masks, episode.situations) == ([[3], [4]], [BOTH, (True, False)], [])
    assert (episode.terminated, episode.succeeded) == (False, False)
    raw = Trajectory(guided=False)  # before there are features, situations are kept in their place
    raw.begin_decision(SITUATION, None, BOTH, 1, 0.5)
    raw.end(SITUATION, None, BOTH)
    assert (raw.rows, len(raw.situations), len(raw.masks)) == ([], 2, 2)
